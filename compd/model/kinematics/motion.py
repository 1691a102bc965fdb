"""How the links move: direction of travel and velocity, carried from one snapshot to the next.

The live loop and a recorded run use the same recursion, so that a replay gives the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.model.kernels import track_motions


class Motion(NamedTuple):
    """The state of the motion after one snapshot.

    time_s.  scale_mm (n,), joint_mm (k,): the last readings.
    turning_mm (n,): the farthest reading of each scale in its present direction, from which a reversal is measured.
    direction (n,): +1, -1, 0 until the link has moved.
    velocity_mm_per_s (n,), joint_velocity_mm_per_s (k,): averaged over `compd.model.kernels.motion.VELOCITY_WINDOW_S`.
    """

    time_s: float
    scale_mm: FloatArray
    joint_mm: FloatArray
    turning_mm: FloatArray
    direction: FloatArray
    velocity_mm_per_s: FloatArray
    joint_velocity_mm_per_s: FloatArray


class Movement(NamedTuple):
    """How the links move in each of N rows.

    direction (N, n): +1 or -1 as the link last moved, 0 where unknown.
    velocity_mm_per_s (N, n), joint_velocity_mm_per_s (N, k): of the readings; nan where unknown.
    """

    direction: FloatArray
    velocity_mm_per_s: FloatArray
    joint_velocity_mm_per_s: FloatArray

    @classmethod
    def unknown(cls, scale_mm: FloatArray, joint_mm: FloatArray) -> Movement:
        """For rows of scales (N, n) and joint comparators (N, k) whose motion nobody tracks."""
        return cls(np.zeros(scale_mm.shape), np.full(scale_mm.shape, np.nan), np.full(joint_mm.shape, np.nan))

    @classmethod
    def from_motions(cls, motions: Sequence[Motion]) -> Movement:
        """One row for each state of the motion."""
        return cls(
            np.array([motion.direction for motion in motions]),
            np.array([motion.velocity_mm_per_s for motion in motions]),
            np.array([motion.joint_velocity_mm_per_s for motion in motions]),
        )


def update_motion(before: Motion | None, time_s: float, scale_mm: FloatArray, joint_mm: FloatArray) -> Motion:
    """The motion after one more snapshot: scale_mm (n,), joint_mm (k,), all finite.

    before : None at the start, where the direction is unknown and the velocity zero.
    """
    _, after = track_motion(before, np.array([time_s]), scale_mm[None], joint_mm[None])
    assert after is not None, "there is a snapshot"
    return after


def track_motion(
    motion: Motion | None, time_s: FloatArray, scale_mm: FloatArray, joint_mm: FloatArray
) -> tuple[Movement, Motion | None]:
    """The movement in each row, and the motion after the last one; see `compd.model.kernels.motion.advance_motion`.

    motion : before the first row.  time_s (N,), scale_mm (N, n), joint_mm (N, k).
    """
    links, joints = scale_mm.shape[1], joint_mm.shape[1]
    packed = pack_motion(motion, links, joints)
    motions = np.empty((len(time_s), len(packed)))
    track_motions(
        packed,
        np.ascontiguousarray(time_s, dtype=np.float64),
        np.ascontiguousarray(scale_mm),
        np.ascontiguousarray(joint_mm),
        motions,
    )
    direction = 1 + 2 * links + joints
    movement = Movement(
        motions[:, direction : direction + links],
        motions[:, direction + links : direction + 2 * links],
        motions[:, direction + 2 * links :],
    )
    return movement, unpack_motion(packed, links, joints)


def pack_motion(motion: Motion | None, links: int, joints: int) -> FloatArray:
    """A motion as the row of numbers of `compd.model.kernels.motion`."""
    if motion is None:
        return np.full(1 + 4 * links + 2 * joints, np.nan)
    return np.concatenate([[motion.time_s], *motion[1:]])


def unpack_motion(packed: FloatArray, links: int, joints: int) -> Motion | None:
    """The motion in such a row; None before the first snapshot."""
    time_s = float(packed[0])
    if math.isnan(time_s):
        return None
    turning = 1 + links + joints
    velocity = turning + 2 * links
    return Motion(
        time_s,
        packed[1 : 1 + links],
        packed[1 + links : turning],
        packed[turning : turning + links],
        packed[turning + links : velocity],
        packed[velocity : velocity + links],
        packed[velocity + links :],
    )
