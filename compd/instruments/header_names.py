"""What the name of a column says: which role it has, and in which unit it is."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import zip_longest
from typing import NamedTuple

from compd.instruments.axes import ATTITUDE_AXES, POSITION_AXES
from compd.units import KNOWN_UNITS, unit_named

_PARTS = re.compile(r"[^0-9a-z]+")
_UNIT_BEHIND = re.compile(r"[\[(<{]\s*([^\[\](){}<>]*?)\s*[\])>}]\s*$")
_MICRO = str.maketrans({"µ": "u", "μ": "u"})
_LETTERS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "µ": "u", "μ": "u"})

# Normalised words by the role of their column, in English and German.
_WORDS = {
    "not measured": "nominal nom soll sollwert theo theoretical dev deviation abweichung delta error err fehler sigma "
    "std rms uncertainty unsicherheit tol tolerance toleranz min max offset",
    "measured": "actual act measured meas ist istwert mess gemessen value wert",
    "time": "t time timestamp zeit zeitstempel uhrzeit messzeit elapsed seconds sekunden datetime zeitpunkt",
    "date": "date datum",
    "length": "length distance displacement position l d laenge abstand weg entfernung verschiebung strecke",
    "name": "name target point punkt punktname pointname targetname label targetid pointid "
    "bezeichnung punktbezeichnung",
    "number": "id nr no num number nummer punktnummer index punktnr pointnumber",
    "reflector": "reflector reflectorname reflectorid smr prism reflektor reflektorname prisma",
    "group": "group gruppe pointgroup punktgruppe",
    "collection": "collection sammlung",
    "angle": "roll pitch yaw a b c rollen nicken gieren",
    **{axis: axis for axis in (*POSITION_AXES, *ATTITUDE_AXES)},
}
_MEANING = {word: meaning for meaning, words in _WORDS.items() for word in words.split()}
# Words that also count at the end of a name: "Tracker X", "raw time".
_LAST = ("time", *POSITION_AXES, *ATTITUDE_AXES, "length")
_TURNS = {"roll": "rx", "rollen": "rx", "pitch": "ry", "nicken": "ry", "yaw": "rz", "gieren": "rz"}
_LINK = re.compile(r"link_?\d+")


class HeaderName(NamedTuple):
    """A column's name, understood.

    role : time, date, x, y, z, rx, ry, rz, length, name, number, reflector, group, collection; "angle" for one that
    may have any of several meanings; "" for anything else. unit : as `compd.units` names it; "" for none.
    """

    role: str
    unit: str


def tidy_name(name: str) -> str:
    """A name in lower case with single underscores: "Tracker X [mm]" is "tracker_x_mm"."""
    return _PARTS.sub("_", name.lower().translate(_LETTERS)).strip("_")


def understand(name: str) -> HeaderName:
    """Role and unit of a column by its name alone."""
    stem, unit = split_unit(name)
    # "actual x" is x
    parts = [part for part in stem.split("_") if _MEANING.get(part) != "measured"]
    if not any(parts) or any(_MEANING.get(part) == "not measured" for part in parts):
        return HeaderName("", unit)
    whole, last = _MEANING.get("".join(parts), ""), _MEANING.get(parts[-1], "")
    if whole or last in _LAST or (last == "angle" and len(parts[-1]) > 1):
        return HeaderName(whole or last, unit)
    numbered = parts[-1].isdigit() and len(parts) > 1 and _MEANING.get(parts[-2]) == "length"
    return HeaderName("length" if numbered or _LINK.fullmatch("_".join(parts[-2:])) else "", unit)


def turn_axis(name: str) -> str:
    """rx, ry or rz of a column named roll, pitch or yaw, in English or German; "" of any other."""
    return _TURNS.get(split_unit(name)[0].rpartition("_")[2], "")


def is_unit_row(cells: Sequence[str]) -> bool:
    """Whether each cell is a unit, a dash or empty, and one is a unit."""
    units = list(map(_unit_alone, cells))
    return None not in units and any(units)


def with_units(names: Sequence[str], cells: Sequence[str]) -> tuple[str, ...]:
    """The names with the unit in the cell below each: ("X", "mm") is "X [mm]"."""
    below = zip_longest(names, map(_unit_alone, cells), fillvalue="")
    return tuple(f"{name} [{unit}]" if unit else str(name) for name, unit in below)


def _unit_alone(cell: str) -> str | None:
    """The unit in a cell such as "mm" or "[mm]", "" for none; None for anything else."""
    bare = cell.strip("[](){} ").translate(_MICRO).replace("°C", "degC")
    return "" if bare in ("", "-", "1") else bare if unit_named(bare) or bare in KNOWN_UNITS else None


def is_not_measured(name: str) -> bool:
    """Whether a column's name says that it is nominal, a deviation or an uncertainty, also in one word: xnom."""
    parts = [part for stem in split_unit(name)[0].split("_") for part in (stem, stem[1:], stem[:-1])]
    return any(_MEANING.get(part) == "not measured" for part in parts)


def split_unit(name: str) -> tuple[str, str]:
    """A name without its unit, tidied, and the unit: "X [mm]", "x_mm", "X mm", "X / mm" are ("x", "mm")."""
    behind = _UNIT_BEHIND.search(name)
    if behind:
        unit = unit_named(behind[1])
        stem = tidy_name(name[: behind.start()])
        return (stem, unit) if stem else (tidy_name(name), unit)
    tidied = _PARTS.sub("_", name.replace("µ", "u").replace("μ", "u").lower()).strip("_")
    head, _, last = tidied.rpartition("_")
    # as it was written: `x_M` is in a frame M, `x_m` in metres
    written = [part for part in re.split(r"[^0-9A-Za-zµμ°\"]+", name) if part]
    unit = unit_named(written[-1]) if head and last else ""
    if not unit:
        return tidy_name(name), ""
    stem = tidy_name(head)
    return (stem.removesuffix("_in") if unit != "inch" else stem), unit
