"""A sample of a recording of any length, drawn in one pass: the rows of some visits, each with its neighbours.

A group is a row, or the rows of a visit; of a longer visit each `max_rows_of_visit` rows, spread evenly over it, are
one. Of every so many groups one is drawn at random, so that each row is drawn with the same probability.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.columns import scale_columns
from compd.recording.checks import check_rising_time
from compd.table_file import row_count, table_blocks
from compd.tables import FIRST_ROW, ProblemList, Table
from compd.travel_direction import RowDirections

# Rows of a block: with 50 columns of numbers 13 MB.
BLOCK_ROWS = 32_768
# The draw is the same each time, and does not keep step with a motion that repeats.
SEED = 1
_NEEDED = ("scale_", "commanded_", "joint_", "frame_", "model_", "reference_")


@dataclass(frozen=True)
class RecordingSample:
    """What the pass through the whole recording found."""

    row: IntArray  #: (R,) rows that were drawn, as a spreadsheet shows them
    rows: int  #: rows of the recording with a time
    untimed: int  #: rows of the file without a time, or empty
    incomplete: int  #: rows without some number of the machine's or the reference's columns
    begin_s: float  #: begin_s, end_s: time of the first and of the last row
    end_s: float
    gap_rows: int  #: the longest run of rows of which none was drawn
    gap_s: float  #: about the time of such a run; nan without time


@dataclass(frozen=True)
class DrawnRows:
    """The drawn rows of a table with those before and after each.

    sample : None where a block has problems: reading ended there.
    approach : (T, n) directions of travel found from the scales of all rows; None where they are recorded.
    """

    table: Table | None
    problems: ProblemList
    last_row: int = FIRST_ROW - 1
    approach: FloatArray | None = None
    sample: RecordingSample | None = None


def draw_rows(
    path: Path,
    id_columns: Iterable[str],
    most_rows: int,
    max_rows_of_visit: int,
    progress: Callable[[int], None] = lambda rows: None,
) -> DrawnRows:
    """Draw about `most_rows` rows of a table: all where it has no more.

    progress : called with the number of rows that are done, after each block.
    Raises RecordingError for a file that cannot be read.
    """
    count = row_count(path)
    draw = _Draw(max(count / most_rows, 1.0), count, max_rows_of_visit)
    last_row, drawn_table = FIRST_ROW - 1, DrawnRows(None, ProblemList(path))
    for table, problems in table_blocks(path, tuple(id_columns), BLOCK_ROWS):
        if table is None or problems.problems or not draw.add(table, problems):
            return replace(drawn_table, table=table, problems=problems)
        last_row = int(table.row[-1]) if len(table.row) else last_row
        progress(last_row - FIRST_ROW + 1)
        drawn_table = DrawnRows(table, problems, last_row)
    return draw.result(drawn_table)


class _Draw:
    """Draws from the blocks of a table, in their order."""

    def __init__(self, groups_per_draw: float, most_groups: int, max_rows_of_visit: int) -> None:
        stretches = int(most_groups / groups_per_draw) + 1
        within = np.random.default_rng(SEED).random(stretches)
        # of each stretch of groups one
        self._picked = ((np.arange(stretches) + within) * groups_per_draw).astype(np.int64)
        self._max_rows_of_visit = max_rows_of_visit
        self._groups = self._rows = self._incomplete = 0
        self._end_s = -np.inf
        self._tables: list[Table] = []
        self._drawn: list[IntArray] = []
        self._at: list[IntArray] = []
        self._directions = RowDirections()
        self._approach: list[FloatArray] = []

    def add(self, table: Table, problems: ProblemList) -> bool:
        """Draw from the next block; False with a problem in its times."""
        if "time_s" in table.columns:
            check_rising_time(table, self._end_s, problems)
            if problems.problems:
                return False
            timed = ~np.isnan(table.columns["time_s"])
            table = table if timed.all() else table.select(np.flatnonzero(timed))
        count = len(table.row)
        if not count:
            self._tables.append(table)
            return True
        drawn = self._of_block(table.columns.get("visit"), table.columns.get("session"), count)
        # a speed is known from the rows around; those at the ends have theirs in other blocks
        kept = np.unique(np.concatenate([[0], drawn - 1, drawn, drawn + 1, [count - 1]]).clip(0, count - 1))
        self._tables.append(table.select(kept))
        self._drawn.append(table.row[drawn])
        self._at.append(drawn + self._rows)
        self._follow(table, kept)
        self._rows += count
        self._end_s = float(table.columns["time_s"][-1]) if "time_s" in table.columns else self._rows - 1.0
        empty = np.zeros(count, dtype=bool)
        for name, values in table.columns.items():
            if name.startswith(_NEEDED):
                empty |= np.isnan(values)
        self._incomplete += int(empty.sum())
        return True

    def _of_block(self, visit: FloatArray | None, session: FloatArray | None, count: int) -> IntArray:
        """(D,) drawn rows of a block, rising."""
        group, groups = groups_of_rows(visit, session, count, self._max_rows_of_visit)
        first, end = np.searchsorted(self._picked, [self._groups, self._groups + groups])
        picked = np.zeros(groups, dtype=bool)
        picked[self._picked[first:end] - self._groups] = True
        self._groups += groups
        return np.flatnonzero(picked[group])

    def _follow(self, table: Table, kept: IntArray) -> None:
        """Directions of travel depend on all rows before."""
        names = scale_columns(sum(name.startswith("scale_") for name in table.columns))
        scales = [table.columns[name] for name in names if name in table.columns]
        if scales and not any(name.startswith("approach_") for name in table.columns):
            session = table.columns.get("session")
            number = None if session is None else np.nan_to_num(session, nan=-1.0).astype(np.int64)
            self._approach.append(self._directions.of_block(np.column_stack(scales), number)[kept])

    def result(self, last: DrawnRows) -> DrawnRows:
        """All that was drawn. last : of the last block."""
        table = self._tables[0].extended_by(*self._tables[1:])
        if not self._rows:
            return replace(last, table=table)
        at = np.concatenate(self._at)
        gap_rows = int(np.diff(np.concatenate([[-1], at, [self._rows]])).max()) - 1
        gap_s = begin_s = np.nan
        if "time_s" in table.columns:
            time_s = table.columns["time_s"]
            begin_s = float(time_s[0])
            steps_s = np.diff(time_s)[np.diff(table.row) == 1]
            gap_s = gap_rows * float(np.median(steps_s)) if len(steps_s) else np.nan
        sample = RecordingSample(
            row=np.concatenate(self._drawn),
            rows=self._rows,
            untimed=last.last_row - FIRST_ROW + 1 - self._rows,
            incomplete=self._incomplete,
            begin_s=begin_s,
            end_s=self._end_s,
            gap_rows=gap_rows,
            gap_s=gap_s,
        )
        approach = np.concatenate(self._approach) if self._approach else None
        return replace(last, table=table, approach=approach, sample=sample)


def groups_of_rows(
    visit: FloatArray | None, session: FloatArray | None, count: int, max_rows: int
) -> tuple[IntArray, int]:
    """(N,) group of each row, numbered from 0, and the number of groups; a group has at most `max_rows` rows.

    visit, session : (N,), nan where a cell is empty; a row without a visit is a group.
    """
    if visit is None or not count:
        return np.arange(count), count
    begins: BoolArray = np.ones(count, dtype=bool)
    begins[1:] = visit[1:] != visit[:-1]
    if session is not None:
        begins[1:] |= session[1:] != session[:-1]
    begin = np.flatnonzero(begins)
    groups = -(-np.diff(np.append(begin, count)) // max_rows)
    run = np.cumsum(begins) - 1
    first = np.cumsum(groups) - groups
    return first[run] + (np.arange(count) - begin[run]) % groups[run], int(groups.sum())
