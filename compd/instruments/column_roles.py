"""Which column of a table is what: as a person says, as the header says, or as the numbers allow one reading alone."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from compd.arrays import rms
from compd.instruments.axes import ATTITUDE_AXES, LENGTH_AXES, POSITION_AXES
from compd.instruments.cells import is_number_column, numbers
from compd.instruments.export import ReadOptions
from compd.instruments.header_names import is_not_measured, split_unit, turn_axis, understand
from compd.instruments.raw_table import RawTable
from compd.instruments.time_stamps import is_clock, is_date, is_stamp
from compd.tables import ProblemList
from compd.units import unit_named

AXES = (*POSITION_AXES, *ATTITUDE_AXES, *LENGTH_AXES)
# `collection` and `date` go with `group` and `time`; "-" is a column that is not used.
ROLES = ("time", "date", *AXES, "name", "visit", "reflector", "group", "collection", "-")
_NAMED_BY_OPTION = ("time", *POSITION_AXES, "length", "reflector")
# Largest relative rms difference of the distances between rows of two triples: nominal and measured ones.
_ALIKE = 0.1
_HALF_DAY = frozenset(("AM", "PM"))


@dataclass
class Roles:
    """What the columns are."""

    column: dict[str, int] = field(default_factory=dict)  #: role -> index of the column
    unit: dict[str, str] = field(default_factory=dict)  #: role -> its unit, as its name or a person says; "" for none
    why: dict[str, str] = field(default_factory=dict)  #: role -> how it is known, in words

    def take(self, role: str, column: int, unit: str, why: str) -> None:
        """Note that `column` has a role."""
        self.column[role] = column
        self.unit[role] = unit
        self.why[role] = why


def find_roles(table: RawTable, options: ReadOptions, problems: ProblemList) -> Roles:
    """The roles of a table's columns. Problems are added for what cannot be told, with the options that settle it."""
    roles = Roles()
    if options.columns:
        _take_columns(table, options.columns, roles, problems)
    elif any(role not in ("", "-") for role in table.roles):
        for k, role in enumerate(table.roles):
            if role not in ("", "-"):
                roles.take(role, k, _header_unit(table, k), "as this shape has it")
        _take_names(table, options.names, roles, problems)
    elif table.header is not None:
        _take_names(table, options.names, roles, problems)
        _take_header(table, options, roles, problems)
    elif options.names:
        _take_names(table, options.names, roles, problems)
    else:
        _take_numbers(table, options, roles, problems)
    if not problems.problems:
        _check(table, roles, problems)
        if not options.columns and not set(options.names) & set(AXES):
            _ask_for_one_triple(table, roles, problems)
    return roles


def column_text(table: RawTable, column: int) -> str:
    """A column for a person: "column 4 'X [mm]'"."""
    return f"column {column + 1}" + (f" {table.header[column]!r}" if table.header else "")


def _header_unit(table: RawTable, column: int) -> str:
    return split_unit(table.header[column])[1] if table.header else ""


def _take_columns(table: RawTable, columns: Sequence[str], roles: Roles, problems: ProblemList) -> None:
    """The roles of `--columns`: one for each column, with a unit behind where a person writes one, "x[inch]"."""
    if len(columns) != len(table.columns):
        problems.add(
            int(table.line[0]),
            f"--columns has {len(columns)} roles, the rows have {len(table.columns)} cells",
            ", ".join(cells[0] for cells in table.columns),
            f"{len(table.columns)} of {', '.join(ROLES)}",
        )
    for k, text in enumerate(columns[: len(table.columns)]):
        role, bracket, unit = text.strip().rstrip("]").partition("[")
        known = unit_named(unit)
        if role not in ROLES or (bracket and not known):
            problems.add(
                0, f"--columns: column {k + 1} has no such role or unit", text, f"{', '.join(ROLES)}; x[mm], time[ms]"
            )
        elif role != "-" and role in roles.column:
            problems.add(0, f"--columns: two columns are {role}", ",".join(columns), "each role once")
        elif role != "-":
            roles.take(role, k, known or _header_unit(table, k), "as --columns says")


