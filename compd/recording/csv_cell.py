"""What a cell that should hold a number holds instead, in a spreadsheet user's words."""

from __future__ import annotations

import re
from typing import NamedTuple

NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")


class CellFault(NamedTuple):
    """A kind of wrong cell: what it is, what would be right, what to do."""

    what: str
    allowed: str
    next_step: str


_NUMBER_ALLOWED = "a number with a decimal point, or an empty cell where nothing was measured"

DECIMAL_COMMA = CellFault(
    "decimal comma", _NUMBER_ALLOWED, "export again with `.` as the decimal mark (a spreadsheet's English locale)"
)
AMBIGUOUS_COMMA = CellFault(
    "a comma that may be a decimal or a thousands mark",
    _NUMBER_ALLOWED,
    "export again with `.` as the decimal mark and no thousands separator",
)
_THOUSANDS = CellFault(
    "thousands separator", _NUMBER_ALLOWED, "export again with a number format without thousands separator"
)
_SPREADSHEET_ERROR = CellFault("a spreadsheet's error", _NUMBER_ALLOWED, "mend the formula, or empty the cell")
_MISSING_WORD = CellFault("a word or sign for a missing value", _NUMBER_ALLOWED, "empty the cell")
_NOT_FINITE = CellFault("not a finite number", _NUMBER_ALLOWED, "empty the cell")
_DATE = CellFault(
    "a date or a time of day",
    _NUMBER_ALLOWED,
    "for time_s write seconds from the start, e.g. =(A2-A$2)*86400; elsewhere give the column a number format",
)
_UNIT_IN_CELL = CellFault(
    "a unit behind the number", _NUMBER_ALLOWED, "write the unit once, at the end of the column's name"
)
_MINUS = CellFault("a typographic minus (U+2212 or a dash)", _NUMBER_ALLOWED, "write the minus of the keyboard, `-`")
_TEXT = CellFault("text where a number belongs", _NUMBER_ALLOWED, "write the number, or empty the cell")

_KINDS: tuple[tuple[re.Pattern[str], CellFault], ...] = tuple(
    (re.compile(pattern, re.IGNORECASE), fault)
    for pattern, fault in (
        (r"#[A-Z0-9/_ ]+[!?]?|#+|err:\d+", _SPREADSHEET_ERROR),
        (r"[-\u2013\u2014?*/.]+|n\.?\s?[/.]?\s?a\.?|nan|null|none|nil|missing|empty", _MISSING_WORD),
        (r"[+-]?(?:inf|infinity)", _NOT_FINITE),
        (r"[\u2212\u2013\u2014]\s*\d.*", _MINUS),
        (r"\d{1,4}([-/.])\d{1,2}\1\d{1,4}.*|\d{1,3}:\d{2}(?::\d{2}.*)?", _DATE),
        (r"[+-]?\d{1,3},\d{3}", AMBIGUOUS_COMMA),
        (r"[+-]?\d*,\d+(?:e[+-]?\d+)?|[+-]?\d{1,3}(?:\.\d{3})+,\d+", DECIMAL_COMMA),
        (r"[+-]?\d{1,3}(?:[,' \u00a0\u2009\u202f\u2019]\d{3})+(?:[.,]\d*)?|[+-]?\d{1,3}(?:\.\d{3}){2,}", _THOUSANDS),
        (r"[+-]?\d+(?:[.,]\d+)?\s*[^\d\s.,:/-][^\d]*", _UNIT_IN_CELL),
    )
)


def fault_of(text: str) -> CellFault | None:
    """What is wrong with a stripped, not empty cell; None for a finite number."""
    if NUMBER.fullmatch(text):
        return _NOT_FINITE if abs(float(text)) == float("inf") else None
    for pattern, fault in _KINDS:
        if pattern.fullmatch(text):
            return fault
    return _TEXT
