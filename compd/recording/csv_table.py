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
from compd.recording.csv_cells import (
    AMBIGUOUS_COMMA,
    DECIMAL_COMMA,
    CellProblem,
    HeaderTest,
    cell_problem,
    read_cells,
)
from compd.recording.problem_list import ProblemList, column_letters, rows_text, values_text

# A file of these alone can be parsed fast: nothing in it can be anything but numbers, commas and line ends.
_PLAIN = b"0123456789eE+-.,\r\n"


@dataclass(frozen=True)
class CsvTable:
    """Columns of numbers of one CSV file.

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
    path: Path, problems: ProblemList, is_header: HeaderTest, id_columns: Collection[str] = ()
) -> CsvTable | None:
    """Read `path`; what is wrong goes to `problems`, and reading goes on as far as it makes sense.

    is_header : whether these cells are the header that is looked for.
    id_columns : columns that may hold text; their cells become codes 0, 1, 2 ... in sorted order.

    Returns None where there is no table at all.
    """
    content = _content(path, problems)
    if content is None:
        return None
    header, _, body = content.removeprefix(b"\xef\xbb\xbf").partition(b"\n")
    names = [name.strip() for name in header.decode("ascii", "replace").split(",")]
    plain = not body.translate(None, _PLAIN) and b'"' not in header and header.isascii() and is_header(names)
    if plain and _names_are_valid(names):
        lines = body.decode("ascii").splitlines()
        if all(line.count(",") == len(names) - 1 or not line for line in lines):
            table = _read_plain(path, content, names, lines)
            if table is not None:
                return table
    return _read_any(path, content, problems, is_header, id_columns)


def _content(path: Path, problems: ProblemList) -> bytes | None:
    """The file's bytes; None where it cannot be read, or is of another kind than text in UTF-8."""
    try:
        content = path.read_bytes()
    except OSError as error:
        problems.add("", f"cannot be read: {error.strerror}", next_step="give the path of a CSV file")
        return None
    if content.startswith(b"PK\x03\x04"):
        problems.add("", "is a spreadsheet's own file, not CSV", next_step="in the spreadsheet: save as CSV (UTF-8)")
        return None
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        problems.add("", "is written in UTF-16", allowed="UTF-8", next_step="in the spreadsheet: save as CSV (UTF-8)")
        return None
    if not content.strip():
        problems.add("", "is empty", allowed="a header and at least two rows")
        return None
    return content


def _names_are_valid(names: Sequence[str]) -> bool:
    """Whether no name is empty and none comes twice."""
    return all(names) and len(set(names)) == len(names)


def _read_plain(path: Path, content: bytes, names: list[str], lines: list[str]) -> CsvTable | None:
    """The table of a file that is nothing but plain numbers, parsed at once.

    None where a cell is no number after all: then `_read_any` reports which.
    """
    values = _numbers(",".join(filter(None, lines)).split(",")) if any(lines) else np.empty(0)
    if values is None:
        return None
    rows = np.array([number for number, line in enumerate(lines, start=2) if line], dtype=np.int64)
    table = values.reshape(len(rows), len(names))
    filled = ~np.isnan(table).all(axis=1)
    row = rows[filled]
    blank_rows = int(row[-1] - 1 - len(row)) if len(row) else 0
    columns = {name: np.ascontiguousarray(table[filled, i]) for i, name in enumerate(names)}
    letters = {name: column_letters(i) for i, name in enumerate(names)}
    return CsvTable(path, content, letters, columns, row, blank_rows=blank_rows)


def _read_any(
    path: Path, content: bytes, problems: ProblemList, is_header: HeaderTest, id_columns: Collection[str]
) -> CsvTable | None:
    """The table of any other file: every cell is read as text first, and every wrong one reported."""
    csv_cells = read_cells(content, problems, is_header)
    if csv_cells is None:
        return None
    row = np.array([number for number, _ in csv_cells.rows], dtype=np.int64)
    columns: dict[str, FloatArray] = {}
    labels: dict[str, tuple[str, ...]] = {}
    wrong: set[str] = set()
    commas = _CommaCells()
    cells_by_column = list(zip(*(cells for _, cells in csv_cells.rows), strict=True))
    for name, index in csv_cells.names.items():
        cells = cells_by_column[index] if cells_by_column else ()
        values = _plain_numbers(cells)
        if values is None and name in id_columns:
            labels[name], values = _codes(cells)
        if values is None:
            place = f"column {name} ({column_letters(index)})"
            values = _checked_numbers(place, cells, row, problems, commas)
            wrong.add(name)
        columns[name] = values
    commas.report(problems)
    letters = {name: column_letters(index) for name, index in csv_cells.names.items()}
    return CsvTable(path, content, letters, columns, row, labels, csv_cells.blank_rows, frozenset(wrong))


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
    """The different texts in sorted order, and each cell's index among them, nan where it is empty."""
    labels = tuple(sorted({cell for cell in cells if cell}))
    code = {label: float(i) for i, label in enumerate(labels)}
    return labels, np.array([code.get(cell, np.nan) for cell in cells], dtype=np.float64)


class _CommaCells:
    """Cells with a decimal comma. A spreadsheet writes it in every column, so one problem names them all."""

    def __init__(self) -> None:
        self.places: dict[str, None] = {}
        self.rows: set[int] = set()
        self.values: list[str] = []
        self.problem = AMBIGUOUS_COMMA

    def add(self, place: str, problem: CellProblem, rows: IntArray, values: Sequence[str]) -> None:
        """Note cells of one column. One certain decimal comma decides what the ambiguous commas are."""
        self.places[place] = None
        self.rows.update(rows.tolist())
        self.values += values
        if problem is DECIMAL_COMMA:
            self.problem = problem

    def report(self, problems: ProblemList) -> None:
        """Add the one problem, if there is any such cell."""
        if self.places:
            problems.add(
                f"{', '.join(self.places)}, {rows_text(sorted(self.rows))}",
                self.problem.what,
                values_text(self.values),
                self.problem.allowed,
                self.problem.next_step,
            )


def _checked_numbers(
    place: str, cells: Sequence[str], row: IntArray, problems: ProblemList, commas: _CommaCells
) -> FloatArray:
    """The column's numbers, nan where a cell is wrong; one problem for each kind of wrong cell."""
    values = np.full(len(cells), np.nan)
    wrong: dict[CellProblem, list[int]] = {}
    for i, cell in enumerate(cells):
        if not cell:
            continue
        problem = cell_problem(cell)
        if problem is None:
            values[i] = float(cell)
        else:
            wrong.setdefault(problem, []).append(i)
    for problem, indices in wrong.items():
        wrong_cells = [cells[i] for i in indices]
        if problem in (DECIMAL_COMMA, AMBIGUOUS_COMMA):
            commas.add(place, problem, row[indices], wrong_cells)
        else:
            problems.add(
                f"{place}, {rows_text(row[indices].tolist())}",
                problem.what,
                values_text(wrong_cells),
                problem.allowed,
                problem.next_step,
            )
    return values