def _take_names(table: RawTable, names: Mapping[str, str], roles: Roles, problems: ProblemList) -> None:
    """The columns that a person names, by the header's words or by their number."""
    for role, name in names.items():
        places = _columns_named(table, name)
        if len(places) == 1:
            roles.take(role, places[0], _header_unit(table, places[0]), f"as --{role} says")
            continue
        shown = ", ".join(table.header) if table.header else f"1 to {len(table.columns)}"
        what = f"has no column for {role}" if not places else f"{len(places)} columns may be {role}"
        problems.add(table.header_line, what, name, shown, f"name one with --{role}")


def _columns_named(table: RawTable, name: str) -> list[int]:
    if table.header is not None:
        for same in (
            lambda own: own == name,
            lambda own: own.lower() == name.strip().lower(),
            lambda own: split_unit(own)[0] == split_unit(name)[0],
        ):
            places = [k for k, own in enumerate(table.header) if same(own)]
            if places:
                return places
    return [int(name) - 1] if name.isdecimal() and 1 <= int(name[:6]) <= len(table.columns) else []


def _take_header(table: RawTable, options: ReadOptions, roles: Roles, problems: ProblemList) -> None:
    """The roles that the header's names suggest, where no person has named them."""
    understood = [understand(name) for name in table.header or ()]
    by_role: dict[str, list[int]] = {}
    for k, (role, _) in enumerate(understood):
        if role and k not in roles.column.values() and any(table.columns[k][:1000]):
            by_role.setdefault(role, []).append(k)
    named_axes = bool(set(options.names) & set(AXES))
    if any(axis in by_role for axis in POSITION_AXES):
        by_role.pop("length", None)
    elif "angle" in by_role:
        del by_role["angle"]
    if "name" not in by_role and "number" in by_role:
        by_role["name"] = by_role["number"]
    _settle_time(table, by_role)
    if options.angles is not None and not named_axes:
        _take_turns(table, by_role)
    if len(by_role.get("angle", [])) >= 3 and not named_axes:
        columns = [table.header[k] for k in by_role["angle"]] if table.header else []
        plain = _columns_option(table, {role: places[0] for role, places in by_role.items()})
        problems.ask(
            "columns are angles of which the meaning cannot be told",
            ", ".join(columns),
            [f"--columns {plain} (without them)", "rx,ry,rz in their places, with --angles for the order of turning"],
            table.header_line,
        )
    for role in ROLES:
        places = by_role.get(role, [])
        if role in roles.column or (role in AXES and named_axes):
            continue
        if len(places) > 1:
            header = table.header or ()
            problems.add(
                table.header_line,
                f"{len(places)} columns may be {role}",
                ", ".join(header[k] for k in places),
                "one",
                f"name it with --{role}" if role in _NAMED_BY_OPTION else "give --columns",
            )
        elif places:
            roles.take(role, places[0], understood[places[0]].unit, "by its name")


def _take_turns(table: RawTable, by_role: dict[str, list[int]]) -> None:
    """Roll, pitch and yaw turn about x, y and z; of a, b and c no name says so."""
    header = table.header or ()
    turns = {turn_axis(header[k]): k for k in by_role.get("angle", [])}
    if set(turns) == set(ATTITUDE_AXES) and len(by_role["angle"]) == len(turns):
        del by_role["angle"]
        by_role |= {axis: [k] for axis, k in turns.items()}


def _settle_time(table: RawTable, by_role: dict[str, list[int]]) -> None:
    """A date with the time in it is the time; a date beside a time of day is a column of its own."""
    dates = by_role.get("date", [])
    if dates and "time" not in by_role:
        by_role["time"] = by_role.pop("date")
    elif dates and not is_clock(_first(table.columns[by_role["time"][0]])):
        del by_role["date"]


