"""The cells of a sheet as text, each with its kind."""

from __future__ import annotations

import datetime
import re
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from compd.errors import Problem, RecordingError

if TYPE_CHECKING:
    from openpyxl.worksheet._read_only import ReadOnlyWorksheet

# Most rows of a sheet, and most columns of an instrument's list.
MAX_ROWS = 1_048_576
MAX_COLUMNS = 500
# Kinds of cells. COMMA: a number as text, with a comma; ERROR: of the spreadsheet; NO_VALUE: a formula without one.
EMPTY, TEXT, NUMBER, DATE, COMMA, ERROR, NO_VALUE = range(7)
# Kinds that stand for a value, in a list below its header.
VALUES = frozenset({NUMBER, DATE, COMMA, ERROR, NO_VALUE})
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_COMMA_NUMBER = re.compile(r"[+-]?(?:\d+,\d*|,\d+)(?:[eE][+-]?\d+)?")
_SHOWN = 5


class Row(NamedTuple):
    """number : of the row in the sheet, from 1. texts, kinds : of its cells from column A on."""

    number: int
    texts: list[str]
    kinds: list[int]


class SheetReader:
    """Reads one sheet. dates : whether a cell was a date or a time of day."""

    def __init__(self, path: Path, title: str) -> None:
        self._path = path
        self.place = f"{path}: sheet {title!r}"
        self.dates = False

    def read(self, sheet: ReadOnlyWorksheet) -> list[Row]:
        """The rows that are not empty."""
        rows = []
        for number, cells in self._numbered(sheet):
            row = Row(number, [], [])
            for cell in cells:
                text, kind = self._text_and_kind(cell.value, cell.data_type)
                row.texts.append(text)
                row.kinds.append(kind)
            if any(row.kinds):
                rows.append(row)
        return rows

    def has_number(self, sheet: ReadOnlyWorksheet, most_rows: int) -> bool:
        """Whether one of the first rows holds a number."""
        return any(
            self._text_and_kind(cell.value, cell.data_type)[1] in {NUMBER, COMMA}
            for _, cells in islice(self._numbered(sheet), most_rows)
            for cell in cells
        )

    def mark_formulas_without_value(self, sheet: ReadOnlyWorksheet, rows: list[Row]) -> None:
        """Mark the cells of `rows` that hold a formula and no value. sheet : the same one, with its formulas."""
        by_number = {row.number: row for row in rows}
        for number, cells in self._numbered(sheet):
            empty = [k for k, cell in enumerate(cells) if cell.data_type == "f"]
            if not empty:
                continue
            row = by_number.get(number)
            if row is None:
                row = Row(number, [""] * len(cells), [EMPTY] * len(cells))
                rows.append(row)
            for k in empty:
                if row.kinds[k] == EMPTY:
                    row.kinds[k] = NO_VALUE
        rows.sort(key=lambda row: row.number)
        rows[:] = [row for row in rows if any(row.kinds)]

    def wrong_cells(self, rows: Sequence[Row], decimal: str | None) -> list[Problem]:
        """A problem for each kind of wrong cell. With `decimal` a comma, numbers as text are converted in place."""
        found: dict[int, list[str]] = {ERROR: [], NO_VALUE: [], COMMA: []}
        for row in rows:
            for k, kind in enumerate(row.kinds):
                if kind == COMMA and decimal == ",":
                    row.texts[k], row.kinds[k] = row.texts[k].replace(",", "."), NUMBER
                elif kind in found:
                    found[kind].append(f"{cell_name(k, row.number)} {row.texts[k]}".rstrip())
        what = {
            ERROR: ("an error of the spreadsheet", "mend the formula, or empty the cell"),
            NO_VALUE: (
                "a formula without a value: the program that wrote the file has not computed it",
                "open the file in a spreadsheet, let it compute, and save it",
            ),
            COMMA: (
                "a number as text, whose comma may be a decimal or a thousands mark",
                "make them numbers in the spreadsheet, or give --decimal ,",
            ),
        }
        return [
            Problem(
                f"{self.place}, {', '.join(cell.split()[0] for cell in cells[:_SHOWN])}",
                f"{len(cells)} cells with {what[kind][0]}" if len(cells) > 1 else what[kind][0],
                value=", ".join(" ".join(cell.split()[1:]) for cell in cells[:_SHOWN] if " " in cell),
                next_step=what[kind][1],
            )
            for kind, cells in found.items()
            if cells
        ]

    def _numbered(self, sheet: ReadOnlyWorksheet) -> Iterator[tuple[int, Sequence[Any]]]:
        """(number, cells) of every row. Raises RecordingError if there are more than a list can have."""
        # what the file says of its size may be wrong, and is what rows are padded to
        sheet.reset_dimensions()
        for number, cells in enumerate(cast(Any, sheet).iter_rows(), start=1):
            if number > MAX_ROWS or len(cells) > MAX_COLUMNS:
                raise RecordingError.of(
                    f"{self.place}, row {number}",
                    "is beyond what a list can have",
                    value=f"{len(cells)} columns",
                    allowed=f"{MAX_ROWS} rows, {MAX_COLUMNS} columns",
                    next_step="delete what stands far to the right or below, or save the list as CSV",
                )
            yield number, cells

    def _text_and_kind(self, value: Any, data_type: str) -> tuple[str, int]:
        if value is None:
            return "", EMPTY
        if isinstance(value, bool):
            return str(value).upper(), TEXT
        if isinstance(value, int | float):
            return repr(value), NUMBER
        if isinstance(value, datetime.datetime | datetime.date | datetime.time):
            self.dates = True
            return value.isoformat(**({} if type(value) is datetime.date else {"timespec": "milliseconds"})), DATE
        if isinstance(value, datetime.timedelta):
            self.dates = True
            return _duration(value), DATE
        text = str(value).strip()
        if data_type == "e":
            return text, ERROR
        if _NUMBER.fullmatch(text):
            return text, NUMBER
        return text, COMMA if _COMMA_NUMBER.fullmatch(text) else TEXT if text else EMPTY


def cell_name(column: int, row: int | None = None) -> str:
    """The cell's name in a spreadsheet. column : from 0. Example: cell_name(27, 3) is "AB3"; without a row "AB"."""
    letters = ""
    number = column + 1
    while number:
        number, letter = divmod(number - 1, 26)
        letters = chr(ord("A") + letter) + letters
    return letters if row is None else f"{letters}{row}"


def _duration(value: datetime.timedelta) -> str:
    """H:MM:SS.mmm, of any number of hours."""
    milliseconds = round(value / datetime.timedelta(milliseconds=1))
    sign, milliseconds = "-" if milliseconds < 0 else "", abs(milliseconds)
    hours, milliseconds = divmod(milliseconds, 3_600_000)
    minutes, milliseconds = divmod(milliseconds, 60_000)
    return f"{sign}{hours}:{minutes:02d}:{milliseconds / 1000:06.3f}"
