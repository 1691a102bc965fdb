"""The covariates of the search for empirical terms: which columns a residual may follow, and what kind each is.

Not every column of a recording is one. A number that only counts or names rows follows everything that changed in time;
a derivative of the user's own model belongs to an effect; a column that stayed the same explains nothing. What is left
out is told with its reason (`untried_quantities`). A column with few empty cells is tried all the same: a gap is filled
from the nearest row in time (`fill_gaps`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.covariates import why_no_covariate
from compd.model.effect import Effect
from compd.model.effect_needs import needed_quantities
from compd.units import UNIT_KINDS, unit_of

# What a covariate is, by its unit: it decides in which forms a residual may follow it.
Kind: TypeAlias = Literal["place", "angle", "load", "flow", "other"]

# A covariate that is empty in a larger share of the rows is not tried: too much of it would be filled in.
MOST_EMPTY = 0.1
STAYED_THE_SAME = "stayed the same"
# Smaller changes, as a share of the largest value, are rounding.
LEAST_CHANGE = 1e-9
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

    name : as formulas call it.  kind : by its unit.
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


def search_covariates(aligned: AlignedRecording, rows: BoolArray) -> list[SearchCovariate]:
    """Every measured quantity that a residual may follow, then the coordinates of the tip; of equal columns the first.

    rows : (N,) those to look at, of the usable ones.
    """
    reasons = untried_quantities(aligned)
    found = [
        SearchCovariate(name, kind_of(name), fill_gap(column, aligned.rows.time_s)[rows])
        for name, column in aligned.recording.quantities.items()
        if name not in reasons
    ]
    for axis, column in zip("xyz", aligned.rows.tip_M_mm.T, strict=True):
        values = column[rows]
        if np.isfinite(values).all() and _changes(values) and not _is_among(values, found):
            found.append(SearchCovariate(f"tip_{axis}_mm", "place", values))
    return found


def untried_quantities(aligned: AlignedRecording) -> dict[str, str]:
    """The measured quantities that are not searched, with the reason in words."""
    usable = aligned.usable.mask
    reasons: dict[str, str] = {}
    for name, column in aligned.recording.quantities.items():
        values = column[usable]
        empty = float(np.mean(~np.isfinite(values))) if len(values) else 1.0
        known = values[np.isfinite(values)]
        if reason := why_no_covariate(name, known):
            reasons[name] = reason
        elif empty > MOST_EMPTY:
            reasons[name] = f"empty in {100 * empty:.0f} % of the rows"
        elif not _changes(known):
            reasons[name] = STAYED_THE_SAME
    return reasons


def kind_of(name: str) -> Kind:
    """What kind of quantity a column is, by the unit that its name ends in."""
    unit = unit_of(name)
    return next((kind for kind, units in _UNITS.items() if unit in units), "other")


def fill_gaps(aligned: AlignedRecording, effect: Effect) -> AlignedRecording:
    """The recording with the few empty cells of the quantities that an effect needs filled; itself without any.

    Example: a thermometer that missed one row of 990 gives that row the value of its nearest neighbour in time.
    """
    rows = aligned.rows
    filled = {
        name: fill_gap(rows.quantities[name], rows.time_s)
        for name in needed_quantities(effect, rows.links)
        if name in rows.quantities and 0 < np.mean(~np.isfinite(rows.quantities[name])) <= MOST_EMPTY
    }
    if not filled:
        return aligned
    return replace(aligned, rows=replace(rows, quantities={**rows.quantities, **filled}))


def fill_gap(values: FloatArray, time_s: FloatArray) -> FloatArray:
    """(N,) values with each nan replaced by the value of the nearest row in time that has one, the earlier of two.

    time_s : (N,) rising.  A column without any value stays as it is.
    """
    known = np.flatnonzero(np.isfinite(values))
    if len(known) in (0, len(values)):
        return values
    after = np.minimum(np.searchsorted(known, np.arange(len(values))), len(known) - 1)
    before = np.maximum(after - 1, 0)
    earlier, later = known[before], known[after]
    nearest = np.where(np.abs(time_s - time_s[earlier]) <= np.abs(time_s[later] - time_s), earlier, later)
    return np.where(np.isfinite(values), values, values[nearest])


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
    return len(values) > 0 and float(np.ptp(values)) > LEAST_CHANGE * max(1.0, float(np.abs(values).max()))


def _is_among(values: FloatArray, covariates: list[SearchCovariate]) -> bool:
    """Whether another covariate has the same values: a position that was recorded as a column of its own."""
    return any(np.allclose(values, covariate.values, rtol=0.0, atol=1e-6 * covariate.span) for covariate in covariates)
