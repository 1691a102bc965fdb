"""Gaps of a quantity beside the machine: a sensor that missed a few rows."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray

# Largest share of empty cells for filling gaps: beyond it too little of a residual's covariate would be measured.
MOST_EMPTY = 0.1


def filled(values: FloatArray, time_s: FloatArray) -> FloatArray:
    """(N,) the values, with empty cells filled from the nearest row in time; unchanged if too many are empty.

    values : (N,) of a quantity, nan where the cell is empty.  time_s : (N,) rising.

    For what only describes a residual, so that one empty cell does not take a quantity out of the search. What an
    effect of the model computes is never made of filled values: a row without them is left out.
    """
    known = np.flatnonzero(np.isfinite(values))
    if len(known) == len(values) or len(values) - len(known) > MOST_EMPTY * len(values):
        return values
    after = np.minimum(np.searchsorted(time_s[known], time_s), len(known) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(time_s - time_s[known[before]] <= time_s[known[after]] - time_s, before, after)
    return np.asarray(np.where(np.isfinite(values), values, values[known[nearest]]))
