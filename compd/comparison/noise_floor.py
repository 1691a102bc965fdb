"""The noise floor: how far apart two measurements of the same thing are, which no model can be better than.

Three sources, in this order:

repeats : pure error, the standard deviation of replicates (rows of one visit), from the differences of all pairs
    within visits, s = trimmed_scale((r_i - r_j) / sqrt(2)). Without outliers it is the pooled standard deviation of
    the visits about their means, and not less than the uncertainty of the reference's last digit. A declaration that
    agrees with it is pooled.
declared : the reference's standard uncertainty and the gauges' noise at the tip, sqrt(u_reference^2 + u_gauges^2).
    Neighbouring rows that differ by much less contradict it: then the estimate is the unit to count in. So do rows
    that differ by much more where what a diagnosis leaves is white (`white_residual`).
estimate : from differences of neighbouring rows, s = trimmed_scale((r_{i+1} - r_i) / sqrt(2)). What changes from row
    to row counts as noise, be it noise or not: it is a unit to count in, and no floor.

Sources: N. R. Draper, H. Smith, Applied Regression Analysis, Wiley 1998, section 2.1 (pure error); JCGM 100:2008
(GUM), G.4.2 (degrees of freedom of a declared uncertainty); J. von Neumann, Ann. Math. Stat. 12 (1941) 367
(differences).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import fdtr

from compd.arrays import BoolArray, FloatArray, IntArray, rms
from compd.comparison.criteria import ComparisonCriteria
from compd.display_unit import format_error
from compd.recording import sigma_key
from compd.statistics import SCALE_EFFICIENCY, replicate_pairs, trimmed_scale, unseen_rounding_um

# Variance of the estimate from N differences of neighbours, as a share of that of N independent values' (von
# Neumann).
DIFFERENCE_VARIANCE = 1.5

Source = Literal["repeats", "declared", "estimate"]


@dataclass(frozen=True)
class NoiseFloor:
    """Standard deviation of a residual that holds nothing but noise: the reference's and the gauges'.

    by_axis_um : (m,) per coordinate.  source : where it is from.  how : the same in a sentence.
    dof : degrees of freedom, over all coordinates; inf for a declaration that nothing tests.
    contradiction : a remark where repeats or neighbours and the declaration are far apart; "" where they are not.
    declared_um : root mean square of a declaration that an estimate takes the place of; nan without one.
    angles : how many of the coordinates, the last ones, are an attitude's, in urad.
    digit_um : (m,) standard uncertainty of the reference's last digit, 0 where unknown.
    unseen_um : (m,) the part of it that is the same in each repeat of a place; all of it without repeats.
    """

    by_axis_um: FloatArray
    source: Source
    how: str
    dof: float
    contradiction: str = ""
    declared_um: float = float("nan")
    angles: int = 0
    digit_um: FloatArray = field(default_factory=lambda: np.zeros(1))
    unseen_um: FloatArray = field(default_factory=lambda: np.zeros(1))

    @property
    def um(self) -> float:
        """Root mean square over the coordinates that are lengths."""
        return rms(self.by_axis_um[: len(self.by_axis_um) - self.angles])

    @property
    def least_um(self) -> FloatArray:
        """(m,) below which scatter says nothing: the noise where it is known, and the uncertainty of the last digit."""
        return np.maximum(self.by_axis_um if self.known else 0.0, self.digit_um)

    @property
    def above_declared(self) -> bool:
        """Whether it is an estimate that is larger than what is declared."""
        return self.um > self.declared_um

    @property
    def known(self) -> bool:
        """Whether noise was measured or declared; an estimate is a unit to count in, and proves nothing."""
        return self.source != "estimate"


class Scatter(NamedTuple):
    """Pure error of replicates: by_axis_um (m,), degrees of freedom of each coordinate, number of pairs of rows."""

    by_axis_um: FloatArray
    dof: float
    pairs: int


def repeat_scatter(
    residual_um: FloatArray,
    use: BoolArray,
    visit: IntArray | None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
) -> Scatter | None:
    """Scatter of residual_um (N, m) within visits; None where no visit of the rows `use` (N,) is repeated.

    visit : (N,) number of the visit, negative for none.
    Of the residual, not of the reference: a change between two repeats that the model follows is no noise.
    """
    pairs = replicate_pairs(use & np.isfinite(residual_um).all(axis=1), visit, criteria.max_rows_of_visit)
    if pairs is None:
        return None
    sigma_um = trimmed_scale(pairs.difference(residual_um), pairs.weight)
    return Scatter(sigma_um, SCALE_EFFICIENCY * pairs.dof, len(pairs.weight))


def noise_floor(
    residual_um: FloatArray,
    use: BoolArray,
    visit: IntArray | None,
    declared_um: FloatArray,
    gauges_um: FloatArray,
    digit_um: FloatArray,
    orders: tuple[FloatArray, ...],
    criteria: ComparisonCriteria = ComparisonCriteria(),
    unit: str = "um",
    angles: int = 0,
) -> NoiseFloor:
    """The noise floor from repeats; else from what is declared; else an estimate.

    residual_um : (N, m), of which the rows `use` (N,) count.  visit : as in `repeat_scatter`.
    declared_um : (m,) the reference's standard uncertainty, nan where nobody declared it.
    gauges_um : (m,) the gauges' noise at the tip, nan where unknown (then left out).
    digit_um : (m,) standard uncertainty of the reference's last digit, 0 where unknown.
    orders : quantities (N,) by which rows are sorted for an estimate.
    unit : in which people read the residual, in place of um.  angles : how many of the coordinates, the last ones, are
        an attitude's, in urad.
    """
    floor = _noise_floor(
        residual_um, use, visit, declared_um, gauges_um, digit_um, orders, criteria, Units(unit, angles)
    )
    unseen_um = floor.unseen_um if floor.source == "repeats" else digit_um
    return replace(floor, angles=angles, digit_um=digit_um, unseen_um=unseen_um)


class Units(NamedTuple):
    """The unit of the coordinates but for the last `angles` ones, which are in urad."""

    unit: str
    angles: int

    def length_rms(self, by_axis: FloatArray) -> float:
        """Root mean square of those of the values (m,) that are no attitude's."""
        return rms(by_axis[: len(by_axis) - self.angles])

    def text(self, by_axis: FloatArray) -> str:
        """Root mean square of values (m,) by their units, for people: "0.16 um and 2.0 urad"."""
        lengths = len(by_axis) - self.angles
        length = format_error(self.length_rms(by_axis), self.unit, 3)
        return f"{length} and {format_error(rms(by_axis[lengths:]), 'urad', 3)}" if self.angles else length