def _first(cells: Sequence[str]) -> str:
    return next((cell for cell in cells if cell), "")


def _take_numbers(table: RawTable, options: ReadOptions, roles: Roles, problems: ProblemList) -> None:
    """The roles of columns without names, where what is in them allows one reading alone; else the readings."""
    kinds = [_kind(cells) for cells in table.columns]
    numeric = [k for k, kind in enumerate(kinds) if kind == "number"]
    texts = [k for k, kind in enumerate(kinds) if kind == "text"]
    fixed = {kind: k for k, kind in enumerate(kinds) if kind in ("time", "date", "clock")}
    if "clock" in fixed:
        fixed["time"] = fixed.pop("clock")
    stamped = "time" in fixed and len([kind for kind in kinds if kind in ("time", "clock")]) == 1
    if len(texts) == 1:
        fixed["name"] = texts[0]
    timed = "time" in fixed or options.rate_hz is not None
    readings: list[dict[str, int]] = []
    if len(texts) <= 1 and (stamped or "time" not in fixed) and kinds.count("date") <= 1:
        readings = _readings(table, numeric, timed, "name" in fixed, problems)
    if len(readings) == 1:
        for role, k in {**fixed, **readings[0]}.items():
            roles.take(role, k, "", _why(role, kinds[k]))
        return
    first = ", ".join(cells[0] for cells in table.columns)
    options_text = [f"--columns {_columns_option(table, {**fixed, **reading})}" for reading in readings]
    if not options_text:
        options_text = [f"--columns with {len(table.columns)} of {', '.join(ROLES)}, such as {_example(kinds)}"]
    problems.ask("has no header, and what its columns are cannot be told", first, options_text, int(table.line[0]))


def _readings(
    table: RawTable, numeric: Sequence[int], timed: bool, named: bool, problems: ProblemList
) -> list[dict[str, int]]:
    """What columns of numbers may be: role -> column, for each possible reading."""
    positions = dict(zip(POSITION_AXES, numeric[-3:], strict=True)) if len(numeric) in (3, 4) else {}
    if len(numeric) == 3:
        return [positions]
    if len(numeric) in (1, 2):
        value = numeric[-1]
        with_first = [{"time": numeric[0]}, {"name": numeric[0]}] if len(numeric) == 2 else [{}]
        allowed = [first for first in with_first if not (timed and "time" in first) and not (named and "name" in first)]
        return [{**first, axis: value} for first in allowed for axis in ("length", "x", "y", "z")]
    if len(numeric) == 4 and numeric[0] == numeric[1] - 1:
        first = numbers(table.columns[numeric[0]], table.line, "column 1", problems)
        filled = first[~np.isnan(first)]
        whole, rising = bool(np.all(filled == np.floor(filled))), bool(np.all(np.diff(filled) > 0))
        number, time = {"name": numeric[0], **positions}, {"time": numeric[0], **positions}
        # three rows that rise are few: numbers of points as well as seconds
        readings = [] if not whole else [positions if named else number]
        if not timed and (not whole or (rising and table.shape != "sa")) and bool(np.all(np.diff(filled) >= 0)):
            readings.append(time)
        return readings
    return []


def _kind(cells: Sequence[str]) -> str:
    """What is in a column: number, time (with a date), date, clock, half (AM, PM), empty or text."""
    if is_number_column(cells):
        return "number"
    first = _first(cells)
    if not first:
        return "empty"
    if is_date(first):
        return "date"
    if is_clock(first):
        return "clock"
    if is_stamp(first):
        return "time"
    return "half" if first.upper() in _HALF_DAY else "text"


def _why(role: str, kind: str) -> str:
    if role in POSITION_AXES:
        return "as three columns of numbers are there"
    if role == "time" and kind == "number":
        return "as it rises and is not whole"
    if role == "name" and kind == "number":
        return "as it counts the points"
    return "by what is in it"


