"""A reference instrument's own export: a time column, and x, y, z or one length; its own clock, rate and names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray
from compd.errors import RecordingError
from compd.recording.columns import AXES
from compd.recording.csv_cells import NUMBER
from compd.recording.csv_table import CsvTable, read_table
from compd.recording.problem_list import ProblemList, rows_text
from compd.units import UNIT_KINDS, unit_factor

LENGTH = "length"
TIME = "time"
_LENGTH_UNITS, _TIME_UNITS = frozenset(UNIT_KINDS[0]), frozenset(UNIT_KINDS[1])
_TIME_NAME = re.compile(r"(?:.*_)?(?:t|time|timestamp|elapsed|seconds)")
_AXIS_NAME = re.compile(r"(?:.*_)?([xyz])")
_LENGTH_NAME = re.compile(r"(?:.*_)?(?:length|distance|displacement|position|l|d)(?:_\d+)?|.*link_\d+")


@dataclass(frozen=True)
class Track:
    """The positions or lengths that an instrument measured, sample by sample.

    Attributes
    ----------
    path : the export. time_s : (M,) on the instrument's clock, strictly rising.
    position_mm : (M, d) on `axes`: a subset of "x", "y", "z", or "length" alone.
    names : role -> the export's column, for a person.
    left_out : rows with an empty cell.
    """

    path: Path
    time_s: FloatArray
    position_mm: FloatArray
    axes: tuple[str, ...]
    names: Mapping[str, str]
    left_out: int

    @property
    def period_s(self) -> float:
        """Median time between two samples."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def noise_mm(self) -> float:
        """Standard deviation per axis, robustly, from each sample against the mean of its two neighbours.

        Steady motion cancels in that difference, and white noise of variance sigma^2 gives it 3/2 sigma^2.
        """
        middle = self.position_mm[1:-1] - (self.position_mm[2:] + self.position_mm[:-2]) / 2.0
        # 1.4826 = 1 / 0.6745: the median absolute deviation of a normal distribution
        return float(1.4826 * np.median(np.abs(middle)) / np.sqrt(1.5))

    def position_at(self, time_s: FloatArray) -> FloatArray:
        """(N, d) position at times of the instrument's clock, linear between samples, held beyond the ends."""
        return np.column_stack([np.interp(time_s, self.time_s, column) for column in self.position_mm.T])


def read_track(path: Path, names: Mapping[str, str], unit: str | None = None) -> Track:
    """Read an export. Raises RecordingError with every problem.

    names : role ("time", "x", "y", "z", "length") -> column; other roles are guessed from names and units, but not
        x, y, z and length where any of these is in `names`.
    unit : of the lengths, where the columns' names do not end in one.
    """
    problems = ProblemList(path)
    table = read_table(path, problems, _is_header)
    if table is None:
        raise RecordingError(problems.problems)
    column_of = _assign_roles(table, names, problems)
    values_of = {role: _to_s_or_mm(table, name, role, unit, problems) for role, name in column_of.items()}
    if problems.problems:
        raise RecordingError(problems.problems)
    axes = tuple(role for role in (*AXES, LENGTH) if role in column_of)
    values = np.column_stack([values_of[TIME], *(values_of[axis] for axis in axes)])
    complete = ~np.isnan(values).any(axis=1)
    _check_time(table, column_of[TIME], problems)
    if complete.sum() < 3:
        problems.add("", f"{int(complete.sum())} rows have a time and {', '.join(axes)}", allowed="three rows or more")
    if problems.problems:
        raise RecordingError(problems.problems)
    return Track(path, values[complete, 0], values[complete, 1:], axes, column_of, int((~complete).sum()))


def _is_header(cells: Sequence[str]) -> bool:
    """Whether these cells are names: two or more, and no number among them."""
    filled = [cell for cell in cells if cell]
    return len(filled) >= 2 and not any(NUMBER.fullmatch(cell) for cell in filled)


