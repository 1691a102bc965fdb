"""Several reflectors at different places on the platform: their places as a person states them, and who shows what."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from compd.arrays import IntArray
from compd.errors import Problem, RecordingError
from compd.instruments import POSITION_AXES, InstrumentExport

Place = tuple[float, float, float]
_FORM = "A=60,0,-15"
_OPTION = "--reflector-place"
_NUMBER = r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*"
_PLACE = re.compile(rf"\s*(?P<name>[^=]*[^=\s])\s*={_NUMBER},{_NUMBER},{_NUMBER}")


class SeenReflector(NamedTuple):
    """A reflector, and the points of an export that it gave.

    place_P_mm : from the tip along the axes of {P}; None for the only one, which is where the machine's target is.
    points : (G,) their places in the export.
    """

    name: str
    place_P_mm: Place | None
    points: IntArray


def reflector_places(texts: Sequence[str]) -> dict[str, Place]:
    """Name -> place (mm) from texts such as "A=60,0,-15". Raises RecordingError with every text that is none."""
    problems, places = list[Problem](), dict[str, Place]()
    for text in texts:
        match = _PLACE.fullmatch(text)
        name = "" if match is None else match["name"]
        if match is None or name in places:
            what = "is not understood" if match is None else "names a reflector that has a place already"
            problems.append(Problem(f"{_OPTION} {text}", what, allowed=f"a name, and x, y, z in mm: {_FORM}"))
        else:
            x, y, z = map(float, match.groups()[1:])
            places[name] = x, y, z
    if problems:
        raise RecordingError(problems)
    return places


def reflector_problems(export: InstrumentExport, places: Mapping[str, Place], at_rest: bool) -> list[Problem]:
    """What the reflectors of an export contradict. A column with one name and no place is not of several."""
    names = _names(export)
    told = len(names) > 1 or bool(places)
    problems = list[Problem]()

    def add(what: str, value: str, allowed: str, next_step: str = "") -> None:
        problems.append(Problem(str(export.path), what, value=value, allowed=allowed, next_step=next_step))

    leave_out = "measure with one, or leave the column out with --columns"
    if told and not at_rest:
        add("several reflectors are joined at rest", ", ".join(names), "--by order, name or distance", leave_out)
    elif told and not names:
        add("has no column of reflectors", ", ".join(places), "a column", "name it with --reflector, or with --columns")
    elif told and export.axes != POSITION_AXES:
        what = "a pose or a length is not of several reflectors"
        add(what, ", ".join(export.axes), "x, y, z", f"leave {_OPTION} out")
    elif missing := sorted(names - set(places)) if told else []:
        what = "has reflectors without a place" if places else "has several reflectors, and no place of any"
        allowed = "for each its place from the tip along the axes of {P}, mm"
        add(what, ", ".join(missing), allowed, f'{_OPTION} "{missing[0]}=60,0,-15", once for each; or {leave_out}')
    return problems


def of_points_at_rest(export: InstrumentExport, places: Mapping[str, Place]) -> list[Problem]:
    """What an export that is joined by time must not have: several reflectors, and visits."""
    problems = reflector_problems(export, places, at_rest=False)
    if export.visit is not None:
        what = "a column of visits is of points at rest"
        allowed = "--by order, name or distance"
        problems.append(Problem(str(export.path), what, allowed=allowed, next_step="leave the column out"))
    return problems


def seen_reflectors(export: InstrumentExport, places: Mapping[str, Place]) -> list[SeenReflector]:
    """Each with its points, in the order of `places`; without places all points are of one at the machine's target."""
    if not places or export.reflector is None:
        return [SeenReflector("", None, np.arange(len(export.line)))]
    names = np.array(export.reflector)
    seen = [SeenReflector(name, place, np.flatnonzero(names == name)) for name, place in places.items()]
    return [reflector for reflector in seen if len(reflector.points)]


def points_of(export: InstrumentExport, points: IntArray) -> InstrumentExport:
    """The export with these points alone."""
    if len(points) == len(export.line):
        return export

    def texts(cells: tuple[str, ...] | None) -> tuple[str, ...] | None:
        return None if cells is None else tuple(cells[k] for k in points)

    return replace(
        export,
        line=export.line[points],
        values=export.values[points],
        time_s=None if export.time_s is None else export.time_s[points],
        name=texts(export.name),
        visit=texts(export.visit),
        reflector=texts(export.reflector),
    )


def _names(export: InstrumentExport) -> set[str]:
    return set(export.reflector or ())
