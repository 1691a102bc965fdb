"""When a text counts as a table of measurements: before that, no message quotes anything of it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

from compd.errors import Problem
from compd.instruments.cells import is_number
from compd.instruments.time_stamps import is_stamp

_LOOKED_AT = 500
# Least share of numbers among a table's cells without dates; more than this share in a short table.
_MIN_SHARE = 1 / 2
_LONGER_ROWS = 3
_BETWEEN = re.compile(r"[;\t,]|\s+")
_COMMENT = ("#", "%", "//")


def is_table(lines: Sequence[str]) -> bool:
    """Whether most of the lines with a number in them have equally many cells, and many of the cells are numbers."""
    rows = [_BETWEEN.split(line.strip()) for line in lines[:_LOOKED_AT] if not line.lstrip().startswith(_COMMENT)]
    rows = [cells for cells in rows if any(map(is_number, cells))]
    if not rows:
        return False
    usual = Counter(map(len, rows)).most_common(1)[0][1]
    return 2 * usual > len(rows) and _has_numbers((cell for cells in rows for cell in cells), len(rows))


def is_of_numbers(columns: Sequence[Sequence[str]]) -> bool:
    """Whether many of the cells, column by column, are numbers."""
    rows = max(map(len, columns), default=0)
    return _has_numbers((cell for cells in columns for cell in cells[:_LOOKED_AT]), rows)


def no_table(path: Path) -> Problem:
    """The problem of a text that is none."""
    return Problem(
        str(path),
        "is no table of measurements",
        allowed="rows of numbers, with a header or without",
        next_step="give the path of the instrument's export",
    )


def _has_numbers(cells: Iterable[str], rows: int) -> bool:
    filled = [cell for cell in cells if cell and not is_stamp(cell)]
    numbers, least = sum(map(is_number, filled)), _MIN_SHARE * len(filled)
    return numbers > least or (numbers == least and rows >= _LONGER_ROWS)
