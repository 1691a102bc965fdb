"""How fast gauges change in a recording: known where rows follow each other closely, and where the machine stands."""

from __future__ import annotations

import numpy as np

from compd.arrays import BoolArray, FloatArray

# Rows farther apart tell nothing of each other's speed: between two dwells lies a whole move.
NEAR_S = 3.0
# Rows so close follow any motion of a machine: it takes a few tenths of a second to reach its speed.
CLOSE_S = 0.25
# Slower is standing still: a gauge of 50 ms latency would be 0.25 um late.
STILL_MM_PER_S = 0.005
# Speeds before and after a row that differ by less than this share are one steady speed.
STEADY_SHARE = 0.1


def velocities(
    time_s: FloatArray, starts: BoolArray, at_point: BoolArray, scale_mm: FloatArray, joint_mm: FloatArray
) -> FloatArray:
    """(N, n + k) of the scales and joint comparators, mm/s; nan where it cannot be told.

    starts : (N,) rows without a history, as at the start of a session.  at_point : (N,) rows at a nominal point.
    A row that has not moved since its neighbour, and one at a nominal point far from all others, stands still.
    """
    values = np.concatenate([scale_mm, joint_mm], axis=1)
    count, links = len(values), scale_mm.shape[1]
    gap_s = np.full(count + 1, np.inf)
    gap_s[1:-1] = np.where(starts[1:], np.inf, np.diff(time_s))
    moved = np.zeros((count + 1, values.shape[1]))
    moved[1:-1] = np.diff(values, axis=0)
    near = (gap_s <= NEAR_S) & (gap_s > 0)
    speed = np.divide(moved, gap_s[:, None], out=np.full_like(moved, np.nan), where=near[:, None])
    before, after = speed[:-1], speed[1:]
    gap_before_s, gap_after_s = gap_s[:-1, None], gap_s[1:, None]

    def largest(of: FloatArray) -> FloatArray:
        return np.asarray(np.abs(of[:, :links]).max(axis=1, keepdims=True))

    both = (near[:-1] & near[1:])[:, None]
    steady = largest(after - before) <= STEADY_SHARE * np.maximum(largest(before), largest(after))
    with np.errstate(invalid="ignore"):
        # second order in unequal gaps
        middle = (gap_after_s * before + gap_before_s * after) / (gap_before_s + gap_after_s)
    found = np.full_like(values, np.nan)
    # where the speed changes, a neighbour less than half as far away as the other saw this row's own speed
    found = np.where(both & (2 * gap_before_s < gap_after_s), before, found)
    found = np.where(both & (2 * gap_after_s < gap_before_s), after, found)
    found = np.where(both & (steady | (np.maximum(gap_before_s, gap_after_s) <= CLOSE_S)), middle, found)
    stands = (largest(before) <= STILL_MM_PER_S) | (largest(after) <= STILL_MM_PER_S)
    alone = ~(near[:-1] | near[1:])
    return np.where(stands | (alone & at_point)[:, None], 0.0, found)
