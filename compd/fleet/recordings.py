"""Recordings in directories or matching patterns, with their machines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from compd.documents import parse_yaml, read_text
from compd.errors import CompdError, Problem
from compd.fleet.fleet_recording import FleetRecording, RecordingFiles
from compd.fleet.machine_names import MachinesBy, machine_in, matches_of, name_machines
from compd.recording import SECTIONS, SIDECAR

# Suffixes of a recording's table, in order of precedence for two tables with one sidecar.
TABLES = (".csv", ".parquet")
# Columns found in recordings only: a table with one of them and without a sidecar lacks it.
_OWN_COLUMNS = ("time_s", "scale_1_mm", "reference_x_mm", "reference_link_1_mm")
# Bytes to read for the header of a table with hundreds of columns.
_HEADER_BYTES = 16384


@dataclass(frozen=True)
class FoundRecordings:
    """Contents of the searched places."""

    recordings: tuple[FleetRecording, ...]  #: in the order of their paths
    #: what a person may want to know: sidecars without a table, and how the machines were told apart
    remarks: tuple[Problem, ...]


def find_recordings(places: Sequence[str | Path], by: MachinesBy = MachinesBy.auto) -> FoundRecordings:
    """Find the recordings in directories, below them at any depth, and among the files that a pattern matches.

    Parameters
    ----------
    places : sequence of str or Path
        Directories, recordings, or patterns as a shell has them: ``"2026-*/**/*.csv"``. In a pattern ``{machine}``
        stands for the machine's name, ``{date}`` for a date: ``"data/{machine}_{date}.csv"``. A table with columns of
        a recording and without a sidecar is a recording that lacks it; any other file is none.
    by : MachinesBy
        What tells machines apart in places without ``{machine}``: `name_machines`.

    Returns
    -------
    FoundRecordings

    Raises
    ------
    CompdError
        Where a place does not exist, or no recording is in any of them.
    """
    problems: list[Problem] = []
    # sidecar -> machine by the pattern, or "", and the table; a sidecar is one recording
    tables: dict[Path, tuple[str, Path]] = {}
    alone: dict[Path, None] = {}
    for place in map(str, places):
        matches = [Path(place)] if Path(place).exists() else matches_of(place)
        if not matches:
            problems.append(
                Problem(
                    place,
                    "nothing of this name is there",
                    allowed="a directory, a recording, or a pattern in quotes: '2026-*/*.csv', '{machine}_{date}.csv'",
                )
            )
        for match in matches:
            machine = machine_in(match, place)
            for file in _candidates(match):
                table = _table(file, named=match.is_file() and match == Path(place))
                if table is not None:
                    tables.setdefault(table.with_suffix(".yaml"), (machine, table))
                elif file.suffix == ".yaml" and _looks_like_sidecar(file):
                    alone[file] = None
    if problems:
        raise CompdError(problems)
    remarks = [_without_table(sidecar) for sidecar in sorted(alone)]
    if not tables:
        raise CompdError(
            [
                Problem(
                    ", ".join(map(str, places)),
                    "has no recording",
                    allowed="NAME.csv or NAME.parquet with its sidecar NAME.yaml beside it",
                    next_step="name the directory in which recordings are",
                ),
                *remarks,
            ]
        )
    files = [(machine, RecordingFiles(table)) for _, (machine, table) in sorted(tables.items())]
    unnamed = [recording for machine, recording in files if not machine]
    names, naming = name_machines(unnamed, by) if unnamed else ([], [])
    name_of = {recording.path: name for recording, name in zip(unnamed, names, strict=True)}
    recordings = tuple(
        FleetRecording(file.path, machine or name_of[file.path], file.configuration, file.started_at)
        for machine, file in files
    )
    return FoundRecordings(recordings, (*remarks, *naming))


def _candidates(match: Path) -> Iterator[Path]:
    """The files of a directory that may be tables or sidecars, at any depth; a file itself."""
    paths = match.rglob("*") if match.is_dir() else [match]
    return (path.absolute() for path in paths if path.suffix in (*TABLES, ".yaml") and path.is_file())


def _table(file: Path, named: bool) -> Path | None:
    """The table of the recording that a file belongs to; None if there is none.

    named : whether a person named this very file: then it is taken for a recording.
    """
    sidecar = file.with_suffix(".yaml")
    if sidecar.is_file():
        return next((table for ending in TABLES if (table := file.with_suffix(ending)).is_file()), None)
    return file if named or _has_own_columns(file) else None


def _has_own_columns(file: Path) -> bool:
    """Whether a table without a sidecar has columns found in recordings only."""
    if file.suffix == ".parquet":
        import pyarrow as pa
        import pyarrow.parquet as pq

        try:
            return any(name in _OWN_COLUMNS for name in pq.read_schema(file).names)
        except (pa.ArrowInvalid, OSError):
            return False
    try:
        with file.open("rb") as opened:
            header = opened.read(_HEADER_BYTES).partition(b"\n")[0]
    except OSError:
        return False
    names = header.decode("utf-8-sig", "replace").replace(";", ",").split(",")
    return any(name.strip(' "\r') in _OWN_COLUMNS for name in names)


def _looks_like_sidecar(path: Path) -> bool:
    """Whether a YAML file names a machine and has keys of a sidecar only, unlike a configuration or a model file."""
    try:
        data, _ = parse_yaml(read_text(path, SIDECAR.name), path, SIDECAR)
    except CompdError:
        return False
    return isinstance(data, dict) and "machine" in data and set(data) <= set(SECTIONS)


def _without_table(sidecar: Path) -> Problem:
    return Problem(
        str(sidecar),
        "is a sidecar without a table, so no recording",
        allowed=" or ".join(sidecar.with_suffix(ending).name for ending in TABLES) + " beside it",
    )
