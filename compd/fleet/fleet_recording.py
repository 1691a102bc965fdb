"""A recording of a fleet: path, machine, start and contents of its files."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path

from compd.errors import CompdError
from compd.fleet.name_date import date_in
from compd.recording import Sidecar, read_sidecar


@dataclass(frozen=True)
class FleetRecording:
    """A recording and the machine that it is of."""

    path: Path  #: its table, absolute
    machine: str  #: name of the machine among those of the fleet
    configuration: str = ""  #: name of the machine's configuration, as the sidecar has it; "" if that cannot be read
    started_at: datetime | None = None  #: when the campaign began, UTC; None if nothing says so

    def __str__(self) -> str:
        return str(self.path)


@dataclass(frozen=True)
class RecordingFiles:
    """The table of a recording and its neighbouring files, before its machine is known."""

    path: Path

    @cached_property
    def sidecar(self) -> Sidecar | None:
        """Its readable part; None if unreadable."""
        try:
            return read_sidecar(self.path.with_suffix(".yaml"), [])
        except CompdError:
            return None

    @property
    def configuration(self) -> str:
        """The machine's name in the sidecar; "" if absent."""
        return "" if self.sidecar is None else self.sidecar.machine

    @property
    def started_at(self) -> datetime | None:
        """Start of the campaign (UTC) by the sidecar, else by the date in the name of the file or a directory."""
        stated = None if self.sidecar is None else self.sidecar.provenance.get("started_at")
        try:
            return _in_utc(datetime.fromisoformat(str(stated)))
        except ValueError:
            return date_in((self.path.stem, *reversed(self.path.parent.parts)))


def content_hash(path: Path) -> str:
    """SHA-256 of the recording's table, its sidecar and its ball plate; "" if one of them is unreadable."""
    sidecar = RecordingFiles(path).sidecar
    balls = None if sidecar is None or sidecar.reference is None else sidecar.reference.balls
    digest = hashlib.sha256()
    try:
        for part in (path, path.with_suffix(".yaml"), *([] if balls is None else [Path(balls)])):
            with part.open("rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
    except OSError:
        return ""
    return digest.hexdigest()


def _in_utc(time: datetime) -> datetime:
    return time.astimezone(UTC) if time.tzinfo else time.replace(tzinfo=UTC)
