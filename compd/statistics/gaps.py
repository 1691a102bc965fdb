"""Gaps of a quantity beside the machine: a sensor that missed a few rows."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray


def filled(values: FloatArray, time_s: FloatArray, max_empty_share: float) -> FloatArray:
    """(N,) the values, empty cells with the value of the nearest row in time; as they are where too many are empty.

    values : (N,) of a quantity, nan where the cell is empty.  time_s : (N,) rising.
    max_empty_share : up to this share of empty cells gaps are filled.

    For what only describes a residual, so that one empty cell does not take a quantity out of the search. What an
    effect of the model computes is never made of filled values: a row without them is left out.
    """
    known = np.flatnonzero(np.isfinite(values))
    if len(known) == len(values) or len(values) - len(known) > max_empty_share * len(values):
        return values
    after = np.minimum(np.searchsorted(time_s[known], time_s), len(known) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(time_s - time_s[known[before]] <= time_s[known[after]] - time_s, before, after)
    return np.asarray(np.where(np.isfinite(values), values, values[known[nearest]]))
