"""Units as gauges write them beside their numbers, and which word beside a number is its unit."""

from __future__ import annotations

import re

from compd.units import unit_named

# Those of `compd.units` that a description may give a channel, and others, which count in exactly these letters.
_LENGTHS = ("mm", "um", "nm", "inch")
_EXACT = {
    **{name: name for name in ("mil", "degC", "degF", "kN", "hPa", "mbar", "kPa", "Pa")},
    **{"\xb0C": "degC", "\xb0F": "degF", "%RH": "pct"},
}
_BEGINS = re.compile(r" *([A-Za-z\xb5\xb0%]+|\")(?![A-Za-z\xb5])")
_ENDS = re.compile(r"(?<![A-Za-z\xb5])([A-Za-z\xb5\xb0%]+|\") *$")


def wire_unit(word: str) -> str:
    """The unit of a channel that a word is; "" if it is none, as a single letter never is."""
    if len(word) == 1 and word != '"':
        return ""
    length = unit_named(_latin(word))
    return length if length in _LENGTHS else _EXACT.get(_latin(word), "")


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