def _columns_option(table: RawTable, role_of: Mapping[str, int]) -> str:
    """Roles for `--columns`."""
    at = {k: role for role, k in role_of.items() if role in ROLES}
    return ",".join(at.get(k, "-") for k in range(len(table.columns)))


def _example(kinds: Sequence[str]) -> str:
    axes = iter(POSITION_AXES)
    names = {"time": "time", "clock": "time", "date": "date", "text": "name"}
    return ",".join(next(axes, "-") if kind == "number" else names.get(kind, "-") for kind in kinds)


def _ask_for_one_triple(table: RawTable, roles: Roles, problems: ProblemList) -> None:
    """Ask where three columns that are not used may be the position as well: nominal and measured, for instance.

    Their names are those of x, y, z with the same letters before or behind, and from row to row they change as the
    others do.
    """
    if table.header is None or not all(axis in roles.column for axis in POSITION_AXES):
        return
    chosen = [roles.column[axis] for axis in POSITION_AXES]
    names = [split_unit(name)[0] for name in table.header]
    unused = [
        k
        for k, name in enumerate(table.header)
        if k not in roles.column.values() and not is_not_measured(name) and is_number_column(table.columns[k])
    ]
    triples: dict[tuple[str, str], dict[str, int]] = {}
    for k in unused:
        for index, letter in enumerate(names[k]):
            if letter in POSITION_AXES:
                triples.setdefault((names[k][:index], names[k][index + 1 :]), {})[letter] = k
    for others in triples.values():
        places = [others[axis] for axis in POSITION_AXES if axis in others]
        if len(places) != len(POSITION_AXES) or not _change_alike(table, chosen, places):
            continue
        answers = []
        for columns in (chosen, places):
            named = " ".join(
                f"--{axis} {shlex.quote(table.header[k])}" for axis, k in zip(POSITION_AXES, columns, strict=True)
            )
            answers.append(f"{named} ({', '.join(table.columns[k][0] for k in columns)})")
        problems.ask(
            "two triples of columns may be the position, as where nominal and measured values stand side by side",
            ", ".join(table.header[k] for k in (*chosen, *places)),
            answers,
            table.header_line,
        )
        return


def _change_alike(table: RawTable, one: Sequence[int], other: Sequence[int]) -> bool:
    """Whether the distances between successive rows are nearly the same in both triples of columns."""
    ignored = ProblemList(table.path)
    steps = []
    for columns in (one, other):
        values = np.column_stack([numbers(table.columns[k], table.line, "", ignored) for k in columns])
        steps.append(np.linalg.norm(np.diff(values, axis=0), axis=1))
    both = np.isfinite(steps[0]) & np.isfinite(steps[1])
    if not both.any():
        return False
    return bool(rms(steps[1][both] - steps[0][both]) <= _ALIKE * rms(steps[0][both]))


def _check(table: RawTable, roles: Roles, problems: ProblemList) -> None:
    """Refuse a table without a position or a length, and an attitude that is not whole."""
    axes = [axis for axis in AXES if axis in roles.column]
    shown = ", ".join(table.header) if table.header else f"{len(table.columns)} columns"
    if not axes:
        problems.add(
            table.header_line,
            "no column is a position or a length by its name",
            shown,
            "e.g. x_mm, y_mm, z_mm",
            "name them with --x, --y, --z or --length, or all by --columns",
        )
    if "length" in axes and len(axes) > 1:
        problems.add(table.header_line, "is a length and a position", ", ".join(axes), "one of the two")
    attitude = [axis for axis in ATTITUDE_AXES if axis in axes]
    if attitude and len(axes) != 6:
        problems.add(
            table.header_line,
            "an attitude is not whole",
            ", ".join(axes),
            "x, y, z, rx, ry, rz",
            "name the columns with --columns, with - for those that are not used",
        )
