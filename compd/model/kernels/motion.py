"""How the links move, from one snapshot to the next, as a kernel; see `compd.model.kinematics.motion`.

A motion is one row of numbers: the time, and for n links and k joint comparators the last readings of the scales (n)
and the comparators (k), the turning points (n), the directions (n), and the velocities of scales (n) and comparators
(k). Before the first snapshot the time is nan.
"""

from __future__ import annotations

import math

from compd.arrays import FloatArray
from compd.jit import NUMBERS, ROWS, helper, loop
from compd.linear import all_finite
from compd.travel_direction import Travel, advance

# Time constant of the average velocity: unaveraged, one step of a scale, 10 nm, within a cycle of 1 ms is 10 um/s.
VELOCITY_WINDOW_S = 0.02

_advance = helper(advance)


@helper
def advance_motion(motion: FloatArray, time_s: float, scale_mm: FloatArray, joint_mm: FloatArray) -> None:
    """Take the motion on to one more snapshot, in place; one with a reading that is nan leaves it as it was.

    The direction follows the rule of `compd.travel_direction`. Velocity is a first-order average,
    v += (1 - exp(-dt / VELOCITY_WINDOW_S)) (dx / dt - v).
    """
    n, k = scale_mm.shape[0], joint_mm.shape[0]
    scales, joints, turning = 1, 1 + n, 1 + n + k
    direction, velocity = turning + n, turning + 2 * n
    if math.isnan(motion[0]):
        motion[:] = 0.0
        motion[0] = time_s
        for i in range(n):
            motion[scales + i] = motion[turning + i] = scale_mm[i]
        for i in range(k):
            motion[joints + i] = joint_mm[i]
        return
    if not (all_finite(scale_mm) and all_finite(joint_mm)):
        return
    for i in range(n):
        travel = _advance(Travel(motion[turning + i], motion[direction + i]), scale_mm[i])
        motion[turning + i] = travel.turning_mm
        motion[direction + i] = travel.direction
    elapsed_s = time_s - motion[0]
    if elapsed_s > 0.0:
        share = -math.expm1(-elapsed_s / VELOCITY_WINDOW_S)
        for i in range(n):
            speed = motion[velocity + i]
            motion[velocity + i] = speed + share * ((scale_mm[i] - motion[scales + i]) / elapsed_s - speed)
        for i in range(k):
            speed = motion[velocity + n + i]
            motion[velocity + n + i] = speed + share * ((joint_mm[i] - motion[joints + i]) / elapsed_s - speed)
        motion[0] = time_s
    for i in range(n):
        motion[scales + i] = scale_mm[i]
    for i in range(k):
        motion[joints + i] = joint_mm[i]


@loop([NUMBERS, NUMBERS, ROWS, ROWS, ROWS])
def track_motions(
    motion: FloatArray, time_s: FloatArray, scale_mm: FloatArray, joint_mm: FloatArray, motions: FloatArray
) -> None:
    """The motion after each of N snapshots, motions (N, M); `motion` (M,) is that before them, and after them."""
    for row in range(time_s.shape[0]):
        advance_motion(motion, time_s[row], scale_mm[row], joint_mm[row])
        motions[row] = motion
