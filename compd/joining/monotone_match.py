"""Matching two sequences in order by dynamic programming: which point belongs to which dwell, with gaps in either."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compd.arrays import FloatArray, IntArray

# What a further point at the same dwell counts for, of the 1 of the first one: between a dwell that was skipped and one
# that was visited anew, the new one is the better reading.
REPEAT_LOSS = 0.6
# A point whose best other dwell costs less than this in all is one whose dwell cannot be told.
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
    """The matching with the greatest sum of 1 - (residual / limit)^2, in which later points have later dwells.

    residual_mm : (S, G) how far point j would be from dwell i; nan where that is not known.
    limit_mm : no pair is farther apart. A dwell may have several points in succession, which count REPEAT_LOSS less.
    """
    gain = 1.0 - (residual_mm / limit_mm) ** 2
    gain[~(gain > 0.0)] = -np.inf
    matched, best = _forward(gain)
    matched_back = _forward(gain[::-1, ::-1])[0][::-1, ::-1]
    possible = np.isfinite(gain)
    through = np.full(gain.shape, -np.inf)
    through[possible] = matched[possible] + matched_back[possible] - gain[possible]
    dwell = _trace(gain, matched, best)
    total = best[-1, -1]
    chosen = np.flatnonzero(dwell >= 0)
    through[dwell[chosen], chosen] = -np.inf
    other = through.argmax(axis=0)
    margin = total - through[other, np.arange(len(dwell))]
    possible_other = (dwell >= 0) & np.isfinite(margin)
    return Match(dwell, np.where(possible_other, other, -1), np.where(possible_other, margin, np.inf))


def _forward(gain: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(S, G) best sum that ends with the pair (i, j), and best sum of dwells up to i and points up to j."""
    dwells, points = gain.shape
    matched, best = np.full((dwells, points), -np.inf), np.zeros((dwells, points))
    before = np.zeros(dwells)  # best[:, j - 1]
    for j in range(points):
        new = np.concatenate([[0.0], before[:-1]])
        repeated = matched[:, j - 1] - REPEAT_LOSS if j else np.full(dwells, -np.inf)
        matched[:, j] = gain[:, j] + np.maximum(new, repeated)
        before = np.maximum.accumulate(np.maximum(before, matched[:, j]))
        best[:, j] = before
    return matched, best


def _trace(gain: FloatArray, matched: FloatArray, best: FloatArray) -> IntArray:
    """(G,) the dwell of each point on the best path, -1 for none."""
    dwells, points = gain.shape
    dwell = np.full(points, -1, dtype=np.int64)
    i, j = dwells - 1, points - 1
    while i >= 0 and j >= 0:
        if j > 0 and best[i, j] == best[i, j - 1]:
            j -= 1
        elif i > 0 and best[i, j] == best[i - 1, j]:
            i -= 1
        elif not matched[i, j] == best[i, j] > 0:
            break
        else:
            dwell[j] = i
            new = best[i - 1, j - 1] if i > 0 and j > 0 else 0.0
            while j > 0 and matched[i, j - 1] - REPEAT_LOSS > new:
                j -= 1
                dwell[j] = i
                new = best[i - 1, j - 1] if i > 0 and j > 0 else 0.0
            i, j = i - 1, j - 1
    return dwell
