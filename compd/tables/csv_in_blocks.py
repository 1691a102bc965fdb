"""A CSV file block by block in constant memory: each block as its header with some of its lines."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Collection, Iterator
from pathlib import Path

from compd.errors import RecordingError
from compd.tables.csv_cells import HeaderTest
from compd.tables.csv_table import is_plain, parse_table, plain_numbers
from compd.tables.problem_list import ProblemList
from compd.tables.table import FIRST_ROW, TableBlock, id_labels

_PIECE_BYTES = 1 << 20


def csv_blocks(path: Path, is_header: HeaderTest, id_columns: Collection[str], rows: int) -> Iterator[TableBlock]:
    """The table's rows in blocks of lines; they keep their numbers in the file, also in messages.

    is_header, id_columns : as in `read_table`. Texts have the same codes in every block.
    Raises RecordingError for a file that cannot be read.
    """
    try:
        labels = _labels(path, id_columns)
        with path.open("rb") as file:
            header = file.readline()
            first_row = FIRST_ROW
            while (lines := list(itertools.islice(file, rows))) or first_row == FIRST_ROW:
                content, problems = header + b"".join(lines), ProblemList(path)
                table = parse_table(path, content, problems, is_header, id_columns, first_row, labels)
                yield TableBlock(table, problems)
                if not lines:
                    return
                first_row += len(lines)
    except OSError as error:
        raise _unreadable(path, error) from error


def csv_row_count(path: Path) -> int:
    """Lines under the header. Raises RecordingError for a file that cannot be read."""
    lines, piece = 0, b"\n"
    try:
        with path.open("rb") as file:
            while more := file.read(_PIECE_BYTES):
                piece = more
                lines += piece.count(b"\n")
    except OSError as error:
        raise _unreadable(path, error) from error
    return max(lines + (not piece.endswith(b"\n")) - 1, 0)


def _labels(path: Path, id_columns: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Column of ids -> its different texts in the whole file; only for columns with more than numbers."""
    with path.open("rb") as file:
        names = [name.strip() for name in file.readline().decode("utf-8-sig", "replace").split(",")]
        indices = {name.strip('"'): index for index, name in enumerate(names) if name.strip('"') in id_columns}
        if not indices or all(map(is_plain, iter(lambda: file.read(_PIECE_BYTES), b""))):
            return {}
    texts: dict[str, set[str]] = {name: set() for name in indices}
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as text:
        try:
            for cells in itertools.islice(csv.reader(text), 1, None):
                for name, index in indices.items():
                    texts[name].update(cell.strip() for cell in cells[index : index + 1])
        except csv.Error:
            return {}  # the block with it is refused
    return {name: id_labels(cells) for name, cells in texts.items() if plain_numbers(sorted(cells)) is None}


def _unreadable(path: Path, error: OSError) -> RecordingError:
    return RecordingError.of(str(path), f"cannot be read: {error.strerror}", next_step="give the path of a CSV file")
