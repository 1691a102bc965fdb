"""What effects see: N instants of a machine, with everything measured and what the nominal model makes of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from compd.arrays import FloatArray
from compd.errors import CompdError, Problem
from compd.model.kinematics import Mechanism
from compd.model.statics import link_forces
from compd.model.transform import to_outer

# ISO 1: lengths are stated at 20 degC.
REFERENCE_TEMPERATURE_degC = 20.0
# ISO 2533 standard atmosphere: at this pressure interferometers' tables have their zero.
REFERENCE_PRESSURE_hPa = 1013.25

# A scale that has turned round by less than this stands still: its noise is some 10 nm, a backlash 0.1 um or more.
REVERSAL_MM = 1e-3
# Velocity is averaged over so long: a step of a scale, 10 nm, within a cycle of 1 ms is 10 mm/s of noise without.
VELOCITY_WINDOW_S = 0.02

Flags: TypeAlias = NDArray[Any]

# An effect that saw these columns would see the answer.
ANSWERS = ("reference_", "model_")


class Constants(NamedTuple):
    """What the machine's description adds to its kinematics; nan where the description says nothing.

    platform_joints_P_mm (n, 3), revolute_axes_P (k, 3): at machine zero's temperature, unbent.
    tool_P_mm (3,), at machine zero.  zero_directions_M (n, 3): links at machine zero, from base to platform.
    zero_axial_force_N (n,): with the platform's weight alone.  weight_N, weight_at_P_mm (3,): the platform's.
    frame_zero_mm (9,): t1..t3, u1..u6 at machine zero.  plate_points_M_mm (3, 3).
    plate_thickness_mm, scale_signal_period_mm.
    instrument_M_mm (3,): where the reference instrument's beam starts; the origin of {M} unless told.
    """

    platform_joints_P_mm: FloatArray
    revolute_axes_P: FloatArray
    tool_P_mm: FloatArray
    zero_directions_M: FloatArray
    zero_axes_M: FloatArray
    zero_axial_force_N: FloatArray
    weight_N: float
    weight_at_P_mm: FloatArray
    frame_zero_mm: FloatArray
    plate_points_M_mm: FloatArray
    plate_thickness_mm: float
    scale_signal_period_mm: float
    instrument_M_mm: FloatArray


@dataclass(frozen=True)
class Observations:
    """N instants. Lengths in mm; {M} and {P} as everywhere; computed without any effect.

    scale_mm (N, n), joint_mm (N, k), frame_mm (N, 9): readings, zero at machine zero.
    quantities : everything else measured, by its name with its unit, (N,) each; no column of the reference.
    time_s (N,).  session_start (N,): True where a row has no history.
    direction (N, n): +1, -1 as the link last moved, 0 where that is not known.
    velocity_mm_per_s (N, n), joint_velocity_mm_per_s (N, k): of the readings.
    link_mm (N, n), directions_M (N, n, 3) from base to platform joint, base_joints_M_mm (N, n, 3).
    origin_M_mm (N, 3), rotation_M_P (N, 3, 3): the moving platform.  tip_M_mm (N, 3).
    """

    constants: Constants
    scale_mm: FloatArray
    joint_mm: FloatArray
    frame_mm: FloatArray
    quantities: Mapping[str, FloatArray]
    time_s: FloatArray
    session_start: Flags
    direction: FloatArray
    velocity_mm_per_s: FloatArray
    joint_velocity_mm_per_s: FloatArray
    link_mm: FloatArray
    directions_M: FloatArray
    base_joints_M_mm: FloatArray
    origin_M_mm: FloatArray
    rotation_M_P: FloatArray
    tip_M_mm: FloatArray

    def __post_init__(self) -> None:
        seen = [name for name in self.quantities if name.startswith(ANSWERS)]
        if seen:
            raise CompdError(
                Problem(
                    where="rows for effects",
                    what="an effect must never see the answer",
                    value=", ".join(seen),
                    allowed="measured quantities only",
                    next_step="leave these columns out",
                )
            )

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def links(self) -> int:
        """n; 0 for a machine of another model, of which only the tip is known."""
        return int(self.scale_mm.shape[1])

    @property
    def revolute_axes_P(self) -> FloatArray:
        """(k, 3)."""
        return self.constants.revolute_axes_P

    @property
    def available(self) -> set[str]:
        """Names of the quantities and settings that there are: what `missing` asks for."""
        return set(self.quantities) | settings(self.constants)

    def setting(self, name: str) -> float | None:
        """A number from the machine's description, None where it has none."""
        value = float(getattr(self.constants, name))
        return None if np.isnan(value) else value

    def quantity(self, name: str) -> FloatArray:
        """(N,). Raises CompdError where it was not measured."""
        if name not in self.quantities:
            raise CompdError(
                Problem(
                    where="rows for effects",
                    what="this quantity is not measured",
                    value=name,
                    allowed=", ".join(sorted(self.quantities)) or "nothing is",
                    next_step="add a gauge or a column of this name",
                )
            )
        return self.quantities[name]

    def warming_K(self, place: str) -> FloatArray:
        """(N,) `temperature_<place>_degC` above the reference temperature."""
        return self.quantity(f"temperature_{place}_degC") - REFERENCE_TEMPERATURE_degC

    @cached_property
    def link_warming_K(self) -> FloatArray:
        """(N, n) each link's temperature above the reference temperature."""
        return np.stack([self.warming_K(f"link_{i + 1}") for i in range(self.links)], axis=1)

    @cached_property
    def force_M_N(self) -> FloatArray:
        """(N, 3) external force on the tip."""
        return np.stack([self.quantity(f"force_{axis}_N") for axis in "xyz"], axis=1)

    @cached_property
    def axial_force_N(self) -> FloatArray:
        """(N, n) axial link forces from the external force and the platform's weight; tension is positive."""
        c = self.constants
        mechanism = Mechanism(self.base_joints_M_mm, c.platform_joints_P_mm, c.revolute_axes_P)
        return link_forces(
            mechanism, self.origin_M_mm, self.rotation_M_P, self.force_M_N, self.tip_M_mm, c.weight_N, c.weight_at_P_mm
        ).axial_N

    @cached_property
    def revolute_axes_M(self) -> FloatArray:
        """(N, k, 3) revolute axes as they stand now."""
        return np.asarray(to_outer(self.rotation_M_P[:, None], np.zeros(3), self.constants.revolute_axes_P))

    @cached_property
    def joint_angles_rad(self) -> FloatArray:
        """(N, n, 2) by which each base joint has turned since machine zero: towards its `zero_axes_M`, and across."""
        along_zero, axes = self.constants.zero_directions_M, self.constants.zero_axes_M
        along = (self.directions_M * along_zero).sum(axis=-1)
        first = (self.directions_M * axes).sum(axis=-1)
        second = (self.directions_M * np.cross(along_zero, axes)).sum(axis=-1)
        return np.stack([np.arctan2(first, along), np.arctan2(second, along)], axis=-1)


