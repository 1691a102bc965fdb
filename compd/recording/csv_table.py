"""A CSV file as columns of numbers with the rows that a spreadsheet shows; every wrong cell is reported.

Tolerated, because it can mean one thing only: a byte order mark, Windows line ends, spaces around a cell, quotes,
empty rows and columns at the end. Everything else that a spreadsheet may write is refused in words.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.recording.csv_cell import AMBIGUOUS_COMMA, DECIMAL_COMMA, CellFault, fault_of
from compd.recording.csv_grid import IsHeader, read_grid
from compd.recording.problem_list import ProblemList, column_letters, rows_text, values_text

# A file of these alone can be parsed fast: nothing in it can be anything but numbers, commas and line ends.
_PLAIN = b"0123456789eE+-.,\r\n"


@dataclass(frozen=True)
class CsvTable:
    """Columns of one CSV file.

    Attributes
    ----------
    path : the file.
    content : its bytes, for a hash.
    letters : column name -> the letters over it in a spreadsheet, in order.
    columns : name -> (N,) float64, nan where the cell is empty (or was reported as wrong).
    row : (N,) the row as a spreadsheet numbers it; the header is row 1.
    labels : name -> the different texts of a column of ids, in the order of their codes in `columns`.
    blank_rows : empty rows between others; they are not in `columns`.
    wrong : names of columns with cells that were reported as wrong.
    """

    path: Path
    content: bytes
    letters: Mapping[str, str]
    columns: dict[str, FloatArray]
    row: IntArray
    labels: dict[str, tuple[str, ...]] = field(default_factory=dict)
    blank_rows: int = 0
    wrong: frozenset[str] = frozenset()

    def place(self, name: str) -> str:
        """A column for a person: its name and the letters over it."""
        return f"column {name} ({self.letters[name]})" if name in self.letters else f"column {name}"


def read_table(
    path: Path, faults: ProblemList, is_header: IsHeader, id_columns: Collection[str] = ()
) -> CsvTable | None:
    """Read `path`; what is wrong goes to `faults`, and reading goes on as far as it makes sense.

    is_header : whether these cells are the header that is looked for.
    id_columns : columns that may hold text; their cells become codes 0, 1, 2 ... in sorted order.

    Returns None where there is no table at all.
    """
    content = _content(path, faults)
    if content is None:
        return None
    head, _, body = content.removeprefix(b"\xef\xbb\xbf").partition(b"\n")
    names = [name.strip() for name in head.decode("ascii", "replace").split(",")]
    plain = not body.translate(None, _PLAIN) and b'"' not in head and head.isascii() and is_header(names)
    if plain and _names_are_sound(names):
        lines = body.decode("ascii").splitlines()
        if all(line.count(",") == len(names) - 1 or not line for line in lines):
            table = _read_plain(path, content, names, lines)
            if table is not None:
                return table
    return _read_any(path, content, faults, is_header, id_columns)


def _content(path: Path, faults: ProblemList) -> bytes | None:
    try:
        content = path.read_bytes()
    except OSError as error:
        faults.add("", f"cannot be read: {error.strerror}", next_step="give the path of a CSV file")
        return None
    if content.startswith(b"PK\x03\x04"):
        faults.add("", "is a spreadsheet's own file, not CSV", next_step="in the spreadsheet: save as CSV (UTF-8)")
        return None
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        faults.add("", "is written in UTF-16", allowed="UTF-8", next_step="in the spreadsheet: save as CSV (UTF-8)")
        return None
    if not content.strip():
        faults.add("", "is empty", allowed="a header and at least two rows")
        return None
    return content


def _names_are_sound(names: Sequence[str]) -> bool:
    return all(names) and len(set(names)) == len(names)


def _read_plain(path: Path, content: bytes, names: list[str], lines: list[str]) -> CsvTable | None:
    """The fast way; None when a cell is no number after all, so that the slow way can say which."""
    values = _numbers(",".join(filter(None, lines)).split(",")) if any(lines) else np.empty(0)
    if values is None:
        return None
    rows = np.array([number for number, line in enumerate(lines, start=2) if line], dtype=np.int64)
    by_row = values.reshape(len(rows), len(names))
    filled = ~np.isnan(by_row).all(axis=1)
    row = rows[filled]
    blank = int(row[-1] - 1 - len(row)) if len(row) else 0
    columns = {name: np.ascontiguousarray(by_row[filled, i]) for i, name in enumerate(names)}
    letters = {name: column_letters(i) for i, name in enumerate(names)}
    return CsvTable(path, content, letters, columns, row, blank_rows=blank)


def _read_any(
    path: Path, content: bytes, faults: ProblemList, is_header: IsHeader, id_columns: Collection[str]
) -> CsvTable | None:
    """The careful way: every cell as text first."""
    grid = read_grid(content, faults, is_header)
    if grid is None:
        return None
    row = np.array([number for number, _ in grid.rows], dtype=np.int64)
    columns: dict[str, FloatArray] = {}
    labels: dict[str, tuple[str, ...]] = {}
    wrong: set[str] = set()
    commas = _Commas()
    by_column = list(zip(*(cells for _, cells in grid.rows), strict=True))
    for name, index in grid.names.items():
        cells = by_column[index] if by_column else ()
        values = _plain_numbers(cells)
        if values is None and name in id_columns:
            labels[name], values = _codes(cells)
        if values is None:
            place = f"column {name} ({column_letters(index)})"
            values = _checked_numbers(place, cells, row, faults, commas)
            wrong.add(name)
        columns[name] = values
    commas.report(faults)
    letters = {name: column_letters(index) for name, index in grid.names.items()}
    return CsvTable(path, content, letters, columns, row, labels, grid.blank_rows, frozenset(wrong))


def _plain_numbers(cells: Sequence[str]) -> FloatArray | None:
    """The column as numbers; None when any cell is something else."""
    # Python's own conversion is exact, but also takes 1_000, nan and inf
    if "".join(cells).encode("utf-8", "replace").translate(None, _PLAIN):
        return None
    return _numbers(cells)


def _numbers(cells: Sequence[str]) -> FloatArray | None:
    """Cells of nothing but _PLAIN as numbers; None when any is none after all, or not finite."""
    try:
        values = np.array([float(cell) if cell else np.nan for cell in cells], dtype=np.float64)
    except ValueError:
        return None
    return None if np.isinf(values).any() else values


def _codes(cells: Sequence[str]) -> tuple[tuple[str, ...], FloatArray]:
    labels = tuple(sorted({cell for cell in cells if cell}))
    code = {label: float(i) for i, label in enumerate(labels)}
    return labels, np.array([code.get(cell, np.nan) for cell in cells], dtype=np.float64)


class _Commas:
    """Cells with a comma, which come in every column at once: one problem for them all."""

    def __init__(self) -> None:
        self.places: dict[str, None] = {}
        self.rows: set[int] = set()
        self.values: list[str] = []
        self.fault = AMBIGUOUS_COMMA

    def add(self, place: str, fault: CellFault, rows: IntArray, values: Sequence[str]) -> None:
        """One decimal comma for certain decides what the ambiguous ones are."""
        self.places[place] = None
        self.rows.update(rows.tolist())
        self.values += values
        if fault is DECIMAL_COMMA:
            self.fault = fault

    def report(self, faults: ProblemList) -> None:
        if self.places:
            faults.add(
                f"{', '.join(self.places)}, {rows_text(sorted(self.rows))}",
                self.fault.what,
                values_text(self.values),
                self.fault.allowed,
                self.fault.next_step,
            )


def _checked_numbers(
    place: str, cells: Sequence[str], row: IntArray, faults: ProblemList, commas: _Commas
) -> FloatArray:
    """The column's numbers, nan where a cell is wrong; one problem for each kind of wrong cell."""
    values = np.full(len(cells), np.nan)
    wrong: dict[CellFault, list[int]] = {}
    for i, cell in enumerate(cells):
        if not cell:
            continue
        fault = fault_of(cell)
        if fault is None:
            values[i] = float(cell)
        else:
            wrong.setdefault(fault, []).append(i)
    for fault, indices in wrong.items():
        found = [cells[i] for i in indices]
        if fault in (DECIMAL_COMMA, AMBIGUOUS_COMMA):
            commas.add(place, fault, row[indices], found)
        else:
            faults.add(
                f"{place}, {rows_text(row[indices].tolist())}",
                fault.what,
                values_text(found),
                fault.allowed,
                fault.next_step,
            )
    return values
