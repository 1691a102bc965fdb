"""Excel workbooks (.xlsx): the sheet that holds the list, as a table of text."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from compd.errors import Problem, RecordingError
from compd.instruments.export import ReadOptions
from compd.instruments.formats.workbook.cells import VALUES, Row, SheetReader, cell_name
from compd.instruments.formats.workbook.parts import (
    BROKEN,
    SheetPart,
    check_workbook_file,
    read_sheet_part,
    unreadable,
    why_broken,
)
from compd.instruments.formats.workbook.table import SheetTable, find_table
from compd.instruments.raw_table import RawTable
from compd.instruments.read_limits import ReadLimits

if TYPE_CHECKING:
    from openpyxl import Workbook
    from openpyxl.worksheet._read_only import ReadOnlyWorksheet

# First rows of a sheet that must contain a number for the sheet to count as numeric.
_LOOKED_AT = 2000


def read_workbook(path: Path, options: ReadOptions) -> RawTable:
    """Read the list from a workbook: from the sheet that holds numbers, or from `options.sheet`.

    Formulas count with the value that was computed last. Dates become ISO 8601 text, durations H:MM:SS.

    Raises
    ------
    RecordingError
        For what is no .xlsx, several sheets with numbers, a cell with an error or a formula without a value, another
        header in the middle, merged cells in the list; with every problem that was found.
    """
    check_workbook_file(path, options.limits)
    with warnings.catch_warnings():
        # of what a list does not need: styles, validation, extensions
        warnings.simplefilter("ignore", UserWarning)
        try:
            return _read(path, options)
        except BROKEN as error:
            raise RecordingError(unreadable(path, why_broken(error))) from error


def sheet_names(path: Path, limits: ReadLimits) -> tuple[str, ...]:
    """The names of a workbook's sheets, in their order. Raises RecordingError for what is no .xlsx."""
    check_workbook_file(path, limits)
    try:
        with _opened(path) as book:
            return tuple(sheet.title for sheet in book.worksheets)
    except BROKEN as error:
        raise RecordingError(unreadable(path, why_broken(error))) from error


@contextmanager
def _opened(path: Path, values: bool = True) -> Iterator[Workbook]:
    """The workbook, whatever its file is named. values : of the formulas, in place of their text."""
    from openpyxl import load_workbook

    with path.open("rb") as file:  # of a path the library judges the ending
        book = load_workbook(file, read_only=True, data_only=values)
        try:
            yield book
        finally:
            book.close()


def _read(path: Path, options: ReadOptions) -> RawTable:
    with _opened(path) as book:
        sheet = _choose_sheet(path, book, options.sheet)
        part = read_sheet_part(path, cast(Any, sheet)._worksheet_path)
        reader = SheetReader(path, sheet.title)
        rows = reader.read(sheet)
        count = len(book.worksheets)
    if part.has_formulas:
        with _opened(path, values=False) as book:
            reader.mark_formulas_without_value(book[sheet.title], rows)
    table = find_table(reader.place, rows)
    problems = [*_merged(reader.place, part, table), *reader.wrong_cells(table.rows, options.decimal)]
    if problems:
        raise RecordingError(problems)
    raw = _raw_table(path, table, reader, f"{sheet.title!r}, of {count}" if count > 1 else f"{sheet.title!r}")
    return replace(raw, assumed={**raw.assumed, **_hidden_rows(part, table)})


def _choose_sheet(path: Path, book: Workbook, wanted: str | None) -> ReadOnlyWorksheet:
    """The sheet with numbers, or the one that is wanted. Raises RecordingError if it is not clear which."""
    sheets = {sheet.title: sheet for sheet in book.worksheets}
    if wanted is not None:
        if wanted not in sheets:
            raise RecordingError.of(str(path), "has no such sheet", value=wanted, allowed=", ".join(sheets))
        return sheets[wanted]
    with_numbers = [title for title, sheet in sheets.items() if SheetReader(path, title).has_number(sheet, _LOOKED_AT)]
    if len(with_numbers) == 1:
        return sheets[with_numbers[0]]
    what = f"{len(with_numbers)} sheets hold numbers" if with_numbers else "no sheet holds a number"
    raise RecordingError.of(
        str(path),
        what,
        value=", ".join(with_numbers or sheets),
        allowed="one",
        next_step="say which with --sheet" if with_numbers else "export the list again",
    )


def _merged(place: str, part: SheetPart, table: SheetTable) -> list[Problem]:
    """A problem for cells of the list that are merged: all but the first of them are empty, and mean something."""
    first, last = table.rows[0].number, table.rows[-1].number
    inside = [area for area in part.merged if area.last_row >= first and area.first_row <= last]
    if not inside:
        return []
    return [
        Problem(
            f"{place}, {', '.join(area.name for area in inside[:5])}",
            f"{len(inside)} merged cells in the list",
            allowed="a value in each cell",
            next_step="undo the merging, and fill the cells",
        )
    ]


def _hidden_rows(part: SheetPart, table: SheetTable) -> dict[str, str]:
    """What is said of rows of the list that a person does not see in a spreadsheet."""
    hidden = sorted(part.hidden & {row.number for row in table.rows})
    if not hidden:
        return {}
    rows = f"row {hidden[0]} is" if len(hidden) == 1 else f"{len(hidden)} rows between {hidden[0]} and {hidden[-1]} are"
    what = "hidden, by a filter or by hand, and used as the others: delete them where they are not to count"
    return {"hidden rows": f"{rows} {what}"}


def _raw_table(path: Path, table: SheetTable, reader: SheetReader, sheet: str) -> RawTable:
    filled = sorted({column for row in table.rows for column, kind in enumerate(row.kinds) if kind})
    named = [column for column, name in enumerate(table.header or ()) if name]
    columns = sorted({*filled, *named})
    assumed = {"sheet": sheet, **table.assumed}
    if columns:
        assumed["columns"] = f"{cell_name(columns[0])} to {cell_name(columns[-1])}"
    if reader.dates:
        assumed["dates"] = "cells with a date or a time of day, to the millisecond"
    values = sum(any(kind in VALUES for kind in row.kinds) for row in table.rows)
    if values < len(table.rows):
        assumed["rows without a number"] = str(len(table.rows) - values)
    header = table.header
    return RawTable(
        path=path,
        shape="xlsx",
        columns=[[_text(row, column) for row in table.rows] for column in columns],
        line=np.array([row.number for row in table.rows]),
        header=None if header is None else tuple((header[k] if k < len(header) else "") for k in columns),
        header_line=table.header_row,
        assumed=assumed,
        left_out=table.left_out,
    )


def _text(row: Row, column: int) -> str:
    return row.texts[column] if column < len(row.texts) else ""
