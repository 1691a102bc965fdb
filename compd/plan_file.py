"""The file of a planned measurement: `compd plan` writes it, `compd sim run` and `compd sim campaign` measure it.

CSV with one row per measurement, a header, `.` decimal, UTF-8:

| column | meaning |
|---|---|
| `row`, `purpose` | number from 1, and what the row is for; both for the reader |
| `time_s` | seconds from the start of a programme; a time that does not rise begins a new programme |
| `tip_x_mm`, `tip_y_mm`, `tip_z_mm` | where the tool's tip is to be, in {M} |
| `turn_x_rad`, `turn_y_rad`, `turn_z_rad` | turn since machine zero, a rotation vector in {M}; 0 if left out |
| `<name>_<unit>` | a quantity that is held meanwhile: temperature_room_degC, force_x_N, ... |
| `approach_<i>` | +1/-1: the direction in which link i comes to the place; 0: as it comes |
| `speed_mm_per_s` | speed of the fastest link while it passes the place; 0: at rest |

A plan for a machine of an external model has the columns of its recording that are to be set in place of the tip, the
links and their speed. A person measures it; nothing in compd reads it.
"""

from __future__ import annotations

import csv
import difflib
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from compd.columns import approach_columns
from compd.errors import CompdError, Problem, RecordingError
from compd.files import write_files
from compd.tables import ProblemList, Table, read_table

PURPOSE_COLUMN = "purpose"
TIP_COLUMNS = ("tip_x_mm", "tip_y_mm", "tip_z_mm")
TURN_COLUMNS = ("turn_x_rad", "turn_y_rad", "turn_z_rad")
SPEED_COLUMN = "speed_mm_per_s"
NEEDED_COLUMNS = ("time_s", *TIP_COLUMNS)
# Columns without a setting: time, and text for the reader.
NOT_SET = ("row", PURPOSE_COLUMN, "time_s")
WRITTEN_BY = "`compd plan` writes such a file"


def plan_row(
    purpose: str,
    time_s: float,
    tip_M_mm: Sequence[float],
    quantities: Mapping[str, float],
    approach: Sequence[float],
    speed_mm_per_s: float,
    turns_rad: Mapping[str, float] = MappingProxyType({}),
) -> dict[str, Any]:
    """One row by column, rounded to settable values.

    tip_M_mm : (3,). turns_rad : by TURN_COLUMNS; empty where the attitude is that of machine zero.
    quantities : name with unit -> value to hold. approach : (n,) +1, -1 or 0.
    """
    return {
        PURPOSE_COLUMN: purpose,
        "time_s": round(float(time_s), 1),
        **{name: round(float(value), 3) for name, value in zip(TIP_COLUMNS, tip_M_mm, strict=True)},
        **{name: round(float(value), 6) for name, value in turns_rad.items()},
        **{name: round(float(value), 3) for name, value in quantities.items()},
        **{name: int(sign) for name, sign in zip(approach_columns(len(approach)), approach, strict=True)},
        SPEED_COLUMN: round(float(speed_mm_per_s), 2),
    }


def settings_row(purpose: str, time_s: float, settings: Mapping[str, float]) -> dict[str, Any]:
    """One row for a machine of an external model. settings : column -> value; whole numbers are written as such."""
    numbers = {name: float(value) for name, value in settings.items()}
    return {
        PURPOSE_COLUMN: purpose,
        "time_s": round(float(time_s), 1),
        **{name: int(value) if value.is_integer() else value for name, value in numbers.items()},
    }


def plan_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """The file's text; the first row's keys are the header."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def write_text_file(path: Path, text: str) -> None:
    """Write a plan's text. Raises RecordingError if it cannot be written."""
    try:
        write_files({path: text})
    except OSError as error:
        raise RecordingError.of(str(path), f"cannot be written: {error.strerror}") from error


@dataclass(frozen=True)
class PlanLine:
    """One row of the file.

    line : number in the file, for messages. purpose : "" if none is written.
    values : column -> number, for the columns that the file has; nan where the cell is wrong, and a problem was noted.
    """

    line: int
    purpose: str
    values: Mapping[str, float]


