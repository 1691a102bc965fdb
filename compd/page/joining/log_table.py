"""The machine's own log in the join wizard: its first rows, and what each column is in a recording."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from compd.columns import (
    COMMANDED_ATTITUDE_COLUMNS,
    COMMANDED_COLUMNS,
    frame_columns,
    joint_columns,
    scale_columns,
)
from compd.configuration import Configuration, load_machine
from compd.errors import RecordingError
from compd.instruments import ExportPreview, NumberColumns, ReadOptions, preview_table
from compd.joining import column_roles, named_columns, problems_of_log, read_machine_log
from compd.page.joining.choices import Choices


class LogPreview(NamedTuple):
    """The top of a log, and its table; None where `preview.problems` say why there is none."""

    preview: ExportPreview
    table: NumberColumns | None


def preview_log(path: Path, options: ReadOptions) -> LogPreview:
    """Read a log as a join reads it; what is wrong with it is beside what could be read."""
    preview, table = preview_table(path, options)
    try:
        columns = None if table is None else NumberColumns.of(table)
    except RecordingError as error:
        columns, preview = None, replace(preview, problems=error.problems)
    return LogPreview(replace(preview, problems=problems_of_log(preview.problems)), columns)


def with_named_columns(choices: Choices, log: LogPreview) -> Choices:
    """The choices with the roles of the log's columns by the columns' names, as the command line has them."""
    if choices.log is None or log.table is None:
        return choices
    named = named_columns(log.table, choices.log_roles) if choices.log_roles else ()
    return replace(choices, log=replace(choices.log, named=named))


def log_contents(log: LogPreview, choices: Choices, machine: Path | None) -> dict[str, Any]:
    """The preview for a browser. `names`: columns of a recording that a column of the log may be.

    machine : the page's configuration.
    """
    preview, table = log
    choices = with_named_columns(choices, log)
    problems, taken, rows, left_out, roles = list(preview.problems), dict(preview.assumed), 0, {}, list(preview.roles)
    names = [] if machine is None else list(_names(load_machine(machine)))
    if machine is None:
        problems += without_machine().problems
    if table is not None and choices.log is not None:
        roles = column_roles(table)
        if len(choices.log_roles) == len(roles):
            roles = list(choices.log_roles)
        try:
            read = read_machine_log(table, choices.log)
        except RecordingError as error:
            problems += error.problems
        else:
            taken, left_out = dict(read.taken), dict(read.left_out)
            rows = len(next(iter(read.columns.values())))
    return {
        "shape": preview.shape,
        "line": list(preview.line),
        "rows": [list(row) for row in preview.rows],
        "header": list(preview.header),
        "roles": roles,
        "names": names,
        "assumed": taken,
        "sheets": list(preview.sheets),
        "problems": [str(problem) for problem in problems],
        "points": rows,
        "left_out": left_out,
    }


def without_machine() -> RecordingError:
    """A log does not say of which machine it is."""
    return RecordingError.of(
        "log",
        "the page knows no machine that the log could be of",
        allowed="the machine's configuration",
        next_step="start the page with it: compd page --daemon MACHINE.yaml",
    )


def _names(configuration: Configuration) -> Iterator[str]:
    yield from ("time_s", "point", "visit", "session")
    yield from COMMANDED_COLUMNS + COMMANDED_ATTITUDE_COLUMNS
    yield from scale_columns(len(configuration.wiring.scale) or configuration.geometry.links)
    yield from joint_columns(len(configuration.wiring.joint))
    yield from frame_columns(len(configuration.wiring.frame)) if configuration.wiring.frame else ()
    yield from (wire.name for wire in configuration.wiring.quantities)
