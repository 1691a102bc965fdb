"""Units in the notation of gauges, and recognition of the unit beside a number."""

from __future__ import annotations

import re

from compd.units import KNOWN_UNITS, unit_factor, unit_named

# Units allowed on the wire in a description, and recognised in a reply.
WIRE_UNITS = ("mm", "um", "nm", "inch", "mil", "degC", "degF", "kN", "hPa", "mbar", "kPa", "Pa", "pct")
# Units with exact letters; except for the metre, a single letter is as often a state or a side.
_EXACT = {
    **{name: name for name in (*KNOWN_UNITS, "mil", "m") if len(name) > 1 or name == "m"},
    **{"\xb0C": "degC", "\xb0F": "degF", "%RH": "pct"},
}
_BEGINS = re.compile(r" *([A-Za-z\xb5\xb0%]+|\")(?![A-Za-z\xb5])")
_ENDS = re.compile(r"(?<![A-Za-z\xb5])([A-Za-z\xb5\xb0%]+|\") *$")


def wire_unit(word: str) -> str:
    """The unit of a word, including those without a channel (mV); "" for no unit."""
    word = _latin(word)
    length = "" if len(word) == 1 and word.isalpha() else unit_named(word)
    return length if unit_factor(length, "mm") else _EXACT.get(word, "")


def is_wire_unit(word: str) -> bool:
    """Whether a word is an allowed unit on the wire."""
    return wire_unit(word) in WIRE_UNITS


def unit_behind(text: str) -> tuple[str, str]:
    """The unit with which the text behind a number begins, and its word; ("", "") if it begins with none."""
    match = _BEGINS.match(_latin(text))
    unit = wire_unit(match[1]) if match else ""
    return (unit, match[1]) if match and unit else ("", "")


def unit_before(text: str) -> tuple[str, str]:
    """The unit in which the text before a number ends, and its word; ("", "") if it ends in none."""
    match = _ENDS.search(_latin(text))
    unit = wire_unit(match[1]) if match else ""
    return (unit, match[1]) if match and unit else ("", "")


def _latin(text: str) -> str:
    """A micro or degree sign in UTF-8 as one character."""
    return text.replace("\xc2\xb5", "\xb5").replace("\xce\xbc", "\xb5").replace("\xc2\xb0", "\xb0")
