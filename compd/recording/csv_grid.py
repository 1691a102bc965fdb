"""The cells of a CSV file as text, under their header: what a spreadsheet's export got wrong in its shape."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from compd.recording.csv_cell import fault_of
from compd.recording.problem_list import ProblemList, column_letters, rows_text, values_text

Row = tuple[int, list[str]]
IsHeader = Callable[[Sequence[str]], bool]

# How far down a header may hide under title rows before it is called missing.
_HEADER_WITHIN = 20


class Grid(NamedTuple):
    """names : column name -> index. rows : (spreadsheet row, stripped cells), each as wide as the header;
    empty rows are left out. blank_rows : how many of those stood between others."""

    names: Mapping[str, int]
    rows: Sequence[Row]
    blank_rows: int


def read_grid(content: bytes, faults: ProblemList, is_header: IsHeader) -> Grid | None:
    """Cells of the CSV file `content`; what is wrong goes to `faults`. None where no header can be found."""
    numbered = _rows(_decoded(content, faults), faults)
    header = _find_header(numbered, faults, is_header)
    if header is None:
        return None
    number, head = numbered[header]
    names = _names(head, numbered[header + 1 :], faults)
    below = [(row, cells) for row, cells in numbered[header + 1 :] if any(cells)]
    blank_rows = below[-1][0] - number - len(below) if below else 0
    if below and _is_units_row(below):
        faults.add(
            f"row {below[0][0]}",
            "units or text under the header",
            values_text(filter(None, below[0][1])),
            "the unit at the end of each column's name",
            "delete the row",
        )
        below = below[1:]
    return Grid(names, _full_rows(below, len(head), faults), blank_rows)


def _decoded(content: bytes, faults: ProblemList) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = content.count(b"\n", 0, error.start) + 1
        faults.add(
            f"row {row}",
            "not UTF-8",
            repr(content[error.start : error.end]),
            "UTF-8",
            "in the spreadsheet: save as CSV (UTF-8)",
        )
        return content.decode("cp1252", "replace")


def _rows(text: str, faults: ProblemList) -> list[Row]:
    """(spreadsheet row, stripped cells) of every line; a separator other than a comma is reported once."""
    head = text.split("\n", 1)[0]
    separator = max(",;\t", key=head.count)
    if separator != ",":
        name = "semicolons" if separator == ";" else "tabs"
        faults.add(
            "",
            f"columns are separated by {name}",
            head[:40],
            "commas",
            "export again as CSV with `,` between columns and `.` as the decimal mark",
        )
    rows: list[Row] = []
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    try:
        for number, cells in enumerate(reader, start=1):
            rows.append((number, [cell.strip() for cell in cells]))
    except csv.Error as error:
        faults.add(f"line {reader.line_num}", f"not CSV: {error}", next_step="mend the quotes in and above this line")
    return rows


def _find_header(rows: Sequence[Row], faults: ProblemList, is_header: IsHeader) -> int | None:
    """Index of the header in `rows`; its being elsewhere than in row 1, or nowhere, is reported."""
    for index, (number, cells) in enumerate(rows[:_HEADER_WITHIN]):
        if is_header(cells):
            if index:
                faults.add(
                    f"row {number}",
                    "the header is not in row 1",
                    allowed="the header in row 1",
                    next_step=f"delete {rows_text([n for n, _ in rows[:index]])}",
                )
            return index
    if rows and all(fault_of(cell) is None for cell in rows[0][1] if cell):
        faults.add(
            "row 1",
            "numbers where the header belongs",
            values_text(rows[0][1]),
            "column names in row 1",
            "add a header row",
        )
        return None
    return 0 if rows else None


def _names(head: Sequence[str], below: Sequence[Row], faults: ProblemList) -> dict[str, int]:
    """Column name -> index; nameless columns that hold something and repeated names are reported."""
    names: dict[str, int] = {}
    for index, name in enumerate(head):
        if not name:
            used = [number for number, cells in below if index < len(cells) and cells[index]]
            if used:
                faults.add(
                    f"column {column_letters(index)}, {rows_text(used)}",
                    "cells under no name",
                    next_step="name the column in row 1, or empty it",
                )
        elif name in names:
            both = f"{column_letters(names[name])} and {column_letters(index)}"
            faults.add(f"columns {both}", "two columns of the same name", name, next_step="rename or delete one")
        else:
            names[name] = index
    return names


def _is_units_row(rows: Sequence[Row]) -> bool:
    """Two words or more, nothing with a digit but a name's, and numbers below."""
    filled = [cell for cell in rows[0][1] if cell]
    words = sum(not any(c.isdigit() for c in cell) and any(c.isalpha() or c == "%" for c in cell) for cell in filled)
    below = [cell for _, cells in rows[1:2] for cell in cells if cell]
    digits = sum(any(c.isdigit() for c in cell) for cell in below)
    return words >= 2 and words * 2 >= len(filled) and (not below or digits * 2 > len(below))


def _full_rows(rows: Sequence[Row], width: int, faults: ProblemList) -> Sequence[Row]:
    """Rows padded or cut to the header's width; too few cells, or filled ones beyond the header, are reported."""
    short = [(number, len(cells)) for number, cells in rows if len(cells) < width]
    long = [(number, len(cells)) for number, cells in rows if any(cells[width:])]
    for wrong, what in ((short, "fewer cells than the header"), (long, "more cells than the header")):
        if wrong:
            faults.add(
                rows_text([number for number, _ in wrong]),
                what,
                values_text(f"{count} cells" for _, count in wrong),
                f"{width} cells",
                "complete the row, or delete it; a decimal comma also makes cells",
            )
    for _, cells in rows:
        cells[width:] = [""] * (width - len(cells))
    return rows
