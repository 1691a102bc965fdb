"""A CSV file as columns of numbers with a spreadsheet's row numbers; every wrong cell is reported.

Tolerated, because it can mean one thing only: a byte order mark, Windows line ends, spaces around a cell, quotes,
empty rows and columns at the end. Everything else that a spreadsheet may write is refused in words.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray
from compd.tables.csv_cells import (
    AMBIGUOUS_COMMA,
    DECIMAL_COMMA,
    NUMBER_ALLOWED,
    CellProblem,
    CsvCells,
    HeaderTest,
    cell_problem,
    read_cells,
)
from compd.tables.problem_list import ProblemList, column_letters, rows_text, values_text
from compd.tables.table import FIRST_ROW, Table, id_codes, id_labels

# Characters of a file for the fast parser: numbers, commas and line ends only.
_PLAIN = b"0123456789eE+-.,\r\n"
# Fewest cells for pyarrow: Python alone parses fewer in a tenth of a second, the time of importing pyarrow.
_MIN_BYTES_FOR_ARROW = 1 << 20


def read_table(
    path: Path, problems: ProblemList, is_header: HeaderTest, id_columns: Collection[str] = ()
) -> Table | None:
    """Read `path`; faults go to `problems`, and reading goes on as far as possible.

    is_header : whether these cells are the header that is looked for.
    id_columns : columns that may hold text; their cells become codes 0, 1, 2 ... in sorted order.

    Returns None if there is no table at all.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        problems.add("", f"cannot be read: {error.strerror}", next_step="give the path of a CSV file")
        return None
    return parse_table(path, content, problems, is_header, id_columns)


def parse_table(
    path: Path,
    content: bytes,
    problems: ProblemList,
    is_header: HeaderTest,
    id_columns: Collection[str] = (),
    first_row: int = FIRST_ROW,
    labels: Mapping[str, tuple[str, ...]] | None = None,
) -> Table | None:
    """The table in `content`: the whole file `path`, or its header with a block of its lines.

    is_header, id_columns : as in `read_table`.
    first_row : the row that the first line under the header has in the file.
    labels : the texts of columns of ids in the whole file, where `content` is a block of it; None: those of `content`.
    """
    if not _is_text(content, problems):
        return None
    header, _, body = content.removeprefix(b"\xef\xbb\xbf").partition(b"\n")
    names = [_without_quotes(name.strip()) for name in header.decode("ascii", "replace").split(",")]
    plain = is_plain(body) and header.isascii() and not any('"' in name for name in names) and is_header(names)
    if plain and not labels and _names_are_valid(names):
        lines = body.decode("ascii").splitlines()
        if all(line.count(",") == len(names) - 1 or not line for line in lines):
            table = _read_plain(path, names, body, lines, first_row)
            if table is not None:
                return table
    csv_cells = read_cells(content, problems, is_header, first_row)
    return None if csv_cells is None else _read_any(path, csv_cells, problems, id_columns, labels)


def _without_quotes(name: str) -> str:
    """A name without the quotes that many programs write around the header; others unchanged."""
    return name[1:-1].strip() if len(name) > 1 and name[0] == name[-1] == '"' else name


def is_plain(body: bytes) -> bool:
    """Whether the text consists of numbers, commas and line ends, judged by its characters."""
    return not body.translate(None, _PLAIN)


def _is_text(content: bytes, problems: ProblemList) -> bool:
    """Whether it can be text in UTF-8; another kind of file is a problem."""
    if content.startswith(b"PK\x03\x04"):
        problems.add("", "is a spreadsheet's own file, not CSV", next_step="in the spreadsheet: save as CSV (UTF-8)")
        return False
    if content.startswith(b"PAR1"):
        problems.add("", "is a Parquet file, not CSV", next_step="name it NAME.parquet")
        return False
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        problems.add("", "is written in UTF-16", allowed="UTF-8", next_step="in the spreadsheet: save as CSV (UTF-8)")
        return False
    if not content.strip():
        problems.add("", "is empty", allowed="a header and at least two rows")
        return False
    return True


def _names_are_valid(names: Sequence[str]) -> bool:
    """Whether all names are different and not empty."""
    return all(names) and len(set(names)) == len(names)


def _read_plain(path: Path, names: list[str], body: bytes, lines: list[str], first_row: int) -> Table | None:
    """The table of a file of plain numbers, parsed at once. lines : those of `body`.

    None if a cell is no number after all: then `_read_any` reports which.
    """
    number = np.array([number for number, line in enumerate(lines, start=first_row) if line], dtype=np.int64)
    values = _arrow_columns(body, names) if len(body) >= _MIN_BYTES_FOR_ARROW else None
    if values is None or len(values[0]) != len(number):
        cells = _numbers(",".join(filter(None, lines)).split(",")) if len(number) else np.empty(0)
        if cells is None:
            return None
        values = list(cells.reshape(len(number), len(names)).T)
    filled = np.zeros(len(number), dtype=bool)
    for column in values:
        filled |= ~np.isnan(column)
    columns = {name: np.ascontiguousarray(column[filled]) for name, column in zip(names, values, strict=True)}
    letters = {name: column_letters(i) for i, name in enumerate(names)}
    return Table(path, letters, columns, number[filled])


