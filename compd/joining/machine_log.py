"""The machine's own log, any workbook or delimited text, as the recording of gauges that a join takes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray, TextArray
from compd.columns import COMMANDED_ATTITUDE_COLUMNS, TEXT_ID_COLUMNS
from compd.configuration import Configuration
from compd.errors import Problem, RecordingError
from compd.instruments import (
    ANGLE_ORDERS,
    NumberColumns,
    ReadOptions,
    read_number_columns,
    rotation_vectors,
)
from compd.recording import sidecar_contents, write_recording
from compd.units import unit_factor, unit_named, unit_of

# "X [mm]", "A (deg)", "X / mm", "X_mm": the name and its unit.
_WITH_UNIT = re.compile(r"(?P<name>.*?)\s*(?:[\[(]\s*(?P<in>[^\])]+?)\s*[\])]|/\s*(?P<after>\w+)|[_ ](?P<end>\w+))$")
_FORM = '--log "X [mm]=commanded_x_mm", or with the unit --log X=commanded_x_mm:mm'
_OWN_NAME = re.compile(
    r"(scale|joint|frame|commanded|temperature|force|pressure|humidity)_\w+|time_s|point|visit|session"
)
_TIME = "time_s"
# Options of the reader that `join` has for the export, and once more for the log.
_READ_OPTION = re.compile(r"--(?=(?:as|sheet|decimal|dates|clock-set-back|angles)\b)")


@dataclass(frozen=True)
class LogOptions:
    """What a person says of a log.

    named : "COLUMN OF THE LOG=column of a recording", the unit after a colon where the log's header has none. Columns
        that have the name of a recording's column already are taken as they are; "COLUMN=-" leaves one of them out.
    read : how the file is read, as of an instrument's export.
    """

    named: tuple[str, ...] = ()
    read: ReadOptions = field(default_factory=ReadOptions)


@dataclass(frozen=True, eq=False)
class MachineLog:
    """A log that is read.

    columns : name -> (N,) in the units of a recording; ids may be texts.
    shape, taken, left_out : as of an instrument's export.
    """

    columns: Mapping[str, FloatArray | TextArray]
    shape: str
    taken: Mapping[str, str]
    left_out: Mapping[str, int]


def is_machine_log(path: Path) -> bool:
    """Whether a file is to be read as a log: a recording has a sidecar beside it."""
    return not path.with_suffix(".yaml").is_file()


def machine_recording(out: Path) -> Path:
    """Where the log of a joined recording (`out`) is written as a recording."""
    return out.with_name(f"{out.stem}-machine.csv")


@contextmanager
def log_as_recording(
    log: Path | NumberColumns, out: Path, configuration: Configuration, options: LogOptions = LogOptions()
) -> Iterator[MachineLog]:
    """Write a log as a recording: NAME.csv (`out`) and NAME.yaml, which go again where the block fails.

    configuration : of the machine, which the sidecar names.
    Raises RecordingError as `read_machine_log` does, and where the files cannot be written.
    """
    read = read_machine_log(log, options)
    write_recording(out, read.columns, sidecar_contents(configuration.machine, machine_file=configuration.path))
    try:
        yield read
    except BaseException:
        out.unlink(missing_ok=True)
        out.with_suffix(".yaml").unlink(missing_ok=True)
        raise


def read_machine_log(log: Path | NumberColumns, options: LogOptions = LogOptions()) -> MachineLog:
    """A log's columns as those of a recording, one row for each row of the log; from the file, or its table.

    Without a column of times the rows are places at rest in their order: `point` counts them.
    Raises RecordingError with every name that is not there, every unit that is missing or of another kind, times that
    do not rise, and angles of which nobody says in which order they turn.
    """
    try:
        return _read(read_number_columns(log, options.read) if isinstance(log, Path) else log.anew(), options)
    except RecordingError as error:
        raise RecordingError(problems_of_log(error.problems)) from error


def column_roles(table: NumberColumns) -> list[str]:
    """What each column is in a recording, "NAME" or "NAME:UNIT"; "-" for nothing."""
    wanted = _wanted(table.anew(), ())
    targets = (wanted.get(k, ("-", "")) for k in range(len(table.header)))
    return [f"{name}:{unit}" if unit else name for name, unit in targets]


def named_columns(table: NumberColumns, roles: Sequence[str]) -> tuple[str, ...]:
    """The roles of all columns as `LogOptions` have them: those that no name of a column says."""
    own = column_roles(table)
    return tuple(f"{name}={role}" for name, role, said in zip(table.header, roles, own, strict=False) if role != said)


def _read(table: NumberColumns, options: LogOptions) -> MachineLog:
    problems = table.problems
    wanted = _wanted(table, options.named)
    if not wanted and not problems.problems:
        allowed = "scale_1_mm ..., or commanded_x_mm ..., under any name: " + _FORM
        problems.add(0, "no column is one of a recording", ", ".join(table.header), allowed)
    taken, left_out, columns = dict(table.taken), dict[str, int](), dict[str, FloatArray | TextArray]()
    rows = np.ones(len(table.line), dtype=bool)
    for k, (name, stated) in wanted.items():
        unit = unit_named(stated) or stated or _header_unit(table.header[k])
        if name == _TIME:
            time_unit = "s" if table.header[k] == name and not stated else unit
            time = table.time(k, time_unit, options.read)
            if time is not None:
                columns[name], rows = time.time_s, np.isfinite(time.time_s)
                taken[name] = f"{table.column_text(k)}, {time.assumed}"
            continue
        if name in TEXT_ID_COLUMNS and not table.numbers[k]:
            columns[name], taken[name] = table.texts(k), table.column_text(k)
            continue
        if not table.numbers[k]:
            problems.add(0, f"column {table.header[k]!r} has no numbers", name, "numbers, or stamps for time_s")
            continue
        values, own = _in_unit(table, k, name, unit)
        if own is not None:
            columns[name] = values
            taken[name] = f"{table.column_text(k)}{own and ', '}{own}"
    _turn(table, wanted, columns, taken, options)
    problems.check()
    if not rows.all():
        left_out["without a time"] = int((~rows).sum())
    if not rows.any():
        problems.add(0, "no row has a time", allowed="a stamp, or a number, in each row")
        problems.check()
    columns = {name: values[rows] for name, values in columns.items()}
    if not {_TIME, "point"} & set(columns):
        columns = {"point": np.arange(1.0, len(table.line) + 1), **columns}
    return MachineLog(columns, table.shape, taken, left_out)


def _wanted(table: NumberColumns, named: Sequence[str]) -> dict[int, tuple[str, str]]:
    """Column of a recording, and unit ("" for that of the header), by the place in the log."""
    problems = table.problems
    wanted = {k: (name, "") for k, name in enumerate(table.header) if _OWN_NAME.fullmatch(name)}
    numbered = {f"column {k}": k - 1 for k in range(1, len(table.header) + 1)}
    for text in named:
        source, equals, target = text.rpartition("=")
        target, _, unit = target.partition(":")
        place = table.header.index(source) if source in table.header else numbered.get(source)
        if not equals or place is None:
            what = "names no column of the log" if equals else "is not understood"
            allowed = ", ".join(table.header) if equals else _FORM
            problems.problems.append(Problem(f"--log {text}", what, value=source, allowed=allowed))
            continue
        wanted[place] = target, unit
    wanted = {k: target for k, target in wanted.items() if target[0] != "-"}
    targets = [target for target, _ in wanted.values()]
    for name in sorted({name for name in targets if targets.count(name) > 1}):
        sources = ", ".join(table.header[k] for k, (target, _) in wanted.items() if target == name)
        problems.add(0, f"{targets.count(name)} columns are {name}", sources, "one", 'leave out: --log "COLUMN=-"')
    return wanted


def _in_unit(table: NumberColumns, k: int, name: str, unit: str) -> tuple[FloatArray, str | None]:
    """(N,) in the unit of the column `name`, and the unit in the log; None with a problem."""
    header, target = table.header[k], unit_of(name)
    values = table.values(k)
    if not target or header == name:
        return values, target
    factor = unit_factor(unit, target) if unit else None
    if factor is None:
        table.problems.problems.append(
            Problem(
                f"{table.path}, column {header}",
                f"is in {unit}, which is no unit of {name}" if unit else "has no unit",
                allowed=f"a unit that can be told in {target}",
                next_step=f'say it: --log "{header}={name}:UNIT"',
            )
        )
        return values, None
    return values * factor, unit


def _turn(
    table: NumberColumns,
    wanted: Mapping[int, tuple[str, str]],
    columns: dict[str, FloatArray | TextArray],
    taken: dict[str, str],
    options: LogOptions,
) -> None:
    """The commanded attitude as a rotation vector; asks where the log has angles under other names."""
    headers = [table.header[k] for k, (name, _) in wanted.items() if name in COMMANDED_ATTITUDE_COLUMNS]
    order, problems = options.read.angles, table.problems
    if not headers or (order is None and set(headers) <= set(COMMANDED_ATTITUDE_COLUMNS)):
        return
    if len(headers) < len(COMMANDED_ATTITUDE_COLUMNS):
        missing = [name for name in COMMANDED_ATTITUDE_COLUMNS if name not in (name for name, _ in wanted.values())]
        next_step = "name a column for it; a log of a machine that does not turn about an axis has a column of zeros"
        problems.add(
            0,
            f"an attitude needs three angles, {', '.join(missing)} is missing",
            ", ".join(headers),
            ", ".join(COMMANDED_ATTITUDE_COLUMNS),
            next_step,
        )
    elif order is None or order not in ANGLE_ORDERS:
        what = "in which order its angles turn is not said" if order is None else "is no order of turning"
        value = ", ".join(headers) if order is None else order
        problems.add(0, what, value, ", ".join(ANGLE_ORDERS), "say it with --angles, such as --angles xyz")
    elif set(COMMANDED_ATTITUDE_COLUMNS) <= set(columns):
        angles = np.column_stack([columns[name] for name in COMMANDED_ATTITUDE_COLUMNS]).astype(np.float64)
        columns |= dict(zip(COMMANDED_ATTITUDE_COLUMNS, rotation_vectors(angles, order).T, strict=True))
        for name in COMMANDED_ATTITUDE_COLUMNS:
            taken[name] += ", of a rotation vector" if order == "vector" else f", in the order {order}"


def _header_unit(header: str) -> str:
    match = _WITH_UNIT.match(header.strip())
    return unit_named(match["in"] or match["after"] or match["end"] or "") if match else ""


def problems_of_log(problems: Sequence[Problem]) -> list[Problem]:
    """Problems with the options of the log in place of those of the export."""
    keys = ("what", "allowed", "next_step")
    return [replace(one, **{key: _READ_OPTION.sub("--log-", getattr(one, key)) for key in keys}) for one in problems]