def settings(constants: Constants) -> set[str]:
    """Which of the settings that effects may need this machine has."""
    found = {"revolute_axes"} if len(constants.revolute_axes_P) else set()
    for name in ("plate_thickness_mm", "scale_signal_period_mm"):
        if not np.isnan(getattr(constants, name)):
            found.add(name)
    return found


class Motion(NamedTuple):
    """What the live loop remembers of the motion, from one snapshot to the next.

    time_s.  scale_mm (n,), joint_mm (k,): the last readings.
    turning_mm (n,): the farthest each link has got in its direction.  direction (n,): +1, -1, 0 at the start.
    velocity_mm_per_s (n,), joint_velocity_mm_per_s (k,): averaged over VELOCITY_WINDOW_S.
    """

    time_s: float
    scale_mm: FloatArray
    joint_mm: FloatArray
    turning_mm: FloatArray
    direction: FloatArray
    velocity_mm_per_s: FloatArray
    joint_velocity_mm_per_s: FloatArray


def moved(before: Motion | None, time_s: float, scale_mm: FloatArray, joint_mm: FloatArray) -> Motion:
    """The motion after one more snapshot; pass None at the start, where direction is unknown and velocity zero.

    A link has turned round when it has come back by more than REVERSAL_MM.
    """
    if before is None:
        still = np.zeros_like(scale_mm)
        return Motion(time_s, scale_mm, joint_mm, scale_mm, still, still, np.zeros_like(joint_mm))
    since_mm = scale_mm - before.turning_mm
    direction = np.where(np.abs(since_mm) > REVERSAL_MM, np.sign(since_mm), before.direction)
    # onwards the farthest point goes with the link; while it comes back by less, it stays
    onwards = (direction != before.direction) | (since_mm * before.direction > 0)
    turning_mm = np.where(onwards, scale_mm, before.turning_mm)
    elapsed_s = time_s - before.time_s
    if elapsed_s <= 0.0:
        return before._replace(turning_mm=turning_mm, direction=direction, scale_mm=scale_mm, joint_mm=joint_mm)
    share = -np.expm1(-elapsed_s / VELOCITY_WINDOW_S)
    speed = before.velocity_mm_per_s
    speed = speed + share * ((scale_mm - before.scale_mm) / elapsed_s - speed)
    joint_speed = before.joint_velocity_mm_per_s
    joint_speed = joint_speed + share * ((joint_mm - before.joint_mm) / elapsed_s - joint_speed)
    return Motion(time_s, scale_mm, joint_mm, turning_mm, direction, speed, joint_speed)
