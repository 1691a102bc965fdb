"""The results of a fleet as one Parquet table, which pandas, DuckDB and any other program read.

A row is one parameter of one effect on one recording. What is said of the recording as a whole stands in each of its
rows; a recording without any effect has one row, in which the effect's columns are empty. Example::

    write_table(Path("fleet.parquet"), results)
    assert read_table(Path("fleet.parquet")) == results
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from compd.errors import CompdError
from compd.files import check_replaceable, write_files
from compd.fleet.recording_result import Command, FleetEstimate, RecordingResult

if TYPE_CHECKING:
    import pyarrow as pa

# Version in the schema's metadata; it changes with the meaning of a column.
FORMAT_KEY, FORMAT = b"compd.fleet.format", b"2"


class TableColumn(NamedTuple):
    """A column of the table: its name, Arrow's name of its type, what it holds."""

    name: str
    type: str
    meaning: str


OF_RECORDING = (
    TableColumn("recording", "string", "path of the recording's table"),
    TableColumn("machine", "string", "name of its machine in the fleet; empty where nothing says which it is"),
    TableColumn("kinematics", "string", "tripod_3spr, hexapod_6ups, or external"),
    TableColumn("command", "string", "compare or diagnose"),
    TableColumn("model", "string", "the model file that was applied; empty for none"),
    TableColumn(
        "started_at", "timestamp", "when the campaign began, UTC; empty where neither sidecar nor name says it"
    ),
    TableColumn("rows", "int64", "rows of the recording that counted"),
    TableColumn("error_unit", "string", "unit of the columns that end in _um, um but for recordings in another unit"),
    TableColumn("rms_before_um", "double", "error per coordinate with the model as it is"),
    TableColumn("rms_after_um", "double", "error with the effects of this recording, fitted on it"),
    TableColumn("noise_floor_um", "double", "what noise alone would be; empty where it is not known"),
    TableColumn("verdict", "string", "of diagnose its verdict; of compare at_floor, above_floor, noise_not_known"),
    TableColumn("summary", "string", "the verdict in words"),
)
OF_EFFECT = (
    TableColumn("effect", "string", "id of an effect that was found, or that the model has"),
    TableColumn("parameter", "string", "one of its parameters"),
    TableColumn("value", "double", "fitted on this recording, in `unit`"),
    TableColumn("standard_error", "double", "of the value, in `unit`; empty where it is not known"),
    TableColumn("unit", "string", "of value and standard_error"),
    TableColumn("p_value", "double", "probability that noise resembles the effect; empty for effects of the model"),
    TableColumn("plausible", "bool", "whether the value lies in the effect's plausible range"),
    TableColumn("rivals", "string", "effects that would do as well in its place, separated by spaces"),
)
PROBLEM = TableColumn("problem", "string", "why the recording could not be examined; empty where it was")
BASIS = TableColumn("basis", "string", "hash of what the result follows from: files, model, options, release")
COLUMNS = (*OF_RECORDING, *OF_EFFECT, PROBLEM, BASIS)


def check_table_path(path: Path, command: Command, overwrite: bool = False) -> None:
    """Raise CompdError if the table cannot be written, before the long work.

    An earlier table of this command is continued; one of the other command, which may have taken hours, is not replaced
    unless `overwrite`.
    """
    if not path.parent.is_dir():
        raise CompdError.of(str(path), "its directory does not exist", value=str(path.parent), next_step="make it")
    if not is_table(path):
        check_replaceable(path, (), "", overwrite)
        return
    if overwrite or not (other := {result.command for result in earlier_results(path)} - {command}):
        return
    raise CompdError.of(
        str(path),
        f"has results of `compd fleet {other.pop()}`, which would be lost",
        next_step="give this table a name of its own (--out), or replace that one (--overwrite)",
    )


