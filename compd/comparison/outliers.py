"""Outliers: rows whose residual no noise explains. A row that a replicate (the same visit again) confirms
is none, but where the whole visit is a lone one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.lone_visits import lone_distance
from compd.statistics import MIN_SIGMA, replicate_pairs, robust_sigma, trimmed_scale


class OutlierLimits(NamedTuple):
    """Beyond which a residual is an outlier, (m,) each, um.

    middle_um : median of each coordinate.  limit_um : how far from it a row may be.
    near_um : how near a replicate must be to confirm a row; None without replicates.
    lone : beyond so many times the limit no replicate confirms a row.
    """

    middle_um: FloatArray
    limit_um: FloatArray
    near_um: FloatArray | None
    lone: float = np.inf

    def outliers(self, residual_um: FloatArray, use: BoolArray, visit: IntArray | None) -> BoolArray:
        """(N,) outliers among the rows `use` (N,) of a residual (N, m); see `outlier_rows`."""
        finite, times = np.isfinite(residual_um).all(axis=1), self.times(residual_um)
        return self.unconfirmed(np.asarray(use & finite & (times > 1.0)), residual_um, use, visit)

    def unconfirmed(
        self, outlier: BoolArray, residual_um: FloatArray, use: BoolArray, visit: IntArray | None
    ) -> BoolArray:
        """(N,) those of the outliers that no other row of their visit confirms."""
        outlier = outlier.copy()
        if visit is None or self.near_um is None:
            return outlier
        finite, times = np.isfinite(residual_um).all(axis=1), self.times(residual_um)
        for row in np.flatnonzero(outlier & (visit >= 0) & (times <= self.lone)):
            others = np.flatnonzero(use & finite & (visit == visit[row]))
            distance_um = np.abs(residual_um[others[others != row]] - residual_um[row])
            outlier[row] = not (distance_um <= self.near_um).all(axis=1).any()
        return np.asarray(outlier)

    def times(self, residual_um: FloatArray) -> FloatArray:
        """(N,) how many times as far as the limit a row (N, m) is from the median, on its farthest coordinate."""
        return np.asarray((np.abs(residual_um - self.middle_um) / self.limit_um).max(axis=1))


def outlier_limits(
    residual_um: FloatArray,
    use: BoolArray,
    visit: IntArray | None = None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    conditions: FloatArray | None = None,
) -> OutlierLimits:
    """The limits by the rows `use` (N,) of a residual (N, m); infinite where these are too few.

    conditions : (N, K) what was recorded beside the reference, as of `lone_distance`.
    """
    if use.sum() < criteria.fewest_rows:
        nowhere = np.full(residual_um.shape[1], np.inf)
        return OutlierLimits(np.zeros_like(nowhere), nowhere, None)
    middle_um = np.median(residual_um[use], axis=0)
    sigma_um = robust_sigma(residual_um[use] - middle_um)
    limit_um = criteria.outlier_sigmas * np.maximum(sigma_um, MIN_SIGMA)
    pairs = replicate_pairs(use & np.isfinite(residual_um).all(axis=1), visit, criteria.max_rows_of_visit)
    if pairs is None:
        return OutlierLimits(middle_um, limit_um, None)
    # of few repeats, an outlier among them makes most of the scatter, which then must not be its own measure
    noise_um = np.minimum(trimmed_scale(pairs.difference(residual_um), pairs.weight), sigma_um)
    near_um = criteria.outlier_sigmas * np.sqrt(2.0) * np.maximum(noise_um, MIN_SIGMA)
    limits = OutlierLimits(middle_um, limit_um, near_um)
    known = use & np.isfinite(residual_um).all(axis=1)
    distance = criteria.outlier_sigmas * limits.times(residual_um)
    return limits._replace(lone=lone_distance(distance, known, visit, conditions, criteria) / criteria.outlier_sigmas)


def outlier_rows(
    residual_um: FloatArray,
    use: BoolArray,
    visit: IntArray | None = None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
    conditions: FloatArray | None = None,
) -> BoolArray:
    """(N,) rows of `use` (N,) with a coordinate of residual_um (N, m) farther than `outlier_sigmas` robust standard
    deviations from the median.

    visit : (N,) number of the visit, negative for none. A row that another row of the same visit repeats is no
    outlier: the machine really was there, and what the model lacks there is to be explained. That of a lone visit is.
    """
    return outlier_limits(residual_um, use, visit, criteria, conditions).outliers(residual_um, use, visit)
