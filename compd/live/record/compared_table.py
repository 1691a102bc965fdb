"""A part's CSV compared with its cycles: both were written of the same messages, and an analysis uses the CSV alone."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from compd.live.record.recording_part import CYCLES_SUFFIX
from compd.live.record.replay import RecordedCycles
from compd.live.record.table_rows import Message, TableRows
from compd.table_file import CSV

# The origin of time_s is known to half of its last decimal; so is each time.
_TIME_S = "time_s"
_SAME_TIME_S = 1.01e-6


class DifferingCell(NamedTuple):
    """A cell of a table that is not what the cycle beside it says.

    where : file, line and column. cell : in the table. recorded : by the cycle; "" for no value.
    """

    where: str
    cell: str
    recorded: str


def differing_cells(recording: RecordedCycles) -> Iterator[DifferingCell]:
    """The cells of all parts' CSV that differ from their cycles, in the order of the files.

    A column that no cycle says anything of is not compared. Raises RecordingError for a damaged cycle.
    """
    for path in recording.paths:
        table = path.with_name(path.name.removesuffix(CYCLES_SUFFIX) + CSV)
        if table.is_file():
            yield from _of_part(table, recording.messages(path))


def _of_part(table: Path, messages: Iterator[tuple[str, Message]]) -> Iterator[DifferingCell]:
    watch: Message | None = None
    rows: TableRows | None = None
    with table.open(encoding="utf-8", errors="replace", newline="") as file:
        lines = csv.reader(line for line in file if line.endswith("\n"))  # a kill leaves a torn one at the end
        header = next(lines, [])
        for _, message in messages:
            if message.get("class") == "WATCH":
                watch = message
            if message.get("class") != "READINGS" or watch is None:
                continue
            if (cells := next(lines, None)) is None:
                return
            where = f"{table}:{lines.line_num}"
            if rows is None:
                rows = TableRows(watch, message, _origin_s(message, header, cells))
            yield from _of_row(where, header, cells, dict(zip(rows.names, rows.row(message), strict=True)))


def _origin_s(message: Message, header: list[str], cells: list[str]) -> float:
    """Monotonic time that is 0 in the column time_s, by the first row; the cycle's own where that has no time."""
    try:
        return float(message[_TIME_S]) - float(cells[header.index(_TIME_S)])
    except (ValueError, IndexError):
        return float(message[_TIME_S])


def _of_row(
    where: str, header: list[str], cells: list[str], recorded: dict[str, float | None]
) -> Iterator[DifferingCell]:
    if len(cells) != len(header):
        yield DifferingCell(where, f"{len(cells)} cells", f"{len(header)}")
    for name, cell in zip(header, cells, strict=False):
        if name in recorded and not _is_same(name, cell, recorded[name]):
            value = recorded[name]
            yield DifferingCell(f"{where}, {name}", cell, "" if value is None else f"{value!r}")


def _is_same(name: str, cell: str, recorded: float | None) -> bool:
    if recorded is None or not cell:
        return recorded is None and not cell
    try:
        value = float(cell)
    except ValueError:
        return False
    return abs(value - recorded) <= _SAME_TIME_S if name == _TIME_S else value == recorded