def is_table(path: Path) -> bool:
    """Whether a file is a table of a fleet."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not path.is_file():
        return False
    try:
        return FORMAT_KEY in (pq.read_schema(path).metadata or {})
    except (pa.ArrowInvalid, OSError):
        return False


def write_table(path: Path, results: Sequence[RecordingResult]) -> None:
    """Write the table, whole or not at all; an existing file is replaced."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.Table.from_pylist([row for result in results for row in rows_of(result)], schema=_schema())
    buffer = io.BytesIO()
    pq.write_table(table, buffer, compression="zstd")
    write_files({path: buffer.getvalue()})


def read_table(path: Path) -> tuple[RecordingResult, ...]:
    """The results of a table as given to `write_table`. Raises CompdError for any other file."""
    import pyarrow.parquet as pq

    if not is_table(path):
        raise CompdError.of(
            str(path),
            "is not a table of a fleet",
            allowed="what `compd fleet diagnose` or `compd fleet compare` has written",
            next_step="give that table, or the directory of the recordings",
        )
    table = pq.read_table(path)
    if table.schema.metadata[FORMAT_KEY] != FORMAT:
        raise CompdError.of(
            str(path),
            "was written by another release of compd",
            value=table.schema.metadata[FORMAT_KEY].decode(errors="replace"),
            allowed=FORMAT.decode(),
            next_step="create the table again",
        )
    by_recording = groupby(table.to_pylist(), key=lambda row: (row["recording"], row["command"]))
    return tuple(_result(list(rows)) for _, rows in by_recording)


def earlier_results(path: Path) -> tuple[RecordingResult, ...]:
    """The results of an existing table; none if it is missing or has another release's format."""
    try:
        return read_table(path)
    except CompdError:
        return ()


def rows_of(result: RecordingResult) -> Iterator[dict[str, Any]]:
    """The rows of one recording: column -> value, None if there is none."""
    whole = _cells(result, OF_RECORDING)
    whole |= {"rows": None if result.problem else result.rows, PROBLEM.name: result.problem or None}
    whole[BASIS.name] = result.basis or None
    for estimate in result.estimates:
        yield {**whole, **_cells(estimate, OF_EFFECT), "rivals": " ".join(estimate.rivals) or None}
    if not result.estimates:
        yield whole


def _schema() -> pa.Schema:
    import pyarrow as pa

    types = {
        "string": pa.string(),
        "double": pa.float64(),
        "int64": pa.int64(),
        "bool": pa.bool_(),
        "timestamp": pa.timestamp("us", tz="UTC"),
    }
    fields = [pa.field(name, types[kind], metadata={"meaning": meaning}) for name, kind, meaning in COLUMNS]
    return pa.schema(fields, metadata={FORMAT_KEY: FORMAT})


def _cells(source: object, columns: Iterable[TableColumn]) -> dict[str, Any]:
    """The columns that are attributes of a result; None for unknown values."""
    cells = {column.name: getattr(source, column.name) for column in columns}
    return {name: None if value == "" or _is_nan(value) else value for name, value in cells.items()}


def _result(rows: Sequence[Mapping[str, Any]]) -> RecordingResult:
    """The result of these rows."""
    estimates = [
        FleetEstimate(**{**_known(row, OF_EFFECT), "rivals": tuple((row["rivals"] or "").split())})
        for row in rows
        if row["effect"] is not None
    ]
    began = rows[0]["started_at"]
    whole = {
        **_known(rows[0], OF_RECORDING),
        "started_at": None if began is None else began.astimezone(UTC),
        "rows": rows[0]["rows"] or 0,
    }
    problem, basis = (rows[0][column.name] or "" for column in (PROBLEM, BASIS))
    return RecordingResult(**whole, estimates=tuple(estimates), problem=problem, basis=basis)


def _known(row: Mapping[str, Any], columns: Iterable[TableColumn]) -> dict[str, Any]:
    """The cells of these columns, with "" and nan for empty cells."""
    empty = {"string": "", "double": math.nan}
    return {column.name: empty.get(column.type) if row[column.name] is None else row[column.name] for column in columns}


def _is_nan(value: object) -> bool:
    return isinstance(value, float) and math.isnan(value)
