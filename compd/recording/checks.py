"""Checks of a recording's numbers: rules, and limits beyond which a person should look.

A recording that breaks a rule is refused:

- `time_s` is different in every row; a row without it is left out. Rows in another order than that of time are taken in
  that order, with a warning, unless sessions would get mixed: then the clock began again.
- `session`, `visit`, `point`, `ball` and `pin` are whole numbers from 0; `point`, `pin` and, with a distance, `ball`
  may be text.
- `reference_distance_mm` is greater than 0.
- `approach_<i>` is 1 or -1, or empty where it is not known.
- At least two rows have all that is needed: the gauges, and a value of the reference.

A value beyond a limit gets a warning, and counts all the same: its unit is probably not the one that the column's
name ends in. What no machine can have made is found by `reference_faults` and `quantity_faults`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.columns import DISTANCE_COLUMN, ID_COLUMNS
from compd.reading import LARGEST_READING
from compd.tables import ProblemList, Table, rows_text, values_text


class Limit(NamedTuple):
    """Plausible values: outside them the unit probably differs from that in the column's name. No error.

    names : the columns as people write them. pattern : what matches their names.
    """

    names: str
    pattern: re.Pattern[str]
    low: float
    high: float
    why: str


# The first match of a column's name counts.
LIMITS: tuple[Limit, ...] = tuple(
    Limit(names, re.compile(pattern), low, high, why)
    for names, pattern, low, high, why in (
        ("scale_<i>_mm", r"scale_\d+_mm", -2000.0, 2000.0, "a link's travel in mm; are these um?"),
        # the comparators of the paper and of the presets reach +-1 mm at most
        (
            "joint_<k>_um, frame_t<k>_um, frame_u<k>_um",
            r"joint_\d+_um|frame_[tu]\d_um",
            -1000.0,
            1000.0,
            "a comparator's range in um",
        ),
        # air outside this range is unlikely in a measuring room; it may be in degrees Fahrenheit
        ("temperature_room_degC", r"temperature_room_degC", 0.0, 50.0, "degrees Celsius"),
        (
            "temperature of a part of the machine",
            r"temperature_(?:base|frame|platform|tool|plate_\w+|link_\d+)_degC",
            -20.0,
            150.0,
            "degrees Celsius",
        ),
        ("any other temperature", r"temperature_\w+_degC", -100.0, 600.0, "degrees Celsius"),
        ("pressure_hPa", r"pressure_hPa", 500.0, 1100.0, "air pressure on Earth's surface in hPa; is this Pa or kPa?"),
        ("humidity_pct", r"humidity_pct", 0.0, 100.0, "relative humidity in percent"),
        ("force_x_N, force_y_N, force_z_N", r"force_[xyz]_N", -20000.0, 20000.0, "a force on the tip in N"),
        (
            "reference_..._mm, model_..._mm",
            r"(?:reference|model)_(?:[xyz]|link_\d+|distance)_mm",
            -20000.0,
            20000.0,
            "a length in mm; are these um?",
        ),
        (
            "reference_..._rad, model_..._rad",
            r"(?:reference|model)_r[xyz]_rad",
            -3.15,
            3.15,
            "a rotation vector in rad; are these degrees?",
        ),
    )
)
# Least change (um) of a set of comparators: those of +-1 mm resolve 0.01 to 0.1 um, so that less is probably in mm.
_MIN_JOINT_UM = 0.05


def limit_of(name: str) -> Limit | None:
    """Plausible values of the column of this name; None if unknown."""
    return next((limit for limit in LIMITS if limit.pattern.fullmatch(name)), None)


def check_values(table: Table, problems: ProblemList) -> None:
    """Check every column but the time: rules first (problems), then plausible limits (warnings)."""
    for name, values in table.columns.items():
        wrong = np.abs(values) >= LARGEST_READING
        _report(table, name, wrong, problems, "stands for no number", "a measured number", "empty the cell")
    for name in ID_COLUMNS:
        if name in table.columns and name not in table.labels:
            values = table.columns[name]
            wrong = ~np.isnan(values) & ((values != np.round(values)) | (values < 0) | (np.abs(values) > 2**53))
            _report(table, name, wrong, problems, "not a whole number", "0, 1, 2, ...", "number them")
    for name, values in table.columns.items():
        if re.fullmatch(r"approach_\d+", name):
            wrong = ~np.isnan(values) & (np.abs(values) != 1.0)
            _report(
                table,
                name,
                wrong,
                problems,
                "not a direction",
                "1 or -1, or an empty cell where it is not known",
                "write the direction in which the link last moved",
            )
    if DISTANCE_COLUMN in table.columns:
        wrong = table.columns[DISTANCE_COLUMN] <= 0  # an empty cell is nan, and not wrong
        next_step = "give the whole distance, with the nominal length, and not its change"
        _report(table, DISTANCE_COLUMN, wrong, problems, "no distance", "more than 0", next_step)
    _check_limits(table, problems)


def check_usable_rows(table: Table, excluded: BoolArray, needed: Iterable[str], problems: ProblemList) -> None:
    """Require two complete rows; else report the reasons for the missing ones.

    excluded : (N,) by a person. needed : columns that a row must have. A cell that was reported as wrong counts as
    filled, so that one mistake is reported once.
    """
    usable = ~excluded
    left_out = {"excluded in the sidecar": int(excluded.sum())}
    for name in needed:
        if name in table.wrong:
            continue
        empty = usable & np.isnan(table.columns[name])
        left_out[f"without {name}"] = int(empty.sum())
        usable &= ~empty
    if len(table.row) < 2:
        problems.add(
            "",
            "no rows" if not len(table.row) else "only one row",
            allowed="two rows or more",
            next_step="record more, or give the right file",
        )
    elif usable.sum() < 2:
        reasons = [f"{count} {reason}" for reason, count in left_out.items() if count]
        problems.add(
            "",
            f"{'only one' if usable.any() else 'no'} row of {len(table.row)} can be used: {', '.join(reasons)}",
            allowed="two rows or more",
            next_step="fill these columns, or delete those that were not measured",
        )


def check_rising_time(table: Table, after_s: float, problems: ProblemList) -> None:
    """Every row of a block is later than the one before it; the first than `after_s`, the end of the block before."""
    with_time = np.flatnonzero(~np.isnan(table.columns["time_s"]))
    rows = np.zeros(len(table.row), dtype=bool)
    rows[with_time] = np.diff(table.columns["time_s"][with_time], prepend=after_s) <= 0
    next_step = "sort the rows by time_s; where a clock began again, let it run on"
    _report(
        table, "time_s", rows, problems, "does not rise", "rows in the order of time, to be read in blocks", next_step
    )


def check_time(table: Table, problems: ProblemList) -> None:
    """No two rows have one time, and rows in the order of time keep together the sessions that the file keeps together.

    Rows that are out of order make a warning: what was measured does not depend on how a file is sorted.
    """
    with_time = np.flatnonzero(~np.isnan(table.columns["time_s"]))
    time_s = table.columns["time_s"][with_time]
    order = np.argsort(time_s, kind="stable")

    def report(wrong: IntArray, what: str, allowed: str, next_step: str, warn: bool = False) -> None:
        rows = np.zeros(len(table.row), dtype=bool)
        rows[with_time[wrong]] = True
        _report(table, "time_s", rows, problems, what, allowed, next_step, warn)

    repeated = order[1:][np.diff(time_s[order]) == 0]
    what, next_step = "the same time as another row", "write more decimals, or delete the repeated row"
    report(repeated, what, "a time of its own", next_step)
    backwards = np.flatnonzero(np.diff(time_s) < 0) + 1
    session = table.columns.get("session", np.zeros(len(table.row)))[with_time]
    if np.count_nonzero(np.diff(session[order])) > np.count_nonzero(np.diff(session)):
        next_step = "let the clock run on where sessions were put together"
        report(backwards, "time runs backwards, and sessions overlap", "one clock for all sessions", next_step)
    else:
        next_step = "nothing; where a clock began again, let it run on"
        report(backwards, "time runs backwards", "rows are taken in the order of time", next_step, warn=True)


def _check_limits(table: Table, problems: ProblemList) -> None:
    """Warn of values that are implausible for their unit."""
    for name, values in table.columns.items():
        if (limit := limit_of(name)) is None:
            continue
        with np.errstate(invalid="ignore"):
            strange = (values < limit.low) | (values > limit.high)
        _report(
            table,
            name,
            strange,
            problems,
            "implausible for its unit",
            f"{limit.low:g} to {limit.high:g}: {limit.why}",
            "look",
            warn=True,
        )


def check_joint_unit(table: Table, problems: ProblemList) -> None:
    """Warn if the joint comparators never move by their resolution."""
    joints = [values for name, values in table.columns.items() if re.fullmatch(r"joint_\d+_um", name)]
    largest = max((float(np.nanmax(np.abs(values))) for values in joints if not np.isnan(values).all()), default=0.0)
    if 0 < largest < _MIN_JOINT_UM:
        problems.warn(
            "columns joint_<k>_um",
            "no joint comparator ever moves by what it can resolve",
            f"{largest:g} um",
            next_step="are these mm?",
        )


def _report(
    table: Table,
    name: str,
    wrong: BoolArray,
    problems: ProblemList,
    what: str,
    allowed: str,
    next_step: str,
    warn: bool = False,
) -> None:
    """One problem (or warning) for all wrong cells of a column."""
    if not wrong.any():
        return
    rows: IntArray = table.row[wrong]
    values: FloatArray = table.columns[name][wrong]
    place = f"{table.place(name)}, {rows_text(rows.tolist())}"
    report = problems.warn if warn else problems.add
    report(place, what, _values_shown(values.tolist()), allowed, next_step)


def _values_shown(values: Sequence[float]) -> str:
    return values_text(f"{value:.10g}" for value in values)
