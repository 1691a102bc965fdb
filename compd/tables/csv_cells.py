"""The cells of a CSV file as text under their header, and faults of a spreadsheet's export in them."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from compd.files import without_values
from compd.tables.problem_list import ProblemList, column_letters, rows_text, values_text
from compd.tables.table import FIRST_ROW

# (spreadsheet row, stripped cells)
Row = tuple[int, list[str]]
HeaderTest = Callable[[Sequence[str]], bool]

NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
# Most title rows above a header; further down it counts as missing.
_HEADER_WITHIN = 20


class CellProblem(NamedTuple):
    """A kind of wrong cell: the pattern of all of it, the fault, the next step."""

    pattern: str
    what: str
    next_step: str


NUMBER_ALLOWED = "a number with a decimal point, or an empty cell where nothing was measured"
AMBIGUOUS_COMMA = CellProblem(
    r"[+-]?\d{1,3},\d{3}",
    "a comma that may be a decimal or a thousands mark",
    "export again with `.` as the decimal mark and no thousands separator",
)
DECIMAL_COMMA = CellProblem(
    r"[+-]?\d*,\d+(?:e[+-]?\d+)?|[+-]?\d{1,3}(?:\.\d{3})+,\d+",
    "decimal comma",
    "export again with `.` as the decimal mark (a spreadsheet's English locale)",
)
_NOT_FINITE = CellProblem(r"[+-]?(?:inf|infinity)", "not a finite number", "empty the cell")
# The first pattern that matches the whole cell decides.
_KINDS = (
    CellProblem(r"#[A-Z0-9/_ ]+[!?]?|#+|err:\d+", "a spreadsheet's error", "mend the formula, or empty the cell"),
    CellProblem(
        r"[-\u2013\u2014?*/.]+|n\.?\s?[/.]?\s?a\.?|nan|null|none|nil|missing|empty",
        "a word or sign for a missing value",
        "empty the cell",
    ),
    _NOT_FINITE,
    CellProblem(
        r"[\u2212\u2013\u2014]\s*\d.*",
        "a typographic minus (U+2212 or a dash)",
        "write the minus of the keyboard, `-`",
    ),
    CellProblem(
        r"\d{1,4}([-/.])\d{1,2}\1\d{1,4}.*|\d{1,3}:\d{2}(?::\d{2}.*)?",
        "a date or a time of day",
        "for time_s write seconds from the start, e.g. =(A2-A$2)*86400; elsewhere give the column a number format",
    ),
    AMBIGUOUS_COMMA,
    DECIMAL_COMMA,
    CellProblem(
        r"[+-]?\d{1,3}(?:[,' \u00a0\u2009\u202f\u2019]\d{3})+(?:[.,]\d*)?|[+-]?\d{1,3}(?:\.\d{3}){2,}",
        "thousands separator",
        "export again with a number format without thousands separator",
    ),
    CellProblem(
        r"[+-]?\d+(?:[.,]\d+)?\s*[^\d\s.,:/-][^\d]*",
        "a unit behind the number",
        "write the unit once, at the end of the column's name",
    ),
    CellProblem(r"(?s:.*)", "text where a number belongs", "write the number, or empty the cell"),
)


def cell_problem(cell: str) -> CellProblem | None:
    """The fault of a stripped, non-empty cell of a number column; None for a finite number."""
    if NUMBER.fullmatch(cell):
        return _NOT_FINITE if abs(float(cell)) == float("inf") else None
    return next(kind for kind in _KINDS if re.fullmatch(kind.pattern, cell, re.IGNORECASE))


class CsvCells(NamedTuple):
    """The cells under a header."""

    names: Mapping[str, int]  #: column name -> index of its cells in a row
    rows: Sequence[Row]  #: each as wide as the header; empty rows are left out


def read_cells(content: bytes, problems: ProblemList, is_header: HeaderTest, first_row: int) -> CsvCells | None:
    """Cells of the CSV file `content`; faults go to `problems`. None without a header.

    first_row : the row that the first line under the header has in the file; more than 2 in a block of a file.

    Nothing of a file without a header is quoted: it is another file than was meant.
    """
    rows_before = first_row - FIRST_ROW
    found = ProblemList(problems.path)
    all_rows = _rows(_decode(content, found, rows_before), found, rows_before)
    header_index = _find_header(all_rows, found, is_header)
    if header_index is None:
        problems.problems += without_values(found.problems)
        return None
    problems.problems += found.problems
    header = all_rows[header_index][1]
    names = _column_names(header, all_rows[header_index + 1 :], problems)
    rows = [(row, cells) for row, cells in all_rows[header_index + 1 :] if any(cells)]
    if rows and not rows_before and _is_units_row(rows):
        problems.add(
            f"row {rows[0][0]}",
            "units or text under the header",
            values_text(filter(None, rows[0][1])),
            "the unit at the end of each column's name",
            "delete the row",
        )
        rows = rows[1:]
    return CsvCells(names, _fit_to_header(rows, len(header), problems))


def _decode(content: bytes, problems: ProblemList, rows_before: int) -> str:
    """The text; bytes that are not UTF-8 are reported and read as Windows-1252, a spreadsheet's usual encoding."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = content.count(b"\n", 0, error.start) + 1
        row += rows_before * (row > 1)
        problems.add(
            f"row {row}",
            "not UTF-8",
            repr(content[error.start : error.end]),
            "UTF-8",
            "in the spreadsheet: save as CSV (UTF-8)",
        )
        return content.decode("cp1252", "replace")


