"""Causes outside the effect library: a diagnosis of these must name none of its effects."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.cause import UM, Cause, CauseInputs, unit_rms_scatter
from compd.simulation.truth.mechanism import Mechanism

# A cable comes taut at this distance from machine zero; its drag is stated this much farther out.
TAUT_AT_MM = 10.0
STATED_AFTER_MM = 100.0


class HumiditySwelling(Cause):
    """Swelling of carbon fibre links in humid air: extension_i = s (h - h0) L_i / L0_i. Strength: s."""

    id = "humidity_swelling"
    unit = "um/pct"
    max_strength = 0.5
    in_library = False
    covariates = ("humidity_pct",)

    def link_extension_mm(self, inputs: CauseInputs) -> FloatArray:
        since_zero_pct = inputs.humidity_pct - inputs.air0.humidity_pct
        return np.asarray(self.strength * UM * since_zero_pct * inputs.link_mm / self.mechanism.lengths0_mm)


class PlateSwelling(Cause):
    """Swelling of the granite's top face in humid air bows the plate upwards: the tip stands lower over its middle.

    shift_z = -s (h - h0) (1 - r^2 / R^2), r the tip's and R the plate points' distance from the middle.
    Strength: s, the rise of the middle.
    """

    id = "plate_swelling"
    unit = "um/pct"
    max_strength = 0.5
    acts_on_frame = True
    in_library = False
    covariates = ("humidity_pct",)

    def reference_shift(self, inputs: CauseInputs) -> FloatArray:
        plate = self.mechanism.plate0_M - self.mechanism.plate0_M.mean(axis=0)
        share = 1 - (inputs.tip_M[:2] ** 2).sum() / (plate[:, :2] ** 2).sum(axis=1).mean()
        return np.array([0.0, 0.0, -self.strength * UM * (inputs.humidity_pct - inputs.air0.humidity_pct) * share])


class AirPressure(Cause):
    """Sealed bellows around the links act as pistons: extension_i = -s (p - p0). Strength: s."""

    id = "air_pressure"
    unit = "um/hPa"
    max_strength = 0.5
    in_library = False
    covariates = ("pressure_hPa",)

    def link_extension_mm(self, inputs: CauseInputs) -> FloatArray:
        extension_mm = -self.strength * UM * (inputs.pressure_hPa - inputs.air0.pressure_hPa)
        return np.full(self.mechanism.links, extension_mm)


class CableDrag(Cause):
    """Pull of a cable that hangs slack near machine zero and comes taut where the tip is more than 10 mm towards +x.

    shift = s max(0, x - x0 - 10 mm) / 100 mm along (-1, 0, 0.3). Strength: s.
    """

    id = "cable_drag"
    unit = "um"
    max_strength = 20.0
    in_library = False
    covariates = ("position",)

    def tool_shift(self, inputs: CauseInputs) -> FloatArray:
        taut = max(0.0, float(inputs.tip_M[0] - self.mechanism.tip0_M[0]) - TAUT_AT_MM) / STATED_AFTER_MM
        return self.strength * UM * taut * np.array([-1.0, 0.0, 0.3])


class CollisionStep(Cause):
    """Step of the tip's place at a collision, at a time drawn between 5000 and 40000 s.

    Strength: root mean square of the step's three components.
    """

    id = "collision_step"
    unit = "um"
    max_strength = 50.0
    signed = True
    in_library = False
    covariates = ("time_s",)

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self.hit_s = float(rng.uniform(5000.0, 40000.0))
        self.part_strengths = strength * unit_rms_scatter(rng, 3)

    def tool_shift(self, inputs: CauseInputs) -> FloatArray | float:
        return UM * self.part_strengths if inputs.time_s >= self.hit_s else 0.0


class RoomBreathing(Cause):
    """Ventilation that switches on and off moves the floor, and with it the instrument's stand, periodically.

    shift = s (sin(2 pi t / T + phi) - sin phi) along (0.3, 0, 1). Strength: s, the amplitude; the period T is drawn
    between 600 and 1500 s.
    """

    id = "room_breathing"
    unit = "um"
    max_strength = 10.0
    in_library = False
    covariates = ("time_s",)

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self.period_s = float(rng.uniform(600.0, 1500.0))
        self._phase_rad = rng.uniform(0, 2 * np.pi)

    def reference_shift(self, inputs: CauseInputs) -> FloatArray:
        phase_rad = 2 * np.pi * inputs.time_s / self.period_s
        wave = np.sin(phase_rad + self._phase_rad) - np.sin(self._phase_rad)
        return np.asarray(self.strength * UM * wave * np.array([0.3, 0.0, 1.0]))


CAUSES = (HumiditySwelling, PlateSwelling, AirPressure, CableDrag, CollisionStep, RoomBreathing)
