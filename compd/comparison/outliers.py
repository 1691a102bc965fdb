"""Outliers: rows whose residual no noise explains. A row that a replicate (the same visit again) confirms is none."""

from __future__ import annotations

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.statistics.replicates import replicate_pairs
from compd.comparison.statistics.robust import LEAST_SIGMA, robust_sigma, trimmed_scale


def outlier_rows(
    residual_um: FloatArray,
    use: BoolArray,
    visit: IntArray | None = None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
) -> BoolArray:
    """(N,) rows of `use` (N,) with a coordinate of residual_um (N, m) farther than `outlier_sigmas` robust standard
    deviations from the median.

    visit : (N,) number of the visit, negative for none. A row that another row of the same visit repeats is no
    outlier: the machine really was there, and what the model lacks there is to be explained.
    """
    outlier = np.zeros(len(residual_um), dtype=bool)
    if use.sum() < criteria.fewest_rows:
        return outlier
    middle_um = np.median(residual_um[use], axis=0)
    sigma_um = robust_sigma(residual_um[use] - middle_um)
    limit_um = criteria.outlier_sigmas * np.maximum(sigma_um, LEAST_SIGMA)
    finite = np.isfinite(residual_um).all(axis=1)
    outlier = use & finite & (np.abs(residual_um - middle_um) > limit_um).any(axis=1)
    pairs = replicate_pairs(use & finite, visit)
    if visit is None or pairs is None or not outlier.any():
        return outlier
    # of few repeats, an outlier among them makes most of the scatter, which then must not be its own measure
    noise_um = np.minimum(trimmed_scale(pairs.difference(residual_um), pairs.weight), sigma_um)
    near_um = criteria.outlier_sigmas * np.sqrt(2.0) * np.maximum(noise_um, LEAST_SIGMA)
    for row in np.flatnonzero(outlier & (visit >= 0)):
        others = np.flatnonzero(use & finite & (visit == visit[row]))
        distance_um = np.abs(residual_um[others[others != row]] - residual_um[row])
        outlier[row] = not (distance_um <= near_um).all(axis=1).any()
    return outlier
