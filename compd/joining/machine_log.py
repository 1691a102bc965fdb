"""The machine's own log, any workbook or delimited text, as the recording of gauges that a join takes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Configuration
from compd.errors import Problem, RecordingError
from compd.instruments import NumberColumns, ReadOptions, read_number_columns
from compd.recording import sidecar_contents, write_recording
from compd.units import unit_factor, unit_named, unit_of

# "X [mm]", "A (deg)", "X / mm", "X_mm": the name and its unit.
_WITH_UNIT = re.compile(r"(?P<name>.*?)\s*(?:[\[(]\s*(?P<in>[^\])]+?)\s*[\])]|/\s*(?P<after>\w+)|[_ ](?P<end>\w+))$")
_FORM = '--log "X [mm]=commanded_x_mm", or with the unit --log X=commanded_x_mm:mm'


def is_machine_log(path: Path) -> bool:
    """Whether a file is to be read as a log: a recording has a sidecar beside it."""
    return not path.with_suffix(".yaml").is_file()


def write_log_recording(
    log: Path, out: Path, configuration: Configuration, named: Sequence[str] = (), options: ReadOptions | None = None
) -> None:
    """Write a log as a recording: NAME.csv (`out`) and NAME.yaml, one row for each row of the log.

    configuration : of the machine, which the sidecar names.
    named : "COLUMN OF THE LOG=column of a recording", the unit after a colon where the log's header has none. Columns
        of the log that have the name of a recording's column already are taken as they are.
    options : how the file is read, as of an instrument's export.

    Without a column of times the rows are places at rest in their order: `point` counts them.
    Raises RecordingError with every name that is not there, and every unit that is missing or of another kind.
    """
    table = read_number_columns(log, options)
    problems: list[Problem] = []
    columns = _columns(table, _wanted(table, named, problems), problems)
    if not columns and not problems:
        allowed = "scale_1_mm ..., or commanded_x_mm ..., under any name: " + _FORM
        problems.append(
            Problem(
                where=str(log), what="no column is one of a recording", value=", ".join(table.names), allowed=allowed
            )
        )
    if problems:
        raise RecordingError(problems)
    if not {"time_s", "point"} & set(columns):
        columns = {"point": np.arange(1.0, len(table.values) + 1), **columns}
    write_recording(out, columns, sidecar_contents(configuration.machine, machine_file=configuration.path))


def _wanted(table: NumberColumns, named: Sequence[str], problems: list[Problem]) -> Mapping[int, tuple[str, str]]:
    """Column of a recording, and unit ("" for that of the header), by the place in the log."""
    wanted = {
        k: (name, "")
        for k, name in enumerate(table.names)
        if re.fullmatch(r"(scale|commanded|temperature|force)_\w+|time_s|point", name)
    }
    for text in named:
        source, equals, target = text.rpartition("=")
        target, _, unit = target.partition(":")
        if not equals or source not in table.names:
            what = "names no column of the log" if equals else "is not understood"
            allowed = ", ".join(table.names) if equals else _FORM
            problems.append(Problem(where=f"--log {text}", what=what, value=source, allowed=allowed))
            continue
        wanted[table.names.index(source)] = target, unit
    return wanted


def _columns(
    table: NumberColumns, wanted: Mapping[int, tuple[str, str]], problems: list[Problem]
) -> dict[str, FloatArray]:
    columns = {}
    for k, (name, stated) in wanted.items():
        unit, header = unit_of(name), table.names[k]
        own = unit_named(stated) if stated else _header_unit(header)
        if not unit or header == name:
            factor: float | None = 1.0
        else:
            factor = unit_factor(own, unit) if own else None
        if factor is None:
            problems.append(
                Problem(
                    where=f"{table.path}, column {header}",
                    what=f"is in {own}, which is no unit of {name}" if own else "has no unit",
                    value=stated,
                    allowed=f"a unit that can be told in {unit}",
                    next_step=f'say it: --log "{header}={name}:UNIT"',
                )
            )
            continue
        columns[name] = table.values[:, k] * factor
    return columns


def _header_unit(header: str) -> str:
    match = _WITH_UNIT.match(header.strip())
    return unit_named(match["in"] or match["after"] or match["end"] or "") if match else ""
