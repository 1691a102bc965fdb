"""A table of text becomes an export: its columns' roles, units, times and groups."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.instruments.angles import ANGLE_ORDERS, VECTOR, rotation_vectors
from compd.instruments.axes import ATTITUDE_AXES
from compd.instruments.cells import numbers
from compd.instruments.column_roles import AXES, Roles, column_text, find_roles
from compd.instruments.export import InstrumentExport, ReadOptions
from compd.instruments.marker_rows import marker_rows
from compd.instruments.raw_table import RawTable
from compd.instruments.time_stamps import (
    SET_BACK_S,
    StampedTime,
    is_clock,
    is_date,
    is_stamp,
    read_stamps,
    set_back_at,
    spread_within,
)
from compd.tables import ProblemList, rows_text
from compd.units import unit_factor, unit_named

ALL_GROUPS = "all"
# Most groups listed in a question.
_SHOWN_GROUPS = 20
_SHOWN_MARKERS = 2
_HALF_DAY = frozenset(("AM", "PM"))
# Shortest interval (s) of rows: trackers and interferometers write up to 10 000 timed positions a second.
MIN_ROWS_S = 1e-4
# Serial days of spreadsheets for the years 1954 to 2119. A second has five decimals; rows of one measurement are less
# than half an hour apart.
SERIAL_DAYS = (20_000.0, 80_000.0)
_DAY_DECIMALS = 5
_MAX_DAY_STEP = 0.02
_LENGTH_UNITS = "mm, um, nm, cm, m, inch, ft"


def to_export(table: RawTable, options: ReadOptions) -> InstrumentExport:
    """The export that a table holds. Raises RecordingError with everything that is wrong or must be said."""
    problems = ProblemList(table.path)
    if not len(table.line):
        problems.refuse(table.header_line, "has no rows", allowed="rows of numbers")
    roles = find_roles(table, options, problems)
    problems.check()
    assumptions = {role: f"{column_text(table, k)}, {roles.why[role]}" for role, k in roles.column.items()}
    unused = [k for k in range(len(table.columns)) if k not in roles.column.values()]
    if unused:
        assumptions["not used"] = ", ".join(column_text(table, k) for k in unused)
    table = _of_group(table, roles, options, assumptions, problems)
    problems.check()
    axes = tuple(axis for axis in AXES if axis in roles.column)
    time = read_time(table, roles, options, problems)
    values = _values(table, roles, axes, options, assumptions, problems)
    if any(axis in ATTITUDE_AXES for axis in axes):
        values = _as_rotation_vectors(table, roles, axes, values, options, assumptions, problems)
    problems.check()
    places = [k for k, axis in enumerate(axes) if axis not in ATTITUDE_AXES]
    cells = [table.columns[roles.column[axes[k]]] for k in places]
    markers = marker_rows(cells, values[:, places])
    complete: BoolArray = np.asarray(np.isfinite(values).all(axis=1))
    if time is not None:
        complete = complete & np.isfinite(time.time_s)
        assumptions["time"] = f"{assumptions['time']}, {time.assumed}" if "time" in assumptions else time.assumed
    if not complete.any():
        problems.refuse(int(table.line[0]), "no row is complete", allowed=f"{', '.join(axes)} in each row")
    names = _names(table, roles, assumptions)
    left_out = dict(table.left_out)
    if markers.any():
        digits = {", ".join(column[i] for column in cells) for i in np.flatnonzero(markers).tolist()}
        shown = " or ".join(sorted(digits)[:_SHOWN_MARKERS])
        left_out[f"{shown} marks what was not measured ({rows_text(table.line[markers].tolist(), 'line')})"] = int(
            markers.sum()
        )
    if not complete.all():
        left_out["with an empty cell"] = int((~complete).sum())
    complete = complete & ~markers

    def texts(cells: Sequence[str] | None) -> tuple[str, ...] | None:
        return None if cells is None else tuple(compress(cells, complete.tolist()))

    return InstrumentExport(
        path=table.path,
        shape=table.shape,
        line=table.line[complete],
        axes=axes,
        values=values[complete],
        time_s=None if time is None else time.time_s[complete],
        time_std_s=0.0 if time is None else time.std_s,
        name=texts(names),
        visit=texts(_cells(table, roles, "visit")),
        reflector=texts(_cells(table, roles, "reflector")),
        taken={**table.assumed, **assumptions},
        left_out=left_out,
    )


def _of_group(
    table: RawTable, roles: Roles, options: ReadOptions, assumptions: dict[str, str], problems: ProblemList
) -> RawTable:
    """The rows of one group of points; asks where there are several and none is chosen."""
    labels = group_labels(table, roles)
    if labels is None:
        if options.group not in (None, ALL_GROUPS):
            problems.add(0, "has no column of groups", f"--group {options.group}", "no --group")
        return table
    counts = Counter(labels)
    listed = ", ".join(
        f"{label or '(none)'} ({count} row{'s' * (count != 1)})" for label, count in counts.most_common(_SHOWN_GROUPS)
    )
    listed += f" and {len(counts) - _SHOWN_GROUPS} more" if len(counts) > _SHOWN_GROUPS else ""
    if options.group == ALL_GROUPS or (options.group is None and len(counts) == 1):
        assumptions["group"] = f"{assumptions.get('group', '')}: {'all of ' if len(counts) > 1 else ''}{listed}".lstrip(
            ": "
        )
        return table
    wanted = {label for label in counts if options.group in (label, label.rpartition("::")[2])}
    if options.group is not None and len(wanted) == 1:
        chosen = wanted.pop()
        rows = [i for i, label in enumerate(labels) if label == chosen]
        assumptions["group"] = f"{assumptions.get('group', '')}: {chosen}, {len(rows)} of {len(labels)} rows".lstrip(
            ": "
        )
        columns = [[cells[i] for i in rows] for cells in table.columns]
        others = {**table.left_out, "of other groups": len(labels) - len(rows)}
        return replace(table, columns=columns, line=table.line[rows], left_out=others)
    what = f"has {len(counts)} groups" if options.group is None else "has no such group, or several"
    problems.add(
        0, what, options.group or "", listed, "choose one with --group NAME, or take --group all for points by name"
    )
    return table


def group_labels(table: RawTable, roles: Roles) -> Sequence[str] | None:
    """Row by row, the group: "collection::group" where there are several collections; None without any."""
    group, collection = roles.column.get("group"), roles.column.get("collection")
    if group is None or (collection is not None and len(set(table.columns[collection])) > 1):
        if collection is None:
            return None
        if group is None:
            return table.columns[collection]
        return [f"{a}::{b}" for a, b in zip(table.columns[collection], table.columns[group], strict=True)]
    return table.columns[group]


def _cells(table: RawTable, roles: Roles, role: str) -> Sequence[str] | None:
    """The cells of the column that has this role; None without one."""
    return table.columns[roles.column[role]] if role in roles.column else None


def _names(table: RawTable, roles: Roles, assumptions: dict[str, str]) -> tuple[str, ...] | None:
    """The names of the points; with their group in front where several groups use one name."""
    if "name" not in roles.column:
        return None
    names = table.columns[roles.column["name"]]
    labels = group_labels(table, roles)
    if labels is not None and len(set(labels)) > 1:
        pairs = set(zip(labels, names, strict=True))
        if len(pairs) > len(set(names)):
            assumptions["name"] += ", with the group in front, as names occur in several"
            return tuple(f"{label}::{name}" for label, name in zip(labels, names, strict=True))
    return tuple(names)


@dataclass(frozen=True)
class _UnitOf:
    """A unit, and who says it."""

    unit: str
    source: str


def _values(
    table: RawTable,
    roles: Roles,
    axes: Sequence[str],
    options: ReadOptions,
    assumptions: dict[str, str],
    problems: ProblemList,
) -> FloatArray:
    """(N, d) in mm, attitude in rad."""
    raw = {
        axis: numbers(table.columns[roles.column[axis]], table.line, column_text(table, roles.column[axis]), problems)
        for axis in axes
    }
    columns = []
    for wanted in ("mm", "rad"):
        of_kind = [axis for axis in axes if (axis in ATTITUDE_AXES) == (wanted == "rad")]
        if not of_kind:
            continue
        known = _unit(table, roles, of_kind, raw, wanted, options, problems)
        factor = unit_factor(known.unit, wanted) if known else None
        if known is None or factor is None:
            columns += [np.full(len(table.line), np.nan)] * len(of_kind)
            continue
        for axis in of_kind:
            # a unit in the name stands in the name
            assumptions[axis] += f", {known.unit}" + ("" if roles.unit.get(axis) else f" {known.source}")
            columns.append(raw[axis] * factor)
    return np.column_stack(columns)


def _unit(
    table: RawTable,
    roles: Roles,
    axes: Sequence[str],
    raw: dict[str, FloatArray],
    wanted: str,
    options: ReadOptions,
    problems: ProblemList,
) -> _UnitOf | None:
    """The one unit of these axes, as all who name one agree; None, with a problem, where none is named or two are."""
    option, flag = (options.unit, "--unit") if wanted == "mm" else (options.angle_unit, "--angle-unit")
    sources: dict[str, str] = {}
    for axis in axes:
        if roles.unit.get(axis):
            sources.setdefault(
                roles.unit[axis], f"by the name of {axis}" if "columns" not in roles.why[axis] else "given"
            )
    if wanted == "mm" and table.unit:
        sources.setdefault(unit_named(table.unit) or table.unit, "by the file's header")
    if option:
        sources.setdefault(unit_named(option) or option, f"by {flag}")
    without = [axis for axis in axes if not roles.unit.get(axis)]
    wrong = [unit for unit in sources if unit_factor(unit, wanted) is None]
    kind = "length" if wanted == "mm" else "angle"
    allowed = _LENGTH_UNITS if wanted == "mm" else "rad, mrad, deg, arcsec"
    if wrong:
        problems.add(table.header_line, f"is no unit of {kind}", f"{wrong[0]}, {sources[wrong[0]]}", allowed)
    elif len(sources) > 1:
        problems.add(
            table.header_line,
            f"units are mixed: {', '.join(f'{unit} {who}' for unit, who in sources.items())}",
            allowed="one unit",
            next_step="export in one unit, or leave out the option that differs",
        )
    elif sources and len(without) not in (0, len(axes)) and not option and not table.unit:
        problems.add(table.header_line, f"{', '.join(without)} has no unit, where others have one", allowed=allowed)
    elif not sources:
        problems.ask(
            f"no unit of {axes[0]} in its name, nor in the file",
            _spans(axes, raw, wanted),
            [f"{flag} {unit}" for unit in (("mm", "inch", "m") if wanted == "mm" else ("rad", "deg"))],
            table.header_line,
        )
    else:
        return _UnitOf(*next(iter(sources.items())))
    return None


def _spans(axes: Sequence[str], raw: dict[str, FloatArray], wanted: str) -> str:
    """From where to where the numbers go, and how long that is in other units."""
    axis = max(axes, key=lambda axis: float(np.nanmax(raw[axis], initial=0.0) - np.nanmin(raw[axis], initial=0.0)))
    filled = raw[axis][~np.isnan(raw[axis])]
    if not len(filled):
        return ""
    span = float(filled.max()) - float(filled.min())
    if wanted == "rad":
        return f"{axis} spans {span:.4g}"
    return f"{axis} spans {span:.4g}: as inch {span * 25.4:.4g} mm, as m {span * 1e3:.4g} mm"


def _as_rotation_vectors(
    table: RawTable,
    roles: Roles,
    axes: Sequence[str],
    values: FloatArray,
    options: ReadOptions,
    assumptions: dict[str, str],
    problems: ProblemList,
) -> FloatArray:
    """The values (N, d) with the attitude as a rotation vector, as rx, ry, rz are where nobody says another order."""
    turned = [k for k, axis in enumerate(axes) if axis in ATTITUDE_AXES]
    order = options.angles
    if order is None:
        return values
    if order not in ANGLE_ORDERS or len(turned) < len(ATTITUDE_AXES):
        what = "is no order of turning" if order not in ANGLE_ORDERS else f"turns {len(turned)} angles"
        problems.add(table.header_line, what, f"--angles {order}", ", ".join(ANGLE_ORDERS))
        return values
    for k in turned:
        assumptions[axes[k]] += ", a rotation vector" if order == VECTOR else f", in the order {order}"
    values[:, turned] = rotation_vectors(values[:, turned], order)
    return values


def read_time(
    table: RawTable,
    roles: Roles,
    options: ReadOptions,
    problems: ProblemList,
    unit_option: str = "--columns with time[{unit}] for {what}",
) -> StampedTime | None:
    """The times of the rows; None if they have none.

    unit_option : how a person says the unit of times that are numbers.
    """
    time = _time(table, roles, options, problems, unit_option)
    return _with_the_hour(time, table, problems) if time is not None and options.clock_set_back else time


def _time(
    table: RawTable, roles: Roles, options: ReadOptions, problems: ProblemList, unit_option: str
) -> StampedTime | None:
    column = roles.column.get("time")
    if column is None:
        if options.rate_hz is None:
            return None
        if not options.rate_hz > 0 or not np.isfinite(options.rate_hz):
            problems.add(0, "is no rate", f"--rate-hz {options.rate_hz}", "more than 0 Hz")
            return None
        assumed = f"from the number of the row, {options.rate_hz:g} rows a second by --rate-hz"
        return StampedTime(np.arange(len(table.line)) / options.rate_hz, 0.0, assumed)
    if options.rate_hz is not None:
        problems.add(table.header_line, "has a time", column_text(table, column), "no --rate-hz", "leave it out")
        return None
    cells = table.columns[column]
    first = next((cell for cell in cells if cell), "")
    if not is_stamp(first):
        return _time_of_numbers(table, roles, cells, table.line, problems, unit_option)
    return read_stamps(
        _whole_stamps(table, roles, column), table.line, options.dates, column_text(table, column), problems
    )


def _with_the_hour(time: StampedTime, table: RawTable, problems: ProblemList) -> StampedTime:
    """The times with an hour added from where the clock was set back."""
    row = set_back_at(time.time_s)
    if row is None:
        allowed = "times that fall once, by an hour"
        problems.add(0, "its clock was not set back by an hour", "--clock-set-back", allowed, "leave it out")
        return time
    time_s = time.time_s.copy()
    time_s[row:] += SET_BACK_S
    return replace(time, time_s=time_s, assumed=f"{time.assumed}; 1 h added from line {table.line[row]} on")


def _whole_stamps(table: RawTable, roles: Roles, column: int) -> Sequence[str]:
    """Stamps of one column, or put together from date, time of day, and AM or PM in columns of their own."""
    cells = table.columns[column]
    date_column = roles.column.get("date")
    if date_column is None and column and is_clock(cells[0]) and is_date(table.columns[column - 1][0]):
        date_column = column - 1
    elif date_column is None and is_date(cells[0]) and column + 1 < len(table.columns):
        # the time of day stands behind the date
        date_column, column = column, column + 1
        cells = table.columns[column]
    half = table.columns[column + 1] if column + 1 < len(table.columns) else ()
    if half and half[0].upper() in _HALF_DAY and {cell.upper() for cell in half} <= _HALF_DAY:
        cells = [f"{cell} {other}" for cell, other in zip(cells, half, strict=True)]
    if date_column is None:
        return cells
    days = table.columns[date_column]
    return [f"{day} {cell}" if cell else "" for day, cell in zip(days, cells, strict=True)]


def _is_doubtful(values: FloatArray, cells: Sequence[str]) -> bool:
    """Whether times (N,) without a unit, with decimals, are probably no seconds: too close together for an instrument,
    or the days that a spreadsheet counts."""
    steps = np.abs(np.diff(values))
    step = float(np.median(steps[steps > 0])) if steps.any() else 0.0
    if step < MIN_ROWS_S:
        return len(values) > 1
    fine = all(len(cell.partition(".")[2]) >= _DAY_DECIMALS for cell in cells if cell)
    return fine and step < _MAX_DAY_STEP and bool(SERIAL_DAYS[0] <= values.min() <= values.max() <= SERIAL_DAYS[1])


def _time_of_numbers(
    table: RawTable,
    roles: Roles,
    cells: Sequence[str],
    line: IntArray,
    problems: ProblemList,
    unit_option: str,
) -> StampedTime | None:
    """Times that are numbers: in the unit of the column, or else seconds where they have decimals."""
    what = column_text(table, roles.column["time"])
    values = numbers(cells, line, what, problems)
    unit = roles.unit.get("time", "")
    factor = unit_factor(unit, "s") if unit else None
    assumed = unit or "s, as it has decimals and no unit"
    filled = values[~np.isnan(values)]
    if unit and factor is None:
        allowed = "s, ms, us, min, h, day"
        problems.add(
            table.header_line, "is no unit of time", unit, allowed, f"give {unit_option.format(unit='s', what=what)}"
        )
        return None
    if not unit and np.all(filled == np.floor(filled)):
        problems.ask(
            "no unit of time in its name, and whole numbers",
            ", ".join(cells[:3]),
            [unit_option.format(unit=other, what=what) for other in ("s", "ms")],
            table.header_line or int(line[0]),
        )
        return None
    if not unit and _is_doubtful(filled, cells):
        span_s = {other: float(np.ptp(filled)) * (unit_factor(other, "s") or 1.0) for other in ("day", "h", "min", "s")}
        problems.ask(
            f"no unit of time in its name; in s, its {len(filled)} rows would span {span_s['s']:.3g} s",
            ", ".join(cells[:3]),
            [f"{unit_option.format(unit=one, what=what)} (they span {s:.3g} s)" for one, s in span_s.items()],
            table.header_line or int(line[0]),
        )
        return None
    ratio = factor or 1.0
    time_s = values * ratio
    repeated = bool(np.any(np.diff(filled) == 0.0))
    joined = "".join(cells) if repeated else "e"
    if "e" in joined or "E" in joined:
        return StampedTime(time_s, 0.0, assumed)
    decimals = max(len(cell.partition(".")[2]) for cell in cells)
    time_s, std_s, spread = spread_within(time_s, ratio * 10.0**-decimals)
    return StampedTime(time_s, std_s, f"{assumed}; {spread}" if spread else assumed)