def _noise_floor(
    residual_um: FloatArray,
    use: BoolArray,
    visit: IntArray | None,
    declared_um: FloatArray,
    gauges_um: FloatArray,
    digit_um: FloatArray,
    orders: tuple[FloatArray, ...],
    criteria: ComparisonCriteria,
    units: Units,
) -> NoiseFloor:
    """As `noise_floor`."""
    expected_um = np.sqrt(declared_um**2 + np.nan_to_num(gauges_um) ** 2)
    is_declared = bool(np.isfinite(declared_um).all())
    scatter = repeat_scatter(residual_um, use, visit, criteria)
    if scatter is not None and scatter.pairs >= criteria.fewest_pairs:
        rounded_um = _rounded_scatter(residual_um, use, visit, digit_um, criteria)
        seen_um = np.where(scatter.by_axis_um < digit_um, rounded_um, scatter.by_axis_um)
        unseen_um = unseen_rounding_um(seen_um, digit_um)
        scatter = scatter._replace(by_axis_um=np.hypot(seen_um, unseen_um))
        if (scatter.by_axis_um > 0).all():
            floor = _from_repeats(scatter, expected_um if is_declared else None, criteria, units)
            return replace(floor, unseen_um=unseen_um)
    no_repeats = _why_no_repeats(scatter, criteria)
    estimate = from_differences(residual_um[use], tuple(order[use] for order in orders), digit_um, no_repeats)
    if is_declared:
        if remark := _too_large(estimate, expected_um, criteria, units):
            how = f"an estimate, from differences of neighbouring rows: {no_repeats}, and the declared noise is larger"
            return replace(estimate, how=how, contradiction=remark, declared_um=units.length_rms(expected_um))
        declared = f"the reference's {units.text(declared_um)}"
        if not np.isnan(gauges_um).any():
            declared += f" with the gauges' {units.text(gauges_um)} at the tip"
        how = f"declared: {declared}; {no_repeats}, so nothing tests it"
        return NoiseFloor(expected_um, "declared", how, float("inf"))
    return estimate


def _rounded_scatter(
    residual_um: FloatArray, use: BoolArray, visit: IntArray | None, digit_um: FloatArray, criteria: ComparisonCriteria
) -> FloatArray:
    """(m,) scatter where repeats differ by less than the last digit's uncertainty.

    They show only how often the digit turns, which a robust scatter does not see; it is the root mean square of the
    differences, none larger than a few steps.
    """
    pairs = replicate_pairs(use & np.isfinite(residual_um).all(axis=1), visit, criteria.max_rows_of_visit)
    assert pairs is not None, "there are repeats"
    most_um = criteria.outlier_sigmas * digit_um
    difference_um = np.clip(pairs.difference(residual_um), -most_um, most_um)
    return np.asarray(np.sqrt(np.average(difference_um**2, axis=0, weights=pairs.weight)))