def _arrow_columns(body: bytes, names: list[str]) -> list[FloatArray] | None:
    """The columns of plain lines by Arrow: the same numbers as Python's in a fifth of its time.

    None if it is not installed, and for a cell that it takes for no number, or an infinite one.
    """
    try:
        import pyarrow
        from pyarrow import csv
    except ImportError:
        return None
    kinds = dict.fromkeys(names, pyarrow.float64())
    try:
        table = csv.read_csv(
            pyarrow.py_buffer(body),
            # blocks of a long recording are computed in threads of their own
            read_options=csv.ReadOptions(use_threads=False, column_names=names),
            convert_options=csv.ConvertOptions(column_types=kinds, null_values=[""]),
        )
    except pyarrow.ArrowException:
        return None
    columns = [column.to_numpy() for column in table.columns]
    return None if any(np.isinf(column).any() for column in columns) else columns


def _read_any(
    path: Path,
    csv_cells: CsvCells,
    problems: ProblemList,
    id_columns: Collection[str],
    labels: Mapping[str, tuple[str, ...]] | None,
) -> Table:
    """The table of any other file: cells are read as text, and every wrong one is reported."""
    row = np.array([number for number, _ in csv_cells.rows], dtype=np.int64)
    columns: dict[str, FloatArray] = {}
    own_labels: dict[str, tuple[str, ...]] = {}
    wrong: set[str] = set()
    commas: list[tuple[str, CellProblem, list[int], list[str]]] = []
    cells_by_column = list(zip(*(cells for _, cells in csv_cells.rows), strict=True))
    for name, index in csv_cells.names.items():
        cells = cells_by_column[index] if cells_by_column else ()
        values = None if labels and name in labels else plain_numbers(cells)
        if values is None and name in id_columns:
            own_labels[name] = labels[name] if labels and name in labels else id_labels(cells)
            values = id_codes(cells, own_labels[name])
        if values is None:
            place = f"column {name} ({column_letters(index)})"
            values, kinds = _checked_numbers(cells)
            wrong.add(name)
            for kind, indices in kinds.items():
                of_kind = (row[indices].tolist(), [cells[i] for i in indices])
                if kind in (DECIMAL_COMMA, AMBIGUOUS_COMMA):
                    commas.append((place, kind, *of_kind))
                else:
                    _report([place], kind, *of_kind, problems)
        columns[name] = values
    if commas:  # a spreadsheet writes them in every column; one that is certain decides what the others are
        places, kinds_of_comma, rows, texts = zip(*commas, strict=True)
        kind = DECIMAL_COMMA if DECIMAL_COMMA in kinds_of_comma else AMBIGUOUS_COMMA
        _report(dict.fromkeys(places), kind, sorted(set(chain(*rows))), chain(*texts), problems)
    letters = {name: column_letters(index) for name, index in csv_cells.names.items()}
    return Table(path, letters, columns, row, own_labels, frozenset(wrong))


def plain_numbers(cells: Sequence[str]) -> FloatArray | None:
    """The column as numbers; None if any cell is no number."""
    # Python's own conversion is exact, but also takes 1_000, nan and inf
    if "".join(cells).encode("utf-8", "replace").translate(None, _PLAIN):
        return None
    return _numbers(cells)


def _numbers(cells: Sequence[str]) -> FloatArray | None:
    """Cells of _PLAIN characters as numbers; None if any is no finite number."""
    try:
        values = np.array([float(cell) if cell else np.nan for cell in cells], dtype=np.float64)
    except ValueError:
        return None
    return None if np.isinf(values).any() else values


def _checked_numbers(cells: Sequence[str]) -> tuple[FloatArray, dict[CellProblem, list[int]]]:
    """The column's numbers, nan for wrong cells, and the indices of these by their kind."""
    values = np.full(len(cells), np.nan)
    wrong: dict[CellProblem, list[int]] = {}
    for i, cell in enumerate(cells):
        problem = cell_problem(cell) if cell else None
        if problem is not None:
            wrong.setdefault(problem, []).append(i)
        elif cell:
            values[i] = float(cell)
    return values, wrong


def _report(
    places: Iterable[str], kind: CellProblem, rows: Sequence[int], cells: Iterable[str], problems: ProblemList
) -> None:
    where = f"{', '.join(places)}, {rows_text(rows)}"
    problems.add(where, kind.what, values_text(cells), NUMBER_ALLOWED, kind.next_step)
