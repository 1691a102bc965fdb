"""Plausible ranges that belong to one machine: from the tolerance to which it was made, or stated number by number."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from compd.errors import CompdError, Problem
from compd.link_count import scale_count
from compd.model.effects import Effect, FittedEffect, Observations, Parameter

_STATEMENT = re.compile(
    r"(?P<effect>\w+)\.(?P<parameter>\w+)\s*=\s*(?P<low>[-+\d.eE]+)\s*\.\.\s*(?P<high>[-+\d.eE]+)\s*(?P<unit>\S*)"
)
_FORM = "EFFECT.PARAMETER=LOW..HIGH with a unit, such as link_zero.z=-3..3mm"
# How many of a parameter's unit are in one of another: um of mm.
_UNITS: Mapping[str, Mapping[str, float]] = {
    "um": {"mm": 1e3, "nm": 1e-3},
    "urad": {"rad": 1e6, "mrad": 1e3, "deg": 1e6 * np.pi / 180},
    "ppm": {"%": 1e4, "1": 1e6},
}
# How the source of a range begins that follows from the machine's tolerance.
TOLERANCE_KEY = "geometry.tolerance_mm"
_PER_MM, _PER_ONE = 1e3, 1e6  # um per mm; ppm and urad per 1


class StatedRange(NamedTuple):
    """A range that a user stated for one parameter; unit : "" for the parameter's own."""

    effect: str
    parameter: str
    low: float
    high: float
    unit: str = ""

    def __str__(self) -> str:
        return f"{self.effect}.{self.parameter}={self.low:g}..{self.high:g}{self.unit}"


def read_range(text: str) -> StatedRange:
    """A range from EFFECT.PARAMETER=LOW..HIGH and a unit. Raises CompdError for another text."""
    match = _STATEMENT.fullmatch(text.strip())
    try:
        low, high = (float(match[end]) for end in ("low", "high")) if match else (np.nan, np.nan)
    except ValueError:
        low, high = np.nan, np.nan
    if match is None or not low < high:
        raise CompdError.of("range", "is no range of a number", value=text, allowed=_FORM)
    return StatedRange(match["effect"], match["parameter"], low, high, match["unit"])


def check_ranges(ranges: Iterable[StatedRange], effects: Iterable[Effect]) -> None:
    """Raise CompdError, with every problem, where a range is of no parameter of these effects, is in another unit, or
    is one of several for a parameter."""
    parameters = {f"{effect.id}.{one.name}": one for effect in effects for one in effect.parameters}
    ranges = tuple(ranges)
    times = Counter((stated.effect, stated.parameter) for stated in ranges)
    problems = [
        Problem("range", "is stated more than once", value=f"{effect}.{parameter}", next_step="keep one")
        for (effect, parameter), count in times.items()
        if count > 1
    ]
    for stated in ranges:
        name = f"{stated.effect}.{stated.parameter}"
        of_effect = sorted(other for other in parameters if other.startswith(f"{stated.effect}."))
        if name not in parameters:
            problems.append(
                Problem(
                    "range",
                    "is of no effect's parameter",
                    value=name,
                    allowed=", ".join(of_effect) or "EFFECT.PARAMETER",
                    next_step="`compd model effects` shows all effects, `compd model effect EFFECT` its parameters",
                )
            )
        elif _factor(parameters[name], stated.unit) is None:
            own = parameters[name].unit
            problems.append(
                Problem(
                    "range",
                    "has another unit than the parameter",
                    value=str(stated),
                    allowed=", ".join([own, *_UNITS.get(own, {})]),
                )
            )
    if problems:
        raise CompdError(problems)


def on_machine(effect: Effect, rows: Observations, stated: Iterable[StatedRange] = ()) -> Effect:
    """The effect with the ranges that its parameters have on the machine of these rows.

    A place or a zero is plausible within the machine's tolerance; a gain within tolerance / stroke; a tilt within
    tolerance / radius of the platform joints. Where no tolerance is stated, or where the rows and the configuration
    give no stroke, the library's range stays. A range in `stated` goes before all.
    """
    own = {one.parameter: one for one in stated if one.effect == effect.id}
    parameters = tuple(_ranged(parameter, rows, own.get(parameter.name)) for parameter in effect.parameters)
    return effect if parameters == effect.parameters else replace(effect, parameters=parameters)


def fitted_on_machine(
    fitted: Iterable[FittedEffect], rows: Observations, stated: Iterable[StatedRange] = ()
) -> tuple[FittedEffect, ...]:
    """The same of effects with their numbers."""
    stated = tuple(stated)
    return tuple(replace(one, effect=on_machine(one.effect, rows, stated)) for one in fitted)


def _ranged(parameter: Parameter, rows: Observations, stated: StatedRange | None) -> Parameter:
    if stated is not None:
        factor = _factor(parameter, stated.unit)
        assert factor is not None, "checked by check_ranges"
        return replace(parameter, low=factor * stated.low, high=factor * stated.high, source="stated by the user")
    tolerance_mm = rows.constants.tolerance_mm
    if not parameter.tolerance or np.isnan(tolerance_mm):
        return parameter
    size_mm, what = {
        "place": (1.0, ""),
        "gain": (_stroke_mm(rows), " / stroke"),
        "gain_change": (_stroke_mm(rows) ** 2, " / stroke^2"),
        "tilt": (_radius_mm(rows), " / radius of the platform joints"),
    }[parameter.tolerance]
    largest = (
        tolerance_mm / size_mm * (_PER_MM if parameter.tolerance == "place" else _PER_ONE) if size_mm > 0 else np.inf
    )
    if not np.isfinite(largest):
        return parameter
    source = f"{TOLERANCE_KEY} {tolerance_mm:g}{what}"
    return replace(parameter, low=-float(largest), high=float(largest), source=source, rough=True)


def _stroke_mm(rows: Observations) -> float:
    """By how much a link's length changes at most, by the configuration, or else by the rows; 0 where it does not."""
    if not np.isnan(rows.constants.stroke_mm):
        return rows.constants.stroke_mm
    seen = rows.scale_mm[np.isfinite(rows.scale_mm).all(axis=1)]
    return float(np.ptp(seen, axis=0).max()) if len(seen) and scale_count(rows.links) else 0.0


def _radius_mm(rows: Observations) -> float:
    """Root mean square distance of the platform joints from their centroid."""
    joints = rows.constants.platform_joints_P_mm
    return float(np.sqrt(((joints - joints.mean(axis=0)) ** 2).sum(axis=1).mean())) if len(joints) else 0.0


def _factor(parameter: Parameter, unit: str) -> float | None:
    """How many of the parameter's unit one of `unit` is; None for a unit of another quantity."""
    if unit in ("", parameter.unit):
        return 1.0
    return _UNITS.get(parameter.unit, {}).get(unit)
