"""A Parquet file as columns of numbers with a spreadsheet's row numbers; every wrong column is reported.

The columns are those of the CSV file, and null is the empty cell, as is nan. Row 1 is the header there, so the first
row of values is row 2 here, too.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.errors import Problem, RecordingError
from compd.extras import install_line
from compd.tables.csv_table import plain_numbers
from compd.tables.problem_list import ProblemList, rows_text, values_text
from compd.tables.table import FIRST_ROW, Table, TableBlock, id_codes, id_labels

SUFFIX = ".parquet"
# Column of row labels that pandas writes for selected or sorted rows; ignored, since the rows are in order.
_ROW_LABELS = re.compile(r"__index_level_\d+__")
# Bytes read ahead of each column in a row group as large as the file.
_READ_AHEAD_BYTES = 1 << 18


def arrow_modules(path: Path) -> tuple[Any, Any]:
    """The modules pyarrow and pyarrow.parquet. path : the file that needs them.

    Raises RecordingError if they are not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise RecordingError.of(
            str(path), "is a Parquet file, and pyarrow is not installed", next_step=install_line("parquet")
        ) from error
    return pyarrow, pyarrow.parquet


class ParquetTable:
    """A Parquet file, whole or block by block in constant memory."""

    def __init__(self, path: Path, id_columns: Collection[str] = ()) -> None:
        """Open the file. id_columns : columns that may hold text.

        Raises RecordingError if pyarrow is not installed, and for a file that is no Parquet, or cut off, or has
        columns that are no numbers.
        """
        self._path = path
        arrow, parquet = arrow_modules(path)
        self._types = arrow.types
        try:
            # data read ahead by row groups would be kept to the end of the file
            self._file = parquet.ParquetFile(
                path, pre_buffer=False, buffer_size=_READ_AHEAD_BYTES, page_checksum_verification=True
            )
            fields = [field for field in self._file.schema_arrow if not _ROW_LABELS.fullmatch(field.name)]
            self._schema = arrow.schema(fields)
            self._names: list[str] = self._schema.names
        except OSError as error:
            raise RecordingError(_unreadable(path, error)) from error
        except (ValueError, arrow.ArrowException) as error:  # of a name that is no text, too
            raise RecordingError(_damaged(path)) from error
        self._faults = (OSError, arrow.ArrowException)
        if problems := self._wrong_columns(id_columns):
            raise RecordingError(problems)

    @property
    def row_count(self) -> int:
        """Number of rows in the file, including empty ones."""
        return int(self._file.metadata.num_rows)

    def whole(self, problems: ProblemList) -> Table:
        """All rows; faults go to `problems`. Raises RecordingError for a damaged file."""
        rows = max(self.row_count, 1)
        empty = self._schema.empty_table()
        labels = self._labels()
        return self._block(next(self._batches(rows), empty), FIRST_ROW, labels, problems)

    def blocks(self, rows: int) -> Iterator[TableBlock]:
        """The rows in blocks up to a size, in the order of the file.

        Raises RecordingError for a damaged file.
        """
        labels = self._labels()  # before the rows: the file has a single read position
        first_row = FIRST_ROW
        for batch in self._batches(rows):
            problems = ProblemList(self._path)
            yield TableBlock(self._block(batch, first_row, labels, problems), problems)
            first_row += batch.num_rows
        if first_row == FIRST_ROW:
            problems = ProblemList(self._path)
            yield TableBlock(self.whole(problems), problems)

    def _batches(self, rows: int, names: Sequence[str] | None = None) -> Iterator[Any]:
        try:
            yield from self._file.iter_batches(rows, columns=names or self._names)
        except MemoryError as error:
            raise RecordingError(_too_large(self._path)) from error
        except self._faults as error:
            raise RecordingError(_damaged(self._path)) from error

    def _wrong_columns(self, id_columns: Collection[str]) -> list[Problem]:
        """Report repeated names, and columns that are not numbers."""
        problems = []
        for name in self._names:
            kind = self._schema.types[self._names.index(name)]
            where = f"{self._path}: column {name}"
            if self._names.count(name) > 1:
                problems.append(Problem(where, "two columns of the same name", next_step="rename or delete one"))
            elif not self._is_number(kind) and not (self._is_text(kind) and name in id_columns):
                problems.append(
                    Problem(
                        where,
                        "holds no numbers",
                        value=str(kind),
                        allowed="double, or another type of number; null where nothing was measured",
                        next_step="for time_s write seconds from the start; convert or delete other columns",
                    )
                )
        return list(dict.fromkeys(problems))

    def _is_number(self, kind: Any) -> bool:
        types = self._types
        return bool(types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind) or types.is_null(kind))

    def _is_text(self, kind: Any) -> bool:
        types = self._types
        text = kind.value_type if types.is_dictionary(kind) else kind
        return bool(types.is_string(text) or types.is_large_string(text) or types.is_string_view(text))

    def _labels(self) -> Mapping[str, tuple[str, ...]]:
        """Column of ids -> its different texts in the whole file; only for columns with more than numbers."""
        kinds = zip(self._names, self._schema.types, strict=True)
        names = [name for name, kind in kinds if self._is_text(kind)]
        texts: dict[str, set[str]] = {name: set() for name in names}
        for batch in self._batches(1 << 16, names) if names else ():
            for name in names:
                texts[name].update(_cells(batch.column(name).unique()))
        return {name: id_labels(cells) for name, cells in texts.items() if plain_numbers(sorted(cells)) is None}

    def _block(self, batch: Any, first_row: int, labels: Mapping[str, tuple[str, ...]], problems: ProblemList) -> Table:
        row = np.arange(first_row, first_row + batch.num_rows, dtype=np.int64)
        columns = {name: self._values(batch.column(name), labels.get(name)) for name in self._names}
        filled = np.zeros(len(row), dtype=bool)
        wrong = set()
        for name, values in columns.items():
            filled |= ~np.isnan(values)
            infinite = np.isinf(values)
            if infinite.any():
                wrong.add(name)
                problems.add(
                    f"column {name}, {rows_text(row[infinite].tolist())}",
                    "not a finite number",
                    values_text(f"{value:g}" for value in values[infinite].tolist()),
                    "a number, or null where nothing was measured",
                    "write null",
                )
                columns[name] = np.where(infinite, np.nan, values)
        table = Table(self._path, dict.fromkeys(self._names, ""), columns, row, dict(labels), frozenset(wrong))
        return table if filled.all() else table.select(np.flatnonzero(filled))

    def _values(self, column: Any, labels: Sequence[str] | None) -> FloatArray:
        """(N,) numbers, nan for null; of texts the index among `labels`, where they are more than numbers."""
        if self._is_text(column.type):
            cells = _cells(column)
            if labels is not None:
                return id_codes(cells, labels)
            numbers = plain_numbers(cells)
            assert numbers is not None
            return numbers
        return np.asarray(column.cast("float64", safe=False).to_numpy(zero_copy_only=False), dtype=np.float64)


def _cells(column: Any) -> list[str]:
    return [(cell or "").strip() for cell in column.to_pylist()]


def _unreadable(path: Path, error: OSError) -> Problem:
    what = f"cannot be read: {os.strerror(error.errno) if error.errno else error}"
    return Problem(str(path), what, next_step="give the path of a Parquet file")


def _too_large(path: Path) -> Problem:
    return Problem(
        str(path),
        "needs more memory than there is, or is damaged",
        next_step="divide it into several recordings, or copy it again",
    )


def _damaged(path: Path) -> Problem:
    return Problem(
        str(path),
        "is no Parquet file, or a part of one: its end is missing or damaged",
        next_step="copy or export it again; what `compd recording start` left after a kill is NAME.arrow, see "
        "`compd recording convert`",
    )
