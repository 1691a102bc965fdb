"""Matching two sequences in order by dynamic programming: which point belongs to which dwell, with gaps in either."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compd.arrays import FloatArray, IntArray

# Loss from the 1 that a point at its dwell counts for: for a further point at the same dwell, and for preceding dwells
# without a point. So the next dwell at the same place is a better reading of a second point than the same dwell, and
# that a better one than a later visit.
REPEAT_LOSS = 0.5
GAP_LOSS = 0.9
# Least cost of a point's best other dwell; below it the point's dwell is ambiguous.
CLEAR_MARGIN = 0.3


@dataclass(frozen=True)
class Match:
    """dwell : (G,) number of each point's dwell from 0, -1 for none.

    other : (G,) its next best dwell, -1 for none. margin : (G,) what that costs.
    """

    dwell: IntArray
    other: IntArray
    margin: FloatArray


def match_in_order(residual_mm: FloatArray, limit_mm: float) -> Match:
    """The matching with the greatest sum of 1 - (residual / limit)^2, less losses, in which later points have later
    dwells.

    residual_mm : (S, G) how far point j would be from dwell i; nan where that is not known.
    limit_mm : no pair is farther apart. A dwell may have several points in succession.
    """
    gain = 1.0 - (residual_mm / limit_mm) ** 2
    gain[~(gain > 0.0)] = -np.inf
    matched, at_dwell, up_to = _forward(gain)
    if not up_to[-1, -1] > 0.0:
        none = np.full(gain.shape[1], -1, dtype=np.int64)
        return Match(none, none, np.full(gain.shape[1], np.inf))
    dwell = _trace(matched, at_dwell, up_to)
    possible = np.isfinite(gain)
    matched_back = _forward(gain[::-1, ::-1])[0][::-1, ::-1]
    through = np.full(gain.shape, -np.inf)
    through[possible] = matched[possible] + matched_back[possible] - gain[possible]
    chosen = np.flatnonzero(dwell >= 0)
    through[dwell[chosen], chosen] = -np.inf
    other = through.argmax(axis=0)
    margin = up_to[-1, -1] - through[other, np.arange(len(dwell))]
    has_other = (dwell >= 0) & np.isfinite(margin)
    return Match(dwell, np.where(has_other, other, -1), np.where(has_other, margin, np.inf))


def _forward(gain: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(S, G) each: best sum that ends with the pair (i, j); with dwell i and any point up to j; with any up to both."""
    dwells, points = gain.shape
    matched, at_dwell, up_to = (np.full((dwells, points), -np.inf) for _ in range(3))
    before, until = np.full(dwells, -np.inf), np.full(dwells, -np.inf)
    for j in range(points):
        path = np.zeros(dwells)
        path[1:] = np.maximum(np.maximum(path[1:], before[:-1]), until[:-1] - GAP_LOSS)
        if j:
            path = np.maximum(path, matched[:, j - 1] - REPEAT_LOSS)
        matched[:, j] = gain[:, j] + path
        before = np.maximum(before, matched[:, j])
        until = np.maximum.accumulate(before)
        at_dwell[:, j], up_to[:, j] = before, until
    return matched, at_dwell, up_to


def _trace(matched: FloatArray, at_dwell: FloatArray, up_to: FloatArray) -> IntArray:
    """(G,) the dwell of each point on the best path, -1 for none."""
    dwell = np.full(matched.shape[1], -1, dtype=np.int64)
    i, j = _best(matched)
    while True:
        dwell[j] = i
        if j == 0:
            return dwell
        again = matched[i, j - 1] - REPEAT_LOSS
        next_to = at_dwell[i - 1, j - 1] if i else -np.inf
        after_gap = up_to[i - 1, j - 1] - GAP_LOSS if i else -np.inf
        best = max(again, next_to, after_gap)
        if best <= 0:
            return dwell
        if best == again:
            j -= 1
        elif best == next_to:
            i, j = i - 1, int(matched[i - 1, :j].argmax())
        else:
            i, j = _best(matched[:i, :j])


def _best(matched: FloatArray) -> tuple[int, int]:
    i, j = np.unravel_index(int(matched.argmax()), matched.shape)
    return int(i), int(j)
