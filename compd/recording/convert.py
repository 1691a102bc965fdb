"""A recording in the other format, CSV or Parquet, of any length: the same numbers in the same rows."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from compd.columns import TEXT_ID_COLUMNS, number_text
from compd.errors import Problem, RecordingError
from compd.files import Content
from compd.recording.open_part import ARROW, OpenPart
from compd.recording.parquet_writer import ROW_GROUP_ROWS, arrow_batch, arrow_schema, write_parquet
from compd.recording.writer import write_recording_files
from compd.table_file import CSV, PARQUET, SUFFIXES, row_count, table_blocks, table_path
from compd.tables import FIRST_ROW, Table

# Rows held as text at once: a cell takes 60 bytes then.
_TEXT_ROWS = 4096


def convert_recording(
    source: Path, destination: Path, overwrite: bool = False, progress: Callable[[int], None] = lambda rows: None
) -> int:
    """Write a recording's table in the format that the suffix of `destination` names, with a copy of the sidecar.

    Parameters
    ----------
    source : NAME.csv, NAME.parquet or NAME.yaml; or NAME.arrow, which `compd recording start` left when it was killed.
    destination : .csv or .parquet. Where it differs from the source in the suffix alone, they share the sidecar.
    overwrite : whether existing files are replaced.
    progress : called with the rows that are written so far.

    Every number is the same float in both files, every row has the same number, and the sidecar's text is kept.

    Returns the number of rows, empty ones with the others.

    Raises
    ------
    RecordingError
        For cells that are no numbers, a missing sidecar, existing files without `overwrite`, and a disk that does not
        take the files.
    """
    source = table_path(source)
    sidecar = source.with_suffix(".yaml")
    if problems := _problems(source, sidecar, destination, overwrite):
        raise RecordingError(problems)
    rows = _RowsWritten(progress)
    table = _parquet(source, destination, rows) if destination.suffix == PARQUET else _csv(source, rows)
    copied = destination.with_suffix(".yaml")
    write_recording_files(({} if copied == sidecar else {copied: sidecar.read_bytes()}) | {destination: table})
    return rows.count


def rows_to_convert(source: Path) -> int:
    """Approximate number of rows that `convert_recording` will write. Raises RecordingError for an unreadable file."""
    return OpenPart(source).row_count if source.suffix == ARROW else row_count(source)


class _RowsWritten:
    def __init__(self, progress: Callable[[int], None]) -> None:
        self.count = 0
        self._progress = progress

    def add(self, rows: int) -> None:
        self.count += rows
        self._progress(self.count)


def _problems(source: Path, sidecar: Path, destination: Path, overwrite: bool) -> list[Problem]:
    problems = []
    allowed = {CSV: (PARQUET,), PARQUET: (CSV,), ARROW: (PARQUET,)}.get(source.suffix, SUFFIXES)
    if destination.suffix not in allowed:
        problems.append(
            Problem(
                str(destination),
                f"is no format into which {source.name} can be converted",
                value=destination.suffix,
                allowed=" or ".join(allowed),
                next_step="end the name in this",
            )
        )
    if not sidecar.is_file():
        problems.append(Problem(str(sidecar), "the sidecar is missing", next_step="give a recording with its sidecar"))
    targets = {destination, destination.with_suffix(".yaml")} - {sidecar}
    problems += [
        Problem(str(target), "is there already", next_step="choose another name, or give --overwrite")
        for target in sorted(targets)
        if target.exists() and not overwrite
    ]
    return problems


def _parquet(source: Path, destination: Path, rows: _RowsWritten) -> Content:
    """The writer of the source as Parquet."""
    if source.suffix == ARROW:
        part = OpenPart(source)
        return lambda file: write_parquet(file, destination, part.schema, _counted(part.batches(), rows))
    blocks = _blocks(source)
    first = next(blocks)
    schema = arrow_schema(destination, first.columns, first.labels)

    def batches() -> Iterator[Any]:
        for block in chain([first], blocks):
            texts = {name: _texts(block, name) for name in block.labels}
            yield arrow_batch(destination, schema, {**block.columns, **texts})

    return lambda file: write_parquet(file, destination, schema, _counted(batches(), rows))


def _csv(source: Path, rows: _RowsWritten) -> Content:
    """The writer of the source as CSV."""

    def write(file: BinaryIO) -> None:
        text = io.TextIOWrapper(file, encoding="utf-8", newline="")
        writer = csv.writer(text, lineterminator="\n")
        for i, block in enumerate(_blocks(source)):
            if i == 0:
                writer.writerow(block.columns)
            for begin in range(0, len(block.row), _TEXT_ROWS):
                rows_as_text = slice(begin, begin + _TEXT_ROWS)
                writer.writerows(zip(*(_cells(block, name, rows_as_text) for name in block.columns), strict=True))
            rows.add(len(block.row))
        text.detach()  # flushed, and left open for its opener

    return write


def _counted(batches: Iterable[Any], rows: _RowsWritten) -> Iterator[Any]:
    for batch in batches:
        yield batch
        rows.add(batch.num_rows)


def _blocks(source: Path) -> Iterator[Table]:
    """The table block by block, with the empty rows between others: a row keeps its number.

    Raises RecordingError with what is wrong in a block.
    """
    next_row = FIRST_ROW
    for table, problems in table_blocks(source, TEXT_ID_COLUMNS, ROW_GROUP_ROWS):
        problems.check()
        assert table is not None, "a table without a problem"
        row = np.arange(next_row, table.row[-1] + 1 if len(table.row) else next_row)
        columns = {name: np.full(len(row), np.nan) for name in table.columns}
        for name, values in table.columns.items():
            columns[name][table.row - next_row] = values
        next_row += len(row)
        yield replace(table, row=row, columns=columns)


def _texts(table: Table, name: str, rows: slice = slice(None)) -> list[str | None]:
    """A column of ids that are text."""
    labels = table.labels[name]
    return [None if math.isnan(code) else labels[int(code)] for code in table.columns[name][rows].tolist()]


def _cells(table: Table, name: str, rows: slice) -> Sequence[str | None]:
    """A column's cells in CSV."""
    if name in table.labels:
        return _texts(table, name, rows)
    return [None if math.isnan(value) else number_text(value) for value in table.columns[name][rows].tolist()]
