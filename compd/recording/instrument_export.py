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
from compd.units import KINDS, factor

LENGTH = "length"
TIME = "time"
_LENGTH_UNITS, _TIME_UNITS = frozenset(KINDS[0]), frozenset(KINDS[1])
_TIME_NAME = re.compile(r"(?:.*_)?(?:t|time|timestamp|elapsed|seconds)")
_AXIS_NAME = re.compile(r"(?:.*_)?([xyz])")
_LENGTH_NAME = re.compile(r"(?:.*_)?(?:length|distance|displacement|position|l|d)(?:_\d+)?|.*link_\d+")


@dataclass(frozen=True)
class Track:
    """What the instrument saw.

    Attributes
    ----------
    time_s : (M,) on the instrument's clock, strictly rising.
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
        """Standard deviation per axis, robustly, from each sample against the mean of its neighbours: steady
        motion cancels (the second difference of white noise has the variance 3/2 sigma^2)."""
        middle = self.position_mm[1:-1] - (self.position_mm[2:] + self.position_mm[:-2]) / 2.0
        # 1.4826 = 1 / 0.6745: the median absolute deviation of a normal distribution
        return float(1.4826 * np.median(np.abs(middle)) / np.sqrt(1.5))

    def at(self, time_s: FloatArray) -> FloatArray:
        """(N, d) position at times of the instrument's clock, linear between samples, held beyond the ends."""
        return np.column_stack([np.interp(time_s, self.time_s, column) for column in self.position_mm.T])


def read_track(path: Path, names: Mapping[str, str], unit: str | None = None) -> Track:
    """Read an export. Raises RecordingError with every problem.

    names : role ("time", "x", "y", "z", "length") -> column; roles that are not given are guessed from names
        and units, unless any of x, y, z, length is given.
    unit : of the lengths, where the columns' names do not end in one.
    """
    problems = ProblemList(path)
    table = read_table(path, problems, _is_header)
    if table is None:
        raise RecordingError(problems.problems)
    found = _roles(table, names, problems)
    scaled = {role: _scaled(table, name, role, unit, problems) for role, name in found.items()}
    if problems.problems:
        raise RecordingError(problems.problems)
    axes = tuple(role for role in (*AXES, LENGTH) if role in found)
    values = np.column_stack([scaled[TIME], *(scaled[axis] for axis in axes)])
    whole = ~np.isnan(values).any(axis=1)
    _check_time(table, found[TIME], problems)
    if whole.sum() < 3:
        problems.add("", f"{int(whole.sum())} rows have a time and {', '.join(axes)}", allowed="three rows or more")
    if problems.problems:
        raise RecordingError(problems.problems)
    return Track(path, values[whole, 0], values[whole, 1:], axes, found, int((~whole).sum()))


def _is_header(cells: Sequence[str]) -> bool:
    filled = [cell for cell in cells if cell]
    return len(filled) >= 2 and not any(NUMBER.fullmatch(cell) for cell in filled)


def _split(name: str) -> tuple[str, str]:
    """A name as (stem, unit): "Tracker X [mm]" -> ("tracker_x", "mm"); the unit is "" where none is known."""
    tidy = re.sub(r"[^A-Za-z0-9]+", "_", name.replace("\u00b5", "u").replace("\u03bc", "u")).strip("_")
    stem, _, last = tidy.rpartition("_")
    if stem and last in _LENGTH_UNITS | _TIME_UNITS:
        return stem.lower(), last
    return tidy.lower(), ""


def _roles(table: CsvTable, names: Mapping[str, str], problems: ProblemList) -> dict[str, str]:
    """Role -> column: those that a person named, the rest guessed; what is not there or not clear is reported."""
    columns = ", ".join(table.letters)
    for role, name in names.items():
        if name not in table.letters:
            problems.add("", f"has no column for {role}", name, columns, f"name one with --{role}")
    said = {role: name for role, name in names.items() if name in table.letters}
    guesses = _guesses(table.letters)
    wanted = [TIME, *((*AXES, LENGTH) if not set(names) - {TIME} else ())]
    if any(axis in guesses for axis in AXES):
        wanted = [role for role in wanted if role != LENGTH]
    for role in wanted:
        several = guesses.get(role, [])
        if role not in names and len(several) == 1:
            said[role] = several[0]
        elif role not in names and several:
            problems.add(
                "", f"{len(several)} columns may be {role}", ", ".join(several), "one", f"name it with --{role}"
            )
    if TIME not in names and TIME not in guesses:
        problems.add("", "no column is a time by its name", columns, "e.g. time_s", "name it with --time")
    if not set(said) - {TIME} and not problems.problems:
        problems.add(
            "",
            "no column is a position or a length by its name",
            columns,
            "e.g. x_mm, y_mm, z_mm",
            "name them with --x, --y, --z or --length",
        )
    return said


def _guesses(columns: Iterable[str]) -> dict[str, list[str]]:
    """Role -> columns that sound like it."""
    guesses: dict[str, list[str]] = {}
    for name in columns:
        stem, unit = _split(name)
        axis = _AXIS_NAME.fullmatch(stem)
        if _TIME_NAME.fullmatch(stem) and unit not in _LENGTH_UNITS:
            guesses.setdefault(TIME, []).append(name)
        elif axis and unit not in _TIME_UNITS:
            guesses.setdefault(axis[1], []).append(name)
        elif _LENGTH_NAME.fullmatch(stem) and unit not in _TIME_UNITS:
            guesses.setdefault(LENGTH, []).append(name)
    return guesses


def _scaled(table: CsvTable, name: str, role: str, unit: str | None, problems: ProblemList) -> FloatArray:
    """The column in s or mm."""
    wanted = "s" if role == TIME else "mm"
    _, own = _split(name)
    ratio = factor(own or (unit or "" if role != TIME else ""), wanted)
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
    there = np.flatnonzero(~np.isnan(table.columns[name]))
    late = there[1:][np.diff(table.columns[name][there]) <= 0]
    if len(late):
        problems.add(
            f"{table.place(name)}, {rows_text(table.row[late].tolist())}",
            "time does not rise",
            allowed="later than the row above",
            next_step="sort the rows, delete repeated ones",
        )