def _rows(text: str, problems: ProblemList, rows_before: int) -> list[Row]:
    """Every line; a separator other than a comma is reported once."""
    first_line = text.split("\n", 1)[0]
    separator = max(",;\t", key=first_line.count)
    if separator != ",":
        name = "semicolons" if separator == ";" else "tabs"
        problems.add(
            "",
            f"columns are separated by {name}",
            first_line[:40],
            "commas",
            "export again as CSV with `,` between columns and `.` as the decimal mark",
        )
    rows: list[Row] = []
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    try:
        for number, cells in enumerate(reader, start=1):
            rows.append((number + rows_before * (number > 1), [cell.strip() for cell in cells]))
    except csv.Error as error:
        problems.add(
            f"line {reader.line_num + rows_before}",
            f"not CSV: {error}",
            next_step="mend the quotes in and above this line",
        )
    return rows


def _find_header(rows: Sequence[Row], problems: ProblemList, is_header: HeaderTest) -> int | None:
    """Index of the header in `rows`; a header below row 1, or a missing one, is reported."""
    for index, (number, cells) in enumerate(rows[:_HEADER_WITHIN]):
        if is_header(cells):
            if index:
                problems.add(
                    f"row {number}",
                    "the header is not in row 1",
                    allowed="the header in row 1",
                    next_step=f"delete {rows_text([row for row, _ in rows[:index]])}",
                )
            return index
    if rows and all(cell_problem(cell) is None for cell in rows[0][1] if cell):
        problems.add(
            "row 1",
            "numbers where the header belongs",
            "",
            "column names in row 1",
            "add a header row",
        )
    elif rows:
        problems.add(
            "row 1",
            "is not the header of such a table",
            "",
            "column names in row 1",
            "give another file, or add the header row",
        )
    return None


def _column_names(header: Sequence[str], rows: Sequence[Row], problems: ProblemList) -> dict[str, int]:
    """Column name -> index; filled cells under no name and repeated names are reported."""
    names: dict[str, int] = {}
    for index, name in enumerate(header):
        if not name:
            filled_rows = [number for number, cells in rows if index < len(cells) and cells[index]]
            if filled_rows:
                problems.add(
                    f"column {column_letters(index)}, {rows_text(filled_rows)}",
                    "cells under no name",
                    next_step="name the column in row 1, or empty it",
                )
        elif name in names:
            both = f"{column_letters(names[name])} and {column_letters(index)}"
            problems.add(f"columns {both}", "two columns of the same name", name, next_step="rename or delete one")
        else:
            names[name] = index
    return names


def _is_units_row(rows: Sequence[Row]) -> bool:
    """Whether the first row holds units: two words or more, half of its cells or more, and numbers in the next row."""
    filled = [cell for cell in rows[0][1] if cell]
    words = sum(not any(c.isdigit() for c in cell) and any(c.isalpha() or c == "%" for c in cell) for cell in filled)
    next_cells = [cell for _, cells in rows[1:2] for cell in cells if cell]
    with_digits = sum(any(c.isdigit() for c in cell) for cell in next_cells)
    return words >= 2 and words * 2 >= len(filled) and (not next_cells or with_digits * 2 > len(next_cells))


def _fit_to_header(rows: Sequence[Row], width: int, problems: ProblemList) -> Sequence[Row]:
    """Rows padded or cut to the header's width; too few cells, or filled ones beyond the header, are reported."""
    short = [(number, len(cells)) for number, cells in rows if len(cells) < width]
    long = [(number, len(cells)) for number, cells in rows if any(cells[width:])]
    for wrong, what in ((short, "fewer cells than the header"), (long, "more cells than the header")):
        if wrong:
            problems.add(
                rows_text([number for number, _ in wrong]),
                what,
                values_text(f"{count} cells" for _, count in wrong),
                f"{width} cells",
                "complete the row, or delete it; a decimal comma also makes cells",
            )
    for _, cells in rows:
        cells[width:] = [""] * (width - len(cells))
    return rows
