"""Between what the cells of a line stand: a delimiter, or blanks."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence

from compd.instruments.cells import is_number

# Delimiters in order of precedence: a comma may be a decimal mark, too.
DELIMITERS = {"\t": "tab", ";": "semicolon", "|": "pipe", ",": "comma"}
BLANKS = " "
WIDE_BLANKS = "  "
NAMES = {**DELIMITERS, BLANKS: "blanks", WIDE_BLANKS: "two blanks or more"}
_TWO_NUMBERS = re.compile(r"[-+]?[\d.]+\s+[-+]?[\d.]+")
_WIDE = re.compile(r"\s{2,}")
# Least share of the lines with the delimiter.
_SHARE = 0.6
_LOOKED_AT = 400


def find_delimiter(rows: Sequence[str], decimal: str | None) -> str:
    """A key of NAMES for the lines of a table.  decimal : the decimal mark, where a person said it."""
    sample = rows[:: max(1, len(rows) // _LOOKED_AT)]
    for delimiter in DELIMITERS:
        with_it = [row for row in sample if delimiter in row]
        if len(with_it) < max(1.0, _SHARE * len(sample)):
            continue
        if delimiter == "," and (_commas_are_decimal(with_it) or (decimal == "," and '"' not in "".join(with_it))):
            continue
        return delimiter
    narrow, wide = (_agreement(sample, delimiter) for delimiter in (BLANKS, WIDE_BLANKS))
    return WIDE_BLANKS if wide > narrow else BLANKS


def split_cells(row: str, delimiter: str) -> list[str]:
    """The cells of one line, stripped; of a quoted cell what stands within the quotes."""
    if delimiter == BLANKS:
        return row.split()
    if delimiter == WIDE_BLANKS:
        return _WIDE.split(row.strip())
    if '"' in row:
        try:
            return [cell.strip() for cell in next(csv.reader([row], delimiter=delimiter, skipinitialspace=True))]
        except (csv.Error, StopIteration):
            pass  # a quote that is none
    return [cell.strip() for cell in row.split(delimiter)]


def split_header(row: str, delimiter: str, count: int) -> list[str]:
    """The names in a line above `count` columns; between blanks a unit in brackets belongs to the name before it."""
    if delimiter not in (BLANKS, WIDE_BLANKS):
        return split_cells(row, delimiter)
    ways = (
        _WIDE.split(row.strip()),
        re.findall(r"\S+(?:\s*[\[(][^\])]*[\])])?", row),
        row.split(),
    )
    return next((way for way in ways if len(way) == count), ways[-1])


def _commas_are_decimal(rows: Sequence[str]) -> bool:
    """Whether between commas there are two numbers: "1,5 2,5" has "5 2"."""
    two = sum(any(_TWO_NUMBERS.fullmatch(cell.strip()) for cell in row.split(",")) for row in rows)
    return two >= _SHARE * len(rows)


def _agreement(rows: Sequence[str], delimiter: str) -> float:
    """Share of the lines that have the most frequent number of cells; 0 where that is one."""
    cells = [split_cells(row, delimiter) for row in rows]
    # prose above a table has no numbers
    counts = Counter(len(row) for row in cells if any(map(is_number, row)))
    if not counts:
        return 0.0
    count, lines = counts.most_common(1)[0]
    return lines / sum(counts.values()) if count > 1 else 0.0
