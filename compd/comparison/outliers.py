"""Outliers: rows whose residual no noise explains. A row that a replicate (the same visit again) confirms is none."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.robust import LEAST_SIGMA, robust_sigma


class Replicates(NamedTuple):
    """R rows in visits with two or more rows.

    rows : (R,) their indices in the recording.  visit : (R,) numbered from 0.  size : (R,) rows of the row's visit.
    deviation_um : (R, m) from the visit's mean, times sqrt(n / (n - 1)) so that its variance is that of one row.
    """

    rows: IntArray
    visit: IntArray
    size: IntArray
    deviation_um: FloatArray

    def outlier(self, criteria: ComparisonCriteria) -> BoolArray:
        """(R,) rows farther from their visit's mean than the noise of replicates explains."""
        limit_um = criteria.outlier_sigmas * np.maximum(robust_sigma(self.deviation_um), LEAST_SIGMA)
        return np.asarray((np.abs(self.deviation_um) > limit_um).any(axis=1))


def find_replicates(residual_um: FloatArray, use: BoolArray, visit: IntArray) -> Replicates | None:
    """The replicates among the rows `use` (N,) of a residual (N, m); None where no visit has two.

    visit : (N,) number of the visit, negative for none.
    """
    rows = np.flatnonzero(use & (visit >= 0) & np.isfinite(residual_um).all(axis=1))
    _, group, count = np.unique(visit[rows], return_inverse=True, return_counts=True)
    if not len(rows) or count.max() < 2:
        return None
    sums = np.stack([np.bincount(group, axis) for axis in residual_um[rows].T], axis=1)
    size = count[group]
    deviation_um = residual_um[rows] - (sums / count[:, None])[group]
    repeated = size > 1
    scale = np.sqrt(size[repeated] / (size[repeated] - 1.0))
    return Replicates(rows[repeated], group[repeated], size[repeated], deviation_um[repeated] * scale[:, None])


def outlier_rows(
    residual_um: FloatArray,
    use: BoolArray,
    visit: IntArray | None = None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
) -> BoolArray:
    """(N,) rows of `use` (N,) with a coordinate of residual_um (N, m) farther than `outlier_sigmas` robust standard
    deviations from the median.

    visit : (N,) as in `find_replicates`. A row that another row of the same visit repeats is no outlier: the machine
    really was there, and what the model lacks there is to be explained.
    """
    outlier = np.zeros(len(residual_um), dtype=bool)
    if use.sum() < criteria.fewest_rows:
        return outlier
    middle_um = np.median(residual_um[use], axis=0)
    limit_um = criteria.outlier_sigmas * np.maximum(robust_sigma(residual_um[use] - middle_um), LEAST_SIGMA)
    far = np.isfinite(residual_um) & (np.abs(residual_um - middle_um) > limit_um)
    outlier = use & far.any(axis=1)
    if visit is None or not outlier.any():
        return outlier
    replicates = find_replicates(residual_um, use, visit)
    if replicates is not None:
        outlier[replicates.rows[~replicates.outlier(criteria)]] = False
    return outlier
