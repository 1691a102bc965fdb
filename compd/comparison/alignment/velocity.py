"""How fast gauges change in a recording, as effects of latency and speed need it.

Rows of a recording may follow each other closely (a log at 10 Hz) or be minutes apart (one row per point measured). A
speed is known where neighbouring rows are close in time, and at points where the machine stands; elsewhere it is nan.
"""

from __future__ import annotations

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison.criteria import SpeedCriteria


def velocities(
    time_s: FloatArray,
    starts: BoolArray,
    at_point: BoolArray,
    scale_mm: FloatArray,
    joint_mm: FloatArray,
    criteria: SpeedCriteria = SpeedCriteria(),
) -> FloatArray:
    """(N, n + k) speed in mm/s of the n scales and k joint comparators in each row; nan where it is not known.

    time_s : (N,).  starts : (N,) rows without a history, as at the start of a session.
    at_point : (N,) rows at a nominal point.  scale_mm : (N, n).  joint_mm : (N, k).

    With d1, d2 the times to the row before and after and v1, v2 the mean speeds in between, a row's speed is

    - 0 where the scales have not moved from or to a neighbour, and at a nominal point far from all other rows;
    - (d2 v1 + d1 v2) / (d1 + d2), exact to second order, where v1 and v2 agree or both neighbours are close;
    - v1 where d1 < d2 / 2, and v2 where d2 < d1 / 2: where the speed changes, the nearer neighbour saw it.
    """
    values = np.concatenate([scale_mm, joint_mm], axis=1)
    count, links = len(values), scale_mm.shape[1]
    gap_s = np.full(count + 1, np.inf)
    gap_s[1:-1] = np.where(starts[1:], np.inf, np.diff(time_s))
    change_mm = np.zeros((count + 1, values.shape[1]))
    change_mm[1:-1] = np.diff(values, axis=0)
    near = (gap_s <= criteria.near_s) & (gap_s > 0)
    speed = np.divide(change_mm, gap_s[:, None], out=np.full_like(change_mm, np.nan), where=near[:, None])
    before, after = speed[:-1], speed[1:]
    gap_before_s, gap_after_s = gap_s[:-1, None], gap_s[1:, None]

    def largest(speeds: FloatArray) -> FloatArray:
        """(N, 1) of the scales."""
        return np.asarray(np.abs(speeds[:, :links]).max(axis=1, keepdims=True))

    both = (near[:-1] & near[1:])[:, None]
    steady = largest(after - before) <= criteria.steady_share * np.maximum(largest(before), largest(after))
    close = np.maximum(gap_before_s, gap_after_s) <= criteria.close_s
    with np.errstate(invalid="ignore"):
        central = (gap_after_s * before + gap_before_s * after) / (gap_before_s + gap_after_s)
    result = np.full_like(values, np.nan)
    result = np.where(both & (2 * gap_before_s < gap_after_s), before, result)
    result = np.where(both & (2 * gap_after_s < gap_before_s), after, result)
    result = np.where(both & (steady | close), central, result)
    still = (largest(before) <= criteria.still_mm_per_s) | (largest(after) <= criteria.still_mm_per_s)
    alone = ~(near[:-1] | near[1:])
    return np.where(still | (alone & at_point)[:, None], 0.0, result)
