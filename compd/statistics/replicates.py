"""Replicates: rows of one visit, between which nothing but time has changed, and their differences pair by pair."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray


class ReplicatePairs(NamedTuple):
    """All pairs of rows within visits.

    first, second : (P,) indices of the rows.
    weight : (P,) 2 / n for a visit of n rows, whose n (n - 1) / 2 pairs together have its n - 1 degrees of freedom:
        the weighted mean of (r_i - r_j)^2 / 2 is the pooled variance of the visits.
    """

    first: IntArray
    second: IntArray
    weight: FloatArray

    @property
    def dof(self) -> float:
        """Degrees of freedom of one coordinate: the sum over the visits of n - 1."""
        return float(self.weight.sum())

    def difference(self, values: FloatArray) -> FloatArray:
        """(P, m) differences of values (N, m), over sqrt(2): their standard deviation is that of one row's noise."""
        return np.asarray((values[self.first] - values[self.second]) / np.sqrt(2.0))


def replicate_pairs(use: BoolArray, visit: IntArray | None, max_rows: int) -> ReplicatePairs | None:
    """The pairs among the rows `use` (N,); None where no visit has two such rows.

    visit : (N,) number of the visit, negative for none; None where it was not recorded.
    max_rows : of a longer visit so many rows, evenly spread.
    """
    if visit is None:
        return None
    rows = np.flatnonzero(use & (visit >= 0))
    rows = rows[np.argsort(visit[rows], kind="stable")]
    _, begin, size = np.unique(visit[rows], return_index=True, return_counts=True)
    first, second, weight = [], [], []
    for n in np.unique(size[size > 1]).tolist():
        spread = np.linspace(0, n - 1, min(n, max_rows)).astype(np.int64)
        of_visit = rows[begin[size == n][:, None] + spread]
        i, j = np.triu_indices(len(spread), 1)
        first.append(of_visit[:, i].ravel())
        second.append(of_visit[:, j].ravel())
        weight.append(np.full(first[-1].size, 2.0 / len(spread)))
    if not first:
        return None
    return ReplicatePairs(np.concatenate(first), np.concatenate(second), np.concatenate(weight))