@dataclass(frozen=True)
class PlanFile:
    """header : the columns' names. lines : the rows that are not empty."""

    path: Path
    header: Sequence[str]
    lines: Sequence[PlanLine]


def read_plan_file(
    path: Path, links: int, limits: Mapping[str, tuple[float, float]], problems: list[Problem]
) -> PlanFile:
    """Read a plan for a machine with this many links; faults go to `problems`.

    limits : column -> (lowest, highest) of each quantity that the machine can hold, and of SPEED_COLUMN; other
        columns are refused. Raises CompdError if there is no header that could be read.
    """
    return _PlanFileReader(path, links, limits).read(problems)


class _PlanFileReader:
    """One pass over one file; every problem with its line and column."""

    def __init__(self, path: Path, links: int, limits: Mapping[str, tuple[float, float]]) -> None:
        self._problems = ProblemList(path)
        self._approaches = approach_columns(links)
        self._limits: Mapping[str, tuple[float, float]] = {
            "time_s": (0.0, math.inf),
            **dict.fromkeys(TIP_COLUMNS, (-math.inf, math.inf)),
            **dict.fromkeys(TURN_COLUMNS, (-math.pi, math.pi)),
            **limits,
            **dict.fromkeys(self._approaches, (-1.0, 1.0)),
        }

    def read(self, problems: list[Problem]) -> PlanFile:
        found = self._problems
        table = read_table(
            found.path, found, lambda names: not set(NEEDED_COLUMNS).isdisjoint(names), (PURPOSE_COLUMN,)
        )
        if table is None:
            raise CompdError([replace(problem, next_step=WRITTEN_BY) for problem in found.problems])
        self._check_header(list(table.columns))
        if not len(table.row):
            found.add("", "has no row", allowed="a header and at least one row", next_step=WRITTEN_BY)
        values = {name: self._settings(table, name) for name in table.columns if name in self._limits}
        purposes = table.texts(PURPOSE_COLUMN)
        lines = [
            PlanLine(row, purposes[i], {name: settings[i] for name, settings in values.items()})
            for i, row in enumerate(table.row.tolist())
        ]
        problems += found.problems
        return PlanFile(found.path, list(table.columns), lines)

    def _check_header(self, header: Sequence[str]) -> None:
        names = ("row", PURPOSE_COLUMN, *self._limits)
        for name in header:
            if name not in names:
                close = difflib.get_close_matches(name, names, n=1)
                next_step = f"did you mean {close[0]}?" if close else "delete the column, or plan for another pair"
                what = "is no setting of this machine"
                self._add(f":1 column {name}", what, name, ", ".join(names), next_step)
        for name in NEEDED_COLUMNS:
            if name not in header:
                self._add(f":1 column {name}", "is missing", allowed=", ".join(NEEDED_COLUMNS), next_step=WRITTEN_BY)

    def _settings(self, table: Table, name: str) -> list[float]:
        """The column's numbers; nan where one is not allowed, which is a problem."""
        low, high = self._limits[name]
        allowed = f"{low:g} to {high:g}" if math.isfinite(high) else "a number" if low < 0 else "0 or more"
        allowed = "-1, 0 or 1" if name in self._approaches else allowed
        values: list[float] = table.columns[name].tolist()
        for i, (row, value) in enumerate(zip(table.row.tolist(), values, strict=True)):
            place = f":{row} column {name}"
            if math.isnan(value):
                if name not in table.wrong:
                    self._add(place, "is empty", "", allowed, "write a number")
            elif not low <= value <= high or (name in self._approaches and value not in (-1, 0, 1)):
                too_fast = name == SPEED_COLUMN and value > high
                what = "is faster than this machine's drives" if too_fast else "is out of range"
                self._add(place, what, f"{value:g}", allowed, "change the row, or give `compd plan` the limit")
                values[i] = math.nan
        return values

    def _add(self, place: str, what: str, value: str = "", allowed: str = "", next_step: str = "") -> None:
        where = f"{self._problems.path}{place}"
        self._problems.problems.append(Problem(where, what, value=value, allowed=allowed, next_step=next_step))
