"""Replicates: rows of one visit, between which nothing but time has changed, and their differences pair by pair."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray

# Pairs of rows, or tables, that are alike by chance, from which on likeness proves no copy.
CHANCE_PAIRS = 0.01


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


def copied_rows(values: FloatArray, use: BoolArray) -> BoolArray:
    """(N,) rows of which an earlier one has the same values (N, m) to the last digit, where that is no chance.

    A row that was written twice is no repeat. Of D_k different values on coordinate k, as a coarse display shows,
    N^2 / 2 / prod(D_k) pairs of rows are alike by chance; where that is a pair in a hundred or more, none is a copy.

    use : (N,) rows among which they are sought.
    """
    copies = np.zeros(len(values), dtype=bool)
    rows = np.flatnonzero(use & np.isfinite(values).all(axis=1))
    if not len(rows):
        return copies
    different = [len(np.unique(column)) for column in values[rows].T]
    if len(rows) ** 2 / 2 / np.prod(np.asarray(different, dtype=np.float64)) >= CHANCE_PAIRS:
        return copies
    _, first = np.unique(values[rows], axis=0, return_index=True)
    copies[np.setdiff1d(rows, rows[first])] = True
    return copies


def doubled_rows(columns: FloatArray) -> BoolArray:
    """(N,) the second of each two rows, where every row of a table (N, k) was written twice, one behind the other.

    A row alone may be alike another by chance, as of a coarse display. All rows are not: in a doubled table each run of
    equal rows has an even number of them. Of K runs this happens by chance in one table of 2^K; where that is one of a
    hundred or more, none is a copy. An empty cell, nan, equals another.
    """
    copies = np.zeros(len(columns), dtype=bool)
    if not columns.size:
        return copies
    equal = (columns[1:] == columns[:-1]) | (np.isnan(columns[1:]) & np.isnan(columns[:-1]))
    bounds = np.append(np.flatnonzero(~np.append(False, equal.all(axis=1))), len(columns))
    length = np.diff(bounds)
    if (length % 2).any() or 0.5 ** len(length) >= CHANCE_PAIRS:
        return copies
    copies[1::2] = True
    return copies
