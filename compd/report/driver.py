"""The driver of a part of the error: the horizontal axis of its picture."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from compd.arrays import FloatArray
from compd.comparison import AlignedRecording, Covariate, covariates
from compd.model.effects import FittedEffect, needed_quantities
from compd.report.error_part import ErrorContribution
from compd.report.small_multiples import axis_title
from compd.units import unit_of

# Shares of a part's variation common to rows with neighbouring values of the driver. Below the first it is no driver;
# above the second the part is a line over it.
DRIVEN, ONE_LINE = 0.75, 0.98
# A period in a formula: sin(2 * pi * time_s / 676).
_PERIOD = re.compile(r"2 \* pi \* (\w+) / ([0-9.]+(?:e[+-]?[0-9]+)?)")


@dataclass(frozen=True, eq=False)
class Driver:
    """The driver of one series of a part.

    title : of an axis, with the unit.  values : (N,).
    one_line : whether the part is a single line over it.
    ends : words for -1 and +1 of a direction of travel; empty for all else.
    """

    title: str
    values: FloatArray
    one_line: bool = False
    ends: tuple[str, ...] = ()


def find_driver(
    part: ErrorContribution, series: int, effects: Sequence[FittedEffect], aligned: AlignedRecording, unit: str
) -> Driver:
    """The quantity that a series of the part follows most closely: one that the effects need, else a position.

    Where it follows nothing, as where an effect has several drivers at once, the part itself: against it the error
    before lies on a line, and the error after lies flat.
    """
    own = f"what {' and '.join(fitted.effect.id for fitted in effects)} does, {unit}"
    for drivers in (_needed(part, series, effects, aligned), _places(aligned)):
        shares = [(_driven_share(part, series, driver.values), driver) for driver in drivers]
        share, driver = max(shares, key=lambda pair: pair[0], default=(0.0, None))
        if driver is not None and share >= DRIVEN:
            return replace(driver, one_line=share >= ONE_LINE)
    return Driver(own, part.part[:, series], one_line=True)


def _needed(
    part: ErrorContribution, series: int, effects: Sequence[FittedEffect], aligned: AlignedRecording
) -> Iterator[Driver]:
    """Quantities that the effects need: those of the link itself, else each column."""
    rows = aligned.rows
    needs = {need for fitted in effects for need in fitted.effect.needs}
    link = aligned.axes[series] if aligned.of_links else series
    if part.at_links and link < rows.links:
        yield from _of_link(link, needs, effects, aligned)
    yield from _written_phases(effects, aligned)
    names = {name for fitted in effects for name in needed_quantities(fitted.effect, rows.links)}
    names |= {name for fitted in effects for name in fitted.effect.symbols if name.startswith("tip_")}
    for covariate in covariates(aligned):
        column = _column(covariate)
        is_needed = column in names or ("time" in needs and covariate.name == "time")
        is_needed |= "direction" in needs and covariate.name.startswith("direction of")
        # a gradient, if the thermometer at its top is needed
        is_needed |= f"{covariate.name.partition(' - ')[0]}_degC" in names and " - " in covariate.name
        if is_needed:
            yield _driver(covariate)
            yield from _phases(effects, covariate.name, unit_of(column), covariate.values)


def _of_link(
    link: int, needs: set[str], effects: Sequence[FittedEffect], aligned: AlignedRecording
) -> Iterator[Driver]:
    rows, name = aligned.rows, f"link {link + 1}"
    if any("temperature_link" in need for need in needs):
        yield Driver(f"temperature of {name}, degC", rows.quantity(f"temperature_link_{link + 1}_degC"))
    if "force" in needs:
        yield Driver(f"axial force in {name}, N", rows.axial_force_N[:, link])
    if "direction" in needs:
        yield _direction(f"direction of {name}", rows.direction[:, link])
    if "motion" in needs:
        yield Driver(f"speed of {name}, mm/s", rows.velocity_mm_per_s[:, link])
    yield from _phases(effects, f"reading of scale {link + 1}", "mm", rows.scale_mm[:, link])
    yield Driver(f"reading of scale {link + 1}, mm", rows.scale_mm[:, link])


def _places(aligned: AlignedRecording) -> Iterator[Driver]:
    """Tip position and link lengths: drivers of an effect that needs no quantity."""
    for covariate in covariates(aligned):
        if covariate.name in ("x", "y", "z") or covariate.name.startswith("length of"):
            yield _driver(covariate)


def _written_phases(effects: Sequence[FittedEffect], aligned: AlignedRecording) -> Iterator[Driver]:
    """Phase in a period that a formula has as a number."""
    columns = {"time_s": aligned.rows.time_s, **aligned.rows.quantities}
    for fitted in effects:
        for name, number in _PERIOD.findall(fitted.effect.equation):
            unit = unit_of(name)
            title = f"{name.removesuffix(f'_{unit}')} within a period of {float(number):.4g} {unit}, {unit}"
            if name in columns:
                yield Driver(title, np.mod(columns[name], float(number)))


def _phases(effects: Sequence[FittedEffect], name: str, unit: str, values: FloatArray) -> Iterator[Driver]:
    """Phase in a period, for each constant of the effects in the unit of the values."""
    for fitted in effects:
        for constant in fitted.effect.constants:
            period = fitted.constants.get(constant.name, 0.0)
            if constant.unit == unit and period > 0:
                yield Driver(f"{name} within a period of {period:.4g} {unit}, {unit}", np.mod(values, period))


def _driver(covariate: Covariate) -> Driver:
    if covariate.name.startswith("direction of "):
        return _direction(covariate.name, covariate.values)
    return Driver(axis_title(covariate), covariate.values)


def _direction(title: str, values: FloatArray) -> Driver:
    ends = ("shortening", "lengthening") if "link" in title else ("backwards", "forwards")
    return Driver(title, np.where(values == 0, np.nan, values), ends=ends)


def _column(covariate: Covariate) -> str:
    """The recording's column of a covariate."""
    unit = {"K": "degC", "%": "pct"}.get(covariate.unit, covariate.unit)
    return f"tip_{covariate.name}_mm" if covariate.name in ("x", "y", "z") else f"{covariate.name}_{unit}"


def _driven_share(part: ErrorContribution, series: int, values: FloatArray) -> float:
    """Share of the series' variation that rows with neighbouring values have in common.

    1 - sum (y_{i+1} - y_i)^2 / (2 sum (y_i - mean)^2), rows sorted by the values: 1 for a line, 0 for no relation (J.
    von Neumann, Ann. Math. Stat. 12 (1941) 367).
    """
    known = part.used & np.isfinite(values) & np.isfinite(part.part[:, series])
    x, y = values[known], part.part[known, series]
    total = float(((y - y.mean()) ** 2).sum()) if len(y) else 0.0
    if total == 0 or np.ptp(x) == 0:
        return 0.0
    steps = np.diff(y[np.argsort(x, kind="stable")])
    return 1.0 - float((steps**2).sum()) / (2 * total)