def _split_name(name: str) -> tuple[str, str]:
    """A name as (stem, unit): "Tracker X [mm]" -> ("tracker_x", "mm"); the unit is "" where none is known."""
    tidy = re.sub(r"[^A-Za-z0-9]+", "_", name.replace("\u00b5", "u").replace("\u03bc", "u")).strip("_")
    stem, _, last = tidy.rpartition("_")
    if stem and last in _LENGTH_UNITS | _TIME_UNITS:
        return stem.lower(), last
    return tidy.lower(), ""


def _assign_roles(table: CsvTable, names: Mapping[str, str], problems: ProblemList) -> dict[str, str]:
    """Role -> column: those that a person named, the rest guessed; missing and ambiguous columns are reported."""
    columns = ", ".join(table.letters)
    for role, name in names.items():
        if name not in table.letters:
            problems.add("", f"has no column for {role}", name, columns, f"name one with --{role}")
    column_of = {role: name for role, name in names.items() if name in table.letters}
    guesses = _guesses(table.letters)
    wanted = [TIME, *((*AXES, LENGTH) if not set(names) - {TIME} else ())]
    if any(axis in guesses for axis in AXES):
        wanted = [role for role in wanted if role != LENGTH]
    for role in wanted:
        columns_like = guesses.get(role, [])
        if role not in names and len(columns_like) == 1:
            column_of[role] = columns_like[0]
        elif role not in names and columns_like:
            problems.add(
                "",
                f"{len(columns_like)} columns may be {role}",
                ", ".join(columns_like),
                "one",
                f"name it with --{role}",
            )
    if TIME not in names and TIME not in guesses:
        problems.add("", "no column is a time by its name", columns, "e.g. time_s", "name it with --time")
    if not set(column_of) - {TIME} and not problems.problems:
        problems.add(
            "",
            "no column is a position or a length by its name",
            columns,
            "e.g. x_mm, y_mm, z_mm",
            "name them with --x, --y, --z or --length",
        )
    return column_of


def _guesses(columns: Iterable[str]) -> dict[str, list[str]]:
    """Role -> columns whose names and units suggest it."""
    guesses: dict[str, list[str]] = {}
    for name in columns:
        stem, unit = _split_name(name)
        axis = _AXIS_NAME.fullmatch(stem)
        if _TIME_NAME.fullmatch(stem) and unit not in _LENGTH_UNITS:
            guesses.setdefault(TIME, []).append(name)
        elif axis and unit not in _TIME_UNITS:
            guesses.setdefault(axis[1], []).append(name)
        elif _LENGTH_NAME.fullmatch(stem) and unit not in _TIME_UNITS:
            guesses.setdefault(LENGTH, []).append(name)
    return guesses


def _to_s_or_mm(table: CsvTable, name: str, role: str, unit: str | None, problems: ProblemList) -> FloatArray:
    """(N,) the column in s for the time, in mm for a position or a length; nan where its unit is not known."""
    wanted = "s" if role == TIME else "mm"
    _, own_unit = _split_name(name)
    ratio = unit_factor(own_unit or (unit or "" if role != TIME else ""), wanted)
    if ratio is None:
        units = _TIME_UNITS if role == TIME else _LENGTH_UNITS
        problems.add(
            table.place(name),
            f"has no unit of {role} in its name",
            name,
            ", ".join(sorted(units)),
            "rename it" if role == TIME else "rename it, or give --unit",
        )
        ratio = np.nan
    return table.columns[name] * ratio


def _check_time(table: CsvTable, name: str, problems: ProblemList) -> None:
    """Add a problem for rows that are not later than the row above."""
    with_time = np.flatnonzero(~np.isnan(table.columns[name]))
    not_rising = with_time[1:][np.diff(table.columns[name][with_time]) <= 0]
    if len(not_rising):
        problems.add(
            f"{table.place(name)}, {rows_text(table.row[not_rising].tolist())}",
            "time does not rise",
            allowed="later than the row above",
            next_step="sort the rows, delete repeated ones",
        )
