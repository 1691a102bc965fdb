"""The files that the join wizard's requests name, and those that it offers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from compd.errors import RecordingError
from compd.page.recordings import NAME, recording_tables
from compd.recording import read_sidecar
from compd.table_file import CSV


def gauges_and_plans(directory: Path) -> tuple[list[str], list[str]]:
    """Names of the recordings without a reference, and of the CSV files without a sidecar, the newest first."""
    own = [path for name, path in recording_tables(directory).items() if NAME.fullmatch(name)]
    gauges, plans = [], []
    for path in sorted(own, key=lambda path: path.stat().st_mtime, reverse=True):
        sidecar = path.with_suffix(".yaml")
        if not sidecar.is_file():
            plans += [path.stem] * (path.suffix == CSV)
        elif (read := read_sidecar(sidecar, [])) is not None and read.reference is None:
            gauges.append(path.stem)
    return gauges, plans


def named(directory: Path, keys: Mapping[str, Any], key: str) -> Path | None:
    """The recording or plan that a key names; None without a name. Raises RecordingError if it is missing."""
    name = str(keys.get(key) or "")
    path = recording_tables(directory).get(name)
    if name and not (NAME.fullmatch(name) and path):
        raise missing(key, f"there is no such {key}")
    return path


def missing(where: str, what: str, next_step: str = "") -> RecordingError:
    """The required name in a request."""
    return RecordingError.of(where, what, next_step=next_step)