def _too_large(estimate: NoiseFloor, expected_um: FloatArray, criteria: ComparisonCriteria, units: Units) -> str:
    """Why declared noise (m,) is no floor: neighbouring rows differ by far less; "" where they do not.

    What changes from row to row only adds to differences, so that nothing excuses small ones.
    """
    if contradicting_factor(estimate.by_axis_um, estimate.dof, expected_um, criteria) > 1 / criteria.declared_ratio:
        return ""
    return (
        f"neighbouring rows scatter by {units.text(estimate.by_axis_um)}, and {units.text(expected_um)} is declared: "
        f"check `{sigma_key(units.unit)}`; what it holds beside noise, these rows do not show"
    )


def contradicting_factor(
    scatter_um: FloatArray, dof: float, expected_um: FloatArray, criteria: ComparisonCriteria
) -> float:
    """Scatter (m,) of `dof` degrees of freedom over declared noise (m,), rms; 1 where they do not contradict.

    F test of the ratio of both variances, averaged over the coordinates, with `declared_dof` for the declaration.
    """
    ratio = float(np.mean((scatter_um / expected_um) ** 2))
    below = float(fdtr(dof, criteria.declared_dof * len(expected_um), ratio))
    return 1.0 if min(below, 1 - below) >= criteria.contradiction_p_value / 2 else float(np.sqrt(ratio))


def _why_no_repeats(scatter: Scatter | None, criteria: ComparisonCriteria) -> str:
    """Why repeats do not say what noise is, as the part of a sentence."""
    if scatter is None:
        return "no visit is repeated"
    if scatter.pairs < criteria.fewest_pairs:
        return f"repeats make {scatter.pairs} pairs of rows, of {criteria.fewest_pairs} that are needed"
    return "repeats are alike to the last digit"


def _from_repeats(
    scatter: Scatter, expected_um: FloatArray | None, criteria: ComparisonCriteria, units: Units
) -> NoiseFloor:
    """The repeats, pooled with a declaration (m,) that they do not contradict, weighted by degrees of freedom."""
    axes = len(scatter.by_axis_um)
    dof = scatter.dof * axes
    scattered = units.text(scatter.by_axis_um)
    how = f"repeats of one visit scatter by {scattered} ({scatter.pairs} pairs of rows)"
    if expected_um is None:
        return NoiseFloor(scatter.by_axis_um, "repeats", how, dof)
    declared = f"declared noise of {units.text(expected_um)}"
    factor = contradicting_factor(scatter.by_axis_um, dof, expected_um, criteria)
    if factor != 1.0:
        remark = _contradiction(factor, criteria.declared_ratio, sigma_key(units.unit))
        return NoiseFloor(scatter.by_axis_um, "repeats", f"{how} and contradict the {declared}", dof, remark)
    pooled_dof = scatter.dof + criteria.declared_dof
    variance = (scatter.dof * scatter.by_axis_um**2 + criteria.declared_dof * expected_um**2) / pooled_dof
    return NoiseFloor(
        np.sqrt(variance), "repeats", f"{how}, which agrees with the {declared}; both count", pooled_dof * axes
    )


def _contradiction(factor: float, limit: float, key: str) -> str:
    """What to check where repeats scatter `factor` times as much as declared; "" within a factor `limit`."""
    if factor > limit:
        return f"the repeats scatter {factor:.3g} times as much as declared: check the instrument, or `{key}`"
    if factor < 1 / limit:
        return (
            f"the repeats scatter {1 / factor:.3g} times less than declared: check `{key}`; what it holds beside "
            "noise, repeats do not show"
        )
    return ""


def from_differences(
    residual_um: FloatArray, orders: tuple[FloatArray, ...], digit_um: FloatArray, no_repeats: str
) -> NoiseFloor:
    """From differences of rows that are neighbours in time, place or temperature, in the order in which they differ
    least.

    residual_um : (R, m).  orders : (R,) each. What changes from row to row in every order counts as noise.
    no_repeats : why repeats do not say what noise is.
    """
    smallest_um = np.full(residual_um.shape[1], np.inf)
    for order in orders:
        steps_um = np.diff(residual_um[np.argsort(order, kind="stable")], axis=0) / np.sqrt(2.0)
        if len(steps_um):
            sigma_um = trimmed_scale(steps_um)
            # 0 where a display shows most neighbours alike: then the few steps are all that there is
            sigma_um = np.where(sigma_um > 0, sigma_um, np.sqrt(np.mean(steps_um**2, axis=0)))
            smallest_um = np.minimum(smallest_um, sigma_um)
    how = f"an estimate, from differences of neighbouring rows: {no_repeats} and no uncertainty is declared"
    return NoiseFloor(
        np.maximum(smallest_um, digit_um), "estimate", how, SCALE_EFFICIENCY * residual_um.size / DIFFERENCE_VARIANCE
    )
