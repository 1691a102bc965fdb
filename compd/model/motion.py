"""How the links move: direction of travel and velocity, carried from one snapshot to the next.

The live loop and a recorded run use the same recursion, so that a replay gives the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.travel_direction import Travel, advance

# Time constant of the average velocity: unaveraged, one step of a scale, 10 nm, within a cycle of 1 ms is 10 um/s.
VELOCITY_WINDOW_S = 0.02


class Motion(NamedTuple):
    """The state of the motion after one snapshot.

    time_s.  scale_mm (n,), joint_mm (k,): the last readings.
    turning_mm (n,): the farthest reading of each scale in its present direction, from which a reversal is measured.
    direction (n,): +1, -1, 0 until the link has moved.
    velocity_mm_per_s (n,), joint_velocity_mm_per_s (k,): averaged over VELOCITY_WINDOW_S.
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
    The direction follows the rule of `compd.travel_direction`.
    Velocity is a first-order average, v += (1 - exp(-dt / VELOCITY_WINDOW_S)) (dx / dt - v).
    """
    if before is None:
        still = np.zeros_like(scale_mm)
        return Motion(time_s, scale_mm, joint_mm, scale_mm, still, still, np.zeros_like(joint_mm))
    turning_mm, direction = _advance_links(before, scale_mm)
    elapsed_s = time_s - before.time_s
    if elapsed_s <= 0.0:
        return before._replace(turning_mm=turning_mm, direction=direction, scale_mm=scale_mm, joint_mm=joint_mm)
    share = -np.expm1(-elapsed_s / VELOCITY_WINDOW_S)
    speed = before.velocity_mm_per_s
    speed = speed + share * ((scale_mm - before.scale_mm) / elapsed_s - speed)
    joint_speed = before.joint_velocity_mm_per_s
    joint_speed = joint_speed + share * ((joint_mm - before.joint_mm) / elapsed_s - joint_speed)
    return Motion(time_s, scale_mm, joint_mm, turning_mm, direction, speed, joint_speed)


def _advance_links(before: Motion, scale_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Turning points and directions (n,) after one more reading of each scale; few links: plain floats are faster."""
    links = zip(before.turning_mm.tolist(), before.direction.tolist(), scale_mm.tolist(), strict=True)
    travels = [advance(Travel(turning_mm, direction), here_mm) for turning_mm, direction, here_mm in links]
    return np.array([travel.turning_mm for travel in travels]), np.array([travel.direction for travel in travels])


def track_motion(
    motion: Motion | None, time_s: FloatArray, scale_mm: FloatArray, joint_mm: FloatArray
) -> tuple[Movement, Motion | None]:
    """The movement in each row, and the motion after the last one.

    motion : before the first row.  time_s (N,), scale_mm (N, n), joint_mm (N, k).
    A row with a reading that is nan leaves the motion as it was.
    """
    motions = []
    for k, time in enumerate(time_s.tolist()):
        if motion is None or (np.isfinite(scale_mm[k]).all() and np.isfinite(joint_mm[k]).all()):
            motion = update_motion(motion, time, scale_mm[k], joint_mm[k])
        motions.append(motion)
    return Movement.from_motions(motions), motion
