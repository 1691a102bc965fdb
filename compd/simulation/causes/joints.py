"""Causes in the joints and in the platform that carries them."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.cause import PPM, UM, URAD, Cause, CauseInputs, unit_rms_scatter
from compd.simulation.truth.closure import homogeneous
from compd.simulation.truth.joints import Runout, angles, hinge_axes_M, link_directions, triads
from compd.simulation.truth.mechanism import Mechanism

# Share of its link's temperature that a platform joint takes, by conduction.
FROM_LINK_SHARE = 0.15


class BaseJointPosition(Cause):
    """Base joint centres displaced from the drawing, each by its own constant vector in {M}.

    Strength: root mean square of all components.
    """

    id = "base_joint_position"
    unit = "um"
    max_strength = 100.0
    signed = True

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self.part_strengths = strength * unit_rms_scatter(rng, mechanism.links, 3)

    def base_shift_M(self, inputs: CauseInputs) -> FloatArray:
        return np.asarray(UM * self.part_strengths)


class PlatformJointPosition(Cause):
    """Platform joint centres displaced from the drawing, each by its own constant vector in {P}.

    Strength: root mean square of all components.
    """

    id = "platform_joint_position"
    unit = "um"
    max_strength = 100.0
    signed = True

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self.part_strengths = strength * unit_rms_scatter(rng, mechanism.links, 3)

    def platform_shift_P(self, inputs: CauseInputs) -> FloatArray:
        return np.asarray(UM * self.part_strengths)


class JointRunout(Cause):
    """Form error of balls and sockets: the base joint's centre moves across the link as the joint turns.

    Harmonics of the two joint angles, as in `truth.joints.Runout`; the component along the link is removed, for the
    comparators measure it. Strength: amplitude of the first harmonic, um.
    """

    id = "joint_runout"
    unit = "um"
    max_strength = 20.0

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        directions_M = link_directions(mechanism.joints0_M, homogeneous(mechanism.joints_P) @ mechanism.posture0)
        axes_M = hinge_axes_M(mechanism)
        self._triads = triads(directions_M, axes_M)
        self._runout = Runout(mechanism.links, strength * np.array([0.0, 1.0, 1.0]), rng)

    def base_shift_M(self, inputs: CauseInputs) -> FloatArray:
        shift_mm = self._runout.displacement_mm(angles(self._triads, inputs.directions_M))
        shift_M = (shift_mm[:, :, None] * self._triads).sum(axis=1)
        along_mm = (shift_M * inputs.directions_M).sum(axis=1, keepdims=True)
        return np.asarray(shift_M - along_mm * inputs.directions_M)


class PlatformExpansion(Cause):
    """Thermal expansion of the platform: joint centre c_i moves by alpha c_i dT_arm,i, in {P}, dT since machine zero.

    dT_arm,i is the platform's plus 7.5 % of what the end of link i departs from it. Strength: alpha.
    """

    id = "platform_expansion"
    unit = "ppm/K"
    max_strength = 25.0

    def platform_shift_P(self, inputs: CauseInputs) -> FloatArray:
        hub_K = inputs.warm.since_zero_K("platform")
        arms_K = hub_K + FROM_LINK_SHARE / 2 * (inputs.warm.link_pieces_K[:, -1] - hub_K)
        return np.asarray(self.strength * PPM * self.mechanism.joints_P * arms_K[:, None])


class RevoluteAxisTilt(Cause):
    """Revolute axes turned about z of {P}, each by its own constant angle; strength: root mean square of the angles."""

    id = "revolute_axis_tilt"
    unit = "urad"
    max_strength = 500.0
    signed = True

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self.part_strengths = strength * unit_rms_scatter(rng, max(len(mechanism.axes_P), 1))

    @classmethod
    def applies_to(cls, mechanism: Mechanism) -> bool:
        return len(mechanism.axes_P) > 0

    def tilted_axes_P(self, axes_P: FloatArray) -> FloatArray:
        turn = URAD * self.part_strengths[: len(axes_P)]
        x, y, z = axes_P.T
        return np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z], axis=1)


CAUSES = (BaseJointPosition, PlatformJointPosition, JointRunout, PlatformExpansion, RevoluteAxisTilt)
