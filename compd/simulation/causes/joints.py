"""Causes in joints, platform and tool."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.cause import PPM, UM, URAD, Cause, CauseInputs, Values, parts
from compd.simulation.truth.closure import homogeneous
from compd.simulation.truth.joints import Runout, angles, link_directions, triads
from compd.simulation.truth.mechanism import Mechanism

# What a joint takes of its link's temperature, and a tool's stem of the platform's, by conduction.
FROM_LINK_SHARE = 0.15
FROM_PLATFORM_SHARE = 0.15
# A probe's springs give alike in all directions, its stem only sideways.
ALONG_TOOL_SHARE = 0.9


class BaseJointPosition(Cause):
    """Base joints sit elsewhere than drawn, each by its own vector; strength: root mean square of the components."""

    id, unit, most, signed = "base_joint_position", "um", 100.0, True

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self._um = strength * parts(rng, machine.links, 3)

    @property
    def values(self) -> Values:
        return tuple(self._um.ravel().tolist())

    def base_M(self, now: CauseInputs) -> FloatArray | float:
        return np.asarray(UM * self._um)


class PlatformJointPosition(BaseJointPosition):
    """Platform joints sit elsewhere than drawn."""

    id = "platform_joint_position"

    def base_M(self, now: CauseInputs) -> float:
        return 0.0

    def platform_P(self, now: CauseInputs) -> FloatArray:
        return np.asarray(UM * self._um)


class JointRunout(Cause):
    """Balls and sockets that are not round let the centre wander sideways, where no comparator looks."""

    id, unit, most = "joint_runout", "um", 20.0

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        directions_M = link_directions(machine.joints0_M, homogeneous(machine.joints_P) @ machine.posture0)
        self._triads = triads(directions_M, machine.axes_P @ machine.posture0[1:] if len(machine.axes_P) else None)
        self._runout = Runout(machine.links, strength * np.array([0.0, 1.0, 1.0]), rng)

    def base_M(self, now: CauseInputs) -> FloatArray:
        moved = self._runout.displacement_mm(angles(self._triads, now.directions_M))
        moved_M = (moved[:, :, None] * self._triads).sum(axis=1)
        # along the link as it stands now the comparators do look
        along_mm = (moved_M * now.directions_M).sum(axis=1, keepdims=True)
        return np.asarray(moved_M - along_mm * now.directions_M)


class PlatformExpansion(Cause):
    """The platform's arms grow; each ends at a joint that has some of its link's temperature."""

    id, unit, most = "platform_expansion", "ppm/K", 25.0

    def platform_P(self, now: CauseInputs) -> FloatArray:
        hub_K = now.warm.over_reference_K("platform")
        arms_K = hub_K + FROM_LINK_SHARE / 2 * (now.warm.link_pieces_K[:, -1] - hub_K)
        return np.asarray(self.strength * PPM * self.machine.joints_P * arms_K[:, None])


class RevoluteAxisTilt(Cause):
    """Ball shanks bored askew turn each revolute axis in the platform's plane by its own angle."""

    id, unit, most, signed = "revolute_axis_tilt", "urad", 500.0, True

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self._urad = strength * parts(rng, max(len(machine.axes_P), 1))

    @property
    def values(self) -> Values:
        return tuple(self._urad.tolist())

    def axes_P(self, axes_P: FloatArray) -> FloatArray:
        turn = URAD * self._urad[: len(axes_P)]
        x, y, z = axes_P.T
        return np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z], axis=1)


class ToolExpansion(Cause):
    """The tool grows; where it is clamped it has some of the platform's temperature."""

    id, unit, most = "tool_expansion", "ppm/K", 25.0

    def tool(self, now: CauseInputs) -> FloatArray:
        tool_K, clamp_K = (now.warm.over_reference_K(body) for body in ("tool", "platform"))
        mean_K = tool_K + FROM_PLATFORM_SHARE * (clamp_K - tool_K)
        return np.asarray(self.strength * PPM * _tool(self.machine) * mean_K)


class ToolOffset(Cause):
    """The tip sits elsewhere on what carries it."""

    id, unit, most, signed = "tool_offset", "um", 50.0, True

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self._um = strength * parts(rng, 3)

    @property
    def values(self) -> Values:
        return tuple(self._um.tolist())

    def tool(self, now: CauseInputs) -> FloatArray:
        return np.asarray(UM * self._um)


class ToolBending(Cause):
    """A probe's springs and stem give way under the load on the tip."""

    id, unit, least, most = "tool_bending", "um/N", 0.01, 1.0

    def tool(self, now: CauseInputs) -> FloatArray:
        if self.machine.tip_frame == "P":
            return np.asarray(-self.strength * UM * now.force_M_N)  # on the plate it takes the work's reaction
        force_P_N = now.posture[1:] @ now.force_M_N
        return np.asarray(self.strength * UM * force_P_N * [1.0, 1.0, ALONG_TOOL_SHARE])


def _tool(machine: Mechanism) -> FloatArray:
    return machine.tip0_P if machine.tip_frame == "M" else machine.tip0_M


CAUSES = (
    BaseJointPosition,
    PlatformJointPosition,
    JointRunout,
    PlatformExpansion,
    RevoluteAxisTilt,
    ToolExpansion,
    ToolOffset,
    ToolBending,
)
