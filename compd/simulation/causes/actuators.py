"""Causes in actuators that move base joints: rails and cranks that are not quite as drawn."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.cause import UM, URAD, Cause, CauseInputs, unit_rms_scatter
from compd.simulation.truth.mechanism import Mechanism


class RailDirection(Cause):
    """Rails turned against the drawing, each about its place at machine zero by its own constant rotation vector.

    shift = r x s, s the way of the joint since machine zero. The joints of one rail turn together. Strength: root mean
    square of all components of the r.
    """

    id = "rail_direction"
    unit = "urad"
    max_strength = 1000.0
    signed = True
    in_library = False
    covariates = ("position",)

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self.part_strengths = strength * unit_rms_scatter(rng, mechanism.scales, 3)

    @classmethod
    def applies_to(cls, mechanism: Mechanism) -> bool:
        return "slides" in mechanism.kinds

    def base_shift_M(self, inputs: CauseInputs) -> FloatArray:
        turns = URAD * self.part_strengths[self.mechanism.scale_of_link]
        return np.cross(turns, self.mechanism.moves_M(inputs.scale_mm))


class CrankRadius(Cause):
    """Cranks longer or shorter than drawn, each by its own constant.

    shift = s dr / r, s the way of the joint since machine zero: the angles are as the scales say. Strength: root mean
    square of the dr.
    """

    id = "crank_radius"
    unit = "um"
    max_strength = 100.0
    signed = True
    in_library = False
    covariates = ("position",)

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self.part_strengths = strength * unit_rms_scatter(rng, mechanism.scales)
        radii_mm = [getattr(actuator, "radius_mm", np.inf) for actuator in mechanism.geometry.mechanism.actuators]
        self._shares: FloatArray = (UM * self.part_strengths / np.array(radii_mm))[mechanism.scale_of_link]

    @classmethod
    def applies_to(cls, mechanism: Mechanism) -> bool:
        return "turns" in mechanism.kinds

    def base_shift_M(self, inputs: CauseInputs) -> FloatArray:
        return np.asarray(self._shares[:, None] * self.mechanism.moves_M(inputs.scale_mm))


CAUSES = (RailDirection, CrankRadius)
