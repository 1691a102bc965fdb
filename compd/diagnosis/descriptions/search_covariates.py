"""The covariates of the search for empirical terms: which columns a residual may follow, and what kind each is.

Not every column of a recording is one. A number that only counts or names rows follows everything that changed in time;
a derivative of the user's own model belongs to an effect; a column that stayed the same explains nothing. What is left
out is told with its reason (`untried_quantities`). A column with few empty cells is tried all the same: gaps are filled
from the nearest row in time (`compd.statistics.gaps`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison import AlignedRecording, Covariate
from compd.diagnosis.candidate_criteria import DescriptionCriteria
from compd.units import UNIT_KINDS, unit_of

# What a covariate is, by its unit: it decides in which forms a residual may follow it.
Kind: TypeAlias = Literal["workspace", "place", "angle", "load", "flow", "other"]

STAYED_THE_SAME = "stayed the same"
NOT_AT_ZERO = "was not read at machine zero, from where quantities count: add it to `quantities_at_zero:`"
OWN_PREDICTION = "goes with the model's own prediction, and the reference is constant: the residual is its mirror image"
# Smaller changes, as a share of the largest value, are rounding.
MIN_CHANGE = 1e-9
# A middle nearer to zero than this share of the covariate's range is zero, and it is rounded to half of that.
MIDDLE_SHARE = 0.1

_LENGTHS, _, _, _FORCES, _PRESSURES = UNIT_KINDS
_UNITS: dict[Kind, frozenset[str]] = {
    "place": frozenset([*_LENGTHS, "counts", "mrad", "urad", "arcsec"]),
    "angle": frozenset(["deg", "rad"]),
    "load": frozenset([*_FORCES, "Nm", "kg", "g"]),
    # what warms, cools or wets a body, and so arrives late: a body has a capacity
    "flow": frozenset(["degC", "C", "degF", "F", "K", "pct", *_PRESSURES, "W", "A", "mA", "rpm", "l_per_min"]),
}


@dataclass(frozen=True, eq=False)
class SearchCovariate:
    """A column that a residual may follow.

    name : as formulas call it.  kind : by its unit; "workspace" is the place of a known machine's tip.
    values : (R,) on the rows that are looked at, without gaps.
    """

    name: str
    kind: Kind
    values: FloatArray

    @property
    def low(self) -> float:
        """The smallest value."""
        return float(self.values.min())

    @property
    def span(self) -> float:
        """The largest value minus the smallest."""
        return float(np.ptp(self.values))

    @property
    def distinct(self) -> int:
        """How many different values there are."""
        return len(np.unique(self.values))

    @property
    def middle(self) -> float:
        """A round number near the mean, about which formulas are written; 0 for a load, and where zero is near."""
        return 0.0 if self.kind == "load" else round_middle(self.values)


def search_covariates(
    aligned: AlignedRecording,
    rows: BoolArray,
    criteria: DescriptionCriteria,
    mirrored: Sequence[FloatArray],
    reasons: Mapping[str, str],
) -> list[SearchCovariate]:
    """Every measured quantity that a residual may follow, then the coordinates of the tip; of equal columns the first.

    rows : (N,) those to look at, of the usable ones.  mirrored : as from `mirrored_predictions`.
    reasons : of the quantities that are not searched, as from `untried_quantities`.
    """
    found: list[SearchCovariate] = []
    for name, column in aligned.gaps_filled.rows.quantities.items():
        if name not in reasons and not _is_among(column[rows], found):
            found.append(SearchCovariate(name, kind_of(name), column[rows]))
    tip: Kind = "place" if aligned.model is None else "workspace"
    for axis, column in zip("xyz", aligned.rows.tip_M_mm.T, strict=True):
        values = column[rows]
        if (
            np.isfinite(values).all()
            and _changes(values)
            and not _is_among(values, found) | _is_copy(column, mirrored, criteria)
        ):
            found.append(SearchCovariate(f"tip_{axis}_mm", tip, values))
    return found


def untried_quantities(
    aligned: AlignedRecording, criteria: DescriptionCriteria, mirrored: Sequence[FloatArray]
) -> dict[str, str]:
    """The measured quantities that are not searched, with the reason in words.

    mirrored : as from `mirrored_predictions`.
    """
    usable, at_zero = aligned.usable.mask, aligned.rows.quantities_at_zero
    reasons: dict[str, str] = {}
    for name, column in aligned.gaps_filled.rows.quantities.items():
        known = column[usable & np.isfinite(column)]
        if reason := Covariate.why_none(name, known):
            reasons[name] = reason
        elif len(known) < usable.sum():
            empty = np.mean(~np.isfinite(aligned.rows.quantities[name]))
            reasons[name] = f"empty in {100 * empty:.0f} % of the rows"
        elif not _changes(known):
            reasons[name] = STAYED_THE_SAME
        elif _is_copy(column, mirrored, criteria):
            reasons[name] = OWN_PREDICTION
        elif at_zero is not None and name not in at_zero:
            reasons[name] = NOT_AT_ZERO
    return reasons


def kind_of(name: str) -> Kind:
    """What kind of quantity a column is, by the unit that its name ends in."""
    unit = unit_of(name)
    return next((kind for kind, units in _UNITS.items() if unit in units), "other")


def round_middle(values: FloatArray) -> float:
    """The roundest number near the mean of (R, ...) values; 0 where that is negligible against their range."""
    mean, tolerance = float(np.nanmean(values)), MIDDLE_SHARE * float(np.nanmax(values) - np.nanmin(values))
    return 0.0 if abs(mean) <= tolerance else round_within(mean, tolerance / 2)


def round_within(value: float, tolerance: float) -> float:
    """The number with the fewest digits that differs from `value` by no more than `tolerance`.

    Example: 23.4567 within 0.1 is 23.5, within 1 it is 23.
    """
    for digits in range(1, 17):
        rounded = float(f"{value:.{digits}g}")
        if abs(rounded - value) <= tolerance:
            return rounded
    return value


def _changes(values: FloatArray) -> bool:
    return len(values) > 0 and float(np.ptp(values)) > MIN_CHANGE * max(1.0, float(np.abs(values).max()))


def mirrored_predictions(aligned: AlignedRecording, criteria: DescriptionCriteria) -> list[FloatArray]:
    """(N,) the prediction of each coordinate of which the reference is constant, as a straight edge's is.

    There the residual is the prediction with its sign reversed: whatever goes with that explains it, and says nothing.
    """
    predicted_mm, usable = aligned.predicted_mm({}), aligned.usable.mask
    scatter_mm = [np.nanstd(values[usable], axis=0) for values in (aligned.measured_mm, predicted_mm)]
    return [predicted_mm[:, k] for k in np.flatnonzero(scatter_mm[0] < criteria.constant_share * scatter_mm[1])]


def _is_copy(column: FloatArray, predictions: Sequence[FloatArray], criteria: DescriptionCriteria) -> bool:
    """Whether a column (N,) goes with one of some predictions (N,)."""
    for prediction in predictions:
        known = np.isfinite(column) & np.isfinite(prediction)
        if (
            _changes(column[known])
            and abs(np.corrcoef(column[known], prediction[known])[0, 1]) > criteria.copy_correlation
        ):
            return True
    return False


def _is_among(values: FloatArray, covariates: list[SearchCovariate]) -> bool:
    """Whether another covariate has the same values: a position that was recorded as a column of its own."""
    return any(np.allclose(values, covariate.values, rtol=0.0, atol=1e-6 * covariate.span) for covariate in covariates)
