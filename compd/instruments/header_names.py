"""What the name of a column says: which role it has, and in which unit it is."""

from __future__ import annotations

import re
from typing import NamedTuple

from compd.units import unit_named

_PARTS = re.compile(r"[^0-9a-z]+")
_UNIT_BEHIND = re.compile(r"[\[(<{]\s*([^\[\](){}<>]*?)\s*[\])>}]\s*$")
_LETTERS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "µ": "u", "μ": "u"})

# Words of a name that make it something else than what was measured.
_NOT_MEASURED = frozenset(
    "nominal nom soll sollwert theo theoretical dev deviation abweichung delta error err fehler sigma std rms "
    "uncertainty unsicherheit tol tolerance toleranz min max offset".split()
)
# Words that do not change what a name means.
_MEASURED = frozenset("actual act measured meas ist istwert mess gemessen value wert".split())
_TIME = frozenset(
    "t time timestamp zeit zeitstempel uhrzeit messzeit elapsed seconds sekunden datetime zeitpunkt".split()
)
_DATE = frozenset("date datum".split())
_LENGTH = frozenset(
    "length distance displacement position l d laenge abstand weg entfernung verschiebung strecke".split()
)
_NAME = frozenset(
    "name target point punkt punktname pointname targetname label bezeichnung targetid pointid punktbezeichnung".split()
)
_NUMBER = frozenset("id nr no num number nummer punktnummer index punktnr pointnumber".split())
_GROUP = frozenset("group gruppe pointgroup punktgruppe".split())
_COLLECTION = frozenset("collection sammlung".split())
_ANGLES = frozenset("roll pitch yaw a b c rollen nicken gieren".split())
_LINK = re.compile(r"link_?\d+")


class HeaderName(NamedTuple):
    """A column's name, understood.

    role : time, date, x, y, z, rx, ry, rz, length, name, number, group, collection; "angle" for one that may have any
    of several meanings; "" for anything else. unit : as `compd.units` names it; "" for none.
    """

    role: str
    unit: str


def tidy_name(name: str) -> str:
    """A name in lower case with single underscores: "Tracker X [mm]" is "tracker_x_mm"."""
    return _PARTS.sub("_", name.lower().translate(_LETTERS)).strip("_")


def understand(name: str) -> HeaderName:
    """Role and unit of a column by its name alone."""
    stem, unit = split_unit(name)
    parts = [part for part in stem.split("_") if part not in _MEASURED]
    if not parts or not _NOT_MEASURED.isdisjoint(parts):
        return HeaderName("", unit)
    return HeaderName(_role(parts), unit)


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


def _role(parts: list[str]) -> str:
    last, whole = parts[-1], "".join(parts)
    if last in _TIME or whole in _TIME:
        return "time"
    if whole in _DATE or whole in {"datetime"}:
        return "date"
    if last in {"x", "y", "z", "rx", "ry", "rz"}:
        return last
    if last in _ANGLES and (len(last) > 1 or len(parts) == 1):
        return "angle"
    for role, words in (
        ("name", _NAME),
        ("number", _NUMBER),
        ("group", _GROUP),
        ("collection", _COLLECTION),
    ):
        if whole in words:
            return role
    numbered = last.isdigit() and len(parts) > 1 and parts[-2] in _LENGTH
    if last in _LENGTH or numbered or _LINK.fullmatch("_".join(parts[-2:])):
        return "length"
    return ""
