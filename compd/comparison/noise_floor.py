"""The noise floor: how far apart two measurements of the same thing are, which no model can be better than.

Three sources, in this order:

repeats : pure error, the pooled standard deviation of replicates (rows of one visit) about their means,
    s^2 = sum_v sum_{i in v} (r_i - mean_v)^2 / sum_v (n_v - 1). A declaration that agrees with it is pooled.
declared : the reference's standard uncertainty and the gauges' noise at the tip, sqrt(u_reference^2 + u_gauges^2).
estimate : from differences of neighbouring rows, s = robust_sigma((r_{i+1} - r_i) / sqrt(2)).

Sources: N. R. Draper, H. Smith, Applied Regression Analysis, Wiley 1998, section 2.1 (pure error); JCGM 100:2008
(GUM), G.4.2 (degrees of freedom of a declared uncertainty); J. von Neumann, Ann. Math. Stat. 12 (1941) 367
(differences).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.stats import f as f_distribution

from compd.arrays import BoolArray, FloatArray, IntArray, rms
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.outliers import find_replicates
from compd.comparison.robust import robust_sigma

# Variance of the estimate from N differences of neighbours, as a share of that of N independent values' (von
# Neumann).
DIFFERENCE_VARIANCE = 1.5

Source = Literal["repeats", "declared", "estimate"]


@dataclass(frozen=True)
class NoiseFloor:
    """Standard deviation of a residual that holds nothing but noise: the reference's and the gauges'.

    by_axis_um : (m,) per coordinate.  source : where it is from.  how : the same in a sentence.
    dof : degrees of freedom, over all coordinates; inf for a declaration that nothing tests.
    """

    by_axis_um: FloatArray
    source: Source
    how: str
    dof: float

    @property
    def um(self) -> float:
        """Root mean square over the coordinates."""
        return rms(self.by_axis_um)


class Scatter(NamedTuple):
    """Pure error of replicates: by_axis_um (m,), dof of each coordinate, number of visits left out for an outlier."""

    by_axis_um: FloatArray
    dof: int
    outlier_visits: int


def repeat_scatter(
    residual_um: FloatArray,
    use: BoolArray,
    visit: IntArray | None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
) -> Scatter | None:
    """Pooled scatter of residual_um (N, m) within visits; None where no visit of the rows `use` (N,) is repeated.

    visit : (N,) number of the visit, negative for none.
    Of the residual, not of the reference: a change between two repeats that the model follows is no noise.
    """
    replicates = None if visit is None else find_replicates(residual_um, use, visit)
    if replicates is None:
        return None
    outlier_visits = np.unique(replicates.visit[replicates.outlier(criteria)])
    kept = ~np.isin(replicates.visit, outlier_visits)
    if not kept.any():
        return None
    # a visit of n rows has n - 1 degrees of freedom, of which each row counts (n - 1) / n
    dof_of_row = (replicates.size[kept] - 1.0) / replicates.size[kept]
    squares = (replicates.deviation_um[kept] ** 2 * dof_of_row[:, None]).sum(axis=0)
    dof = dof_of_row.sum()
    return Scatter(np.sqrt(squares / dof), round(float(dof)), len(outlier_visits))


def noise_floor(
    residual_um: FloatArray,
    use: BoolArray,
    visit: IntArray | None,
    declared_um: FloatArray,
    gauges_um: FloatArray,
    orders: tuple[FloatArray, ...],
    criteria: ComparisonCriteria = ComparisonCriteria(),
) -> NoiseFloor:
    """The noise floor from repeats; else from what is declared; else an estimate.

    residual_um : (N, m), of which the rows `use` (N,) count.  visit : as in `repeat_scatter`.
    declared_um : (m,) the reference's standard uncertainty, nan where nobody declared it.
    gauges_um : (m,) the gauges' noise at the tip, nan where unknown (then left out).
    orders : quantities (N,) by which rows are sorted for an estimate.
    """
    expected_um = np.sqrt(declared_um**2 + np.nan_to_num(gauges_um) ** 2)
    is_declared = bool(np.isfinite(declared_um).all())
    scatter = repeat_scatter(residual_um, use, visit, criteria)
    if scatter is not None and (scatter.by_axis_um > 0).all():
        return _from_repeats(scatter, expected_um if is_declared else None, criteria)
    if is_declared:
        gauges = "" if np.isnan(gauges_um).any() else f" with the gauges' {rms(gauges_um):.3g} um at the tip"
        how = f"declared: the reference's {rms(declared_um):.3g} um{gauges}; no visit is repeated, so nothing tests it"
        return NoiseFloor(expected_um, "declared", how, float("inf"))
    return _from_differences(residual_um[use], tuple(order[use] for order in orders))


def _from_repeats(scatter: Scatter, expected_um: FloatArray | None, criteria: ComparisonCriteria) -> NoiseFloor:
    """The repeats, pooled with a declaration (m,) that they do not contradict, weighted by degrees of freedom.

    F test of the ratio of both variances, averaged over the coordinates, with `declared_dof` for the declaration.
    """
    axes = len(scatter.by_axis_um)
    dof = float(scatter.dof * axes)
    how = f"repeats of one visit scatter by {rms(scatter.by_axis_um):.3g} um ({scatter.dof} repeats)"
    if scatter.outlier_visits:
        how += f", {scatter.outlier_visits} visits with a gross row left out"
    if expected_um is None:
        return NoiseFloor(scatter.by_axis_um, "repeats", how, dof)
    declared = f"declared noise of {rms(expected_um):.3g} um"
    ratio = float(np.mean((scatter.by_axis_um / expected_um) ** 2))
    below = float(f_distribution.cdf(ratio, dof, criteria.declared_dof * axes))
    if min(below, 1 - below) < criteria.contradiction_p_value / 2:
        return NoiseFloor(scatter.by_axis_um, "repeats", f"{how} and contradict the {declared}", dof)
    pooled_dof = scatter.dof + criteria.declared_dof
    variance = (scatter.dof * scatter.by_axis_um**2 + criteria.declared_dof * expected_um**2) / pooled_dof
    return NoiseFloor(
        np.sqrt(variance), "repeats", f"{how}, which agrees with the {declared}; both count", pooled_dof * axes
    )


def _from_differences(residual_um: FloatArray, orders: tuple[FloatArray, ...]) -> NoiseFloor:
    """From differences of rows that are neighbours in time, place or temperature, in the order in which they differ
    least.

    residual_um : (R, m).  orders : (R,) each. What changes from row to row in every order counts as noise.
    """
    smallest_um = np.full(residual_um.shape[1], np.inf)
    for order in orders:
        steps_um = np.diff(residual_um[np.argsort(order, kind="stable")], axis=0) / np.sqrt(2.0)
        if len(steps_um):
            smallest_um = np.minimum(smallest_um, robust_sigma(steps_um))
    how = "an estimate, from differences of neighbouring rows: no visit is repeated and no uncertainty is declared"
    return NoiseFloor(smallest_um, "estimate", how, residual_um.size / DIFFERENCE_VARIANCE)
