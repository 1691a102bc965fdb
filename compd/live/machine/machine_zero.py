"""Machine zero: what every gauge reads at the machine's zero position, and its file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import structlog
from pydantic import BaseModel, ConfigDict, FiniteFloat, ValidationError

from compd.errors import Problem, StateError
from compd.files import CHECKSUM, FileKind, checksum_of
from compd.live.system import System

FILE_NAME = "machine-zero.json"
# The machine zero before the present one, as its file was.
OLD_FILE_NAME = "machine-zero.json.old"
# Format 1, of releases up to 0.2, has no checksum; neither 1 nor 2 has quantities and ports.
_FORMAT = 3
_MAX_FILE_BYTES = 1_000_000
_MAKE_WRITABLE = "make the state directory writable for the daemon's user, then take zero again"
_TAKE_ONE = "bring the machine to its zero position and run `compd zero`"

log = structlog.get_logger()


class _ZeroFile(BaseModel):
    """The file of a machine zero. Strict: "1" is no number and 1 no text."""

    model_config = ConfigDict(strict=True)

    format: Literal[1, 2, 3]
    zero_hash: str
    taken_at: str
    readings_mm: dict[str, FiniteFloat]
    quantities: dict[str, FiniteFloat] = {}
    ports: dict[str, str] = {}
    checksum: str = ""


ZERO_FILE = FileKind(
    "a machine zero",
    frozenset({"zero_hash", "taken_at", "readings_mm"}),
    least=2,
    others=frozenset(_ZeroFile.model_fields),
    next_step=_TAKE_ONE,
)


@dataclass(frozen=True)
class MachineZero:
    """Raw readings of all length gauges at machine zero, and the quantities there.

    zero_hash : of geometry, gauges and wiring. The zero of a machine with another hash must not be used.
    taken_at : UTC, ISO 8601, for people.
    readings_mm : by "gauge.channel", as read: before any sign.
    quantities : temperatures, forces and so on by name, in their own units, from which effects count; of a zero of a
        release up to 0.2, and of one that was taken without the gauge, it is not there.
    ports : lasting names of the ports where they were read, by gauge; only in the file, not in recordings.
    """

    zero_hash: str
    taken_at: str
    readings_mm: Mapping[str, float]
    quantities: Mapping[str, float] = field(default_factory=dict)
    ports: Mapping[str, str] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Plain data from which `MachineZero(**data)` makes the same zero again."""
        content = {"zero_hash": self.zero_hash, "taken_at": self.taken_at, "readings_mm": dict(self.readings_mm)}
        return content | ({"quantities": dict(self.quantities)} if self.quantities else {})

    @property
    def _kept(self) -> dict[str, Any]:
        """What the file has of it."""
        return self.to_json() | ({"ports": dict(self.ports)} if self.ports else {})

    def changes_mm(self, before: MachineZero) -> dict[str, float]:
        """By how much each gauge reads more here than in `before`, by channel, mm; of the channels that both have."""
        return {
            channel: reading_mm - before.readings_mm[channel]
            for channel, reading_mm in self.readings_mm.items()
            if channel in before.readings_mm
        }

    def save(self, directory: Path, system: System) -> Path:
        """Write the file in this directory, and return its path. After a power cut it is the old one or the new one.

        The file that was there stays beside it as OLD_FILE_NAME. Raises StateError when the disk refuses.
        """
        path = directory / FILE_NAME
        content = {"format": _FORMAT, **self._kept, CHECKSUM: checksum_of(self._kept)}
        text = json.dumps(content, indent=1, allow_nan=False) + "\n"
        try:
            system.write_files({**_old_file(directory, system), path: text})
        except OSError as error:
            raise StateError.of(
                str(path),
                f"machine zero cannot be written: {error.strerror}",
                next_step=_MAKE_WRITABLE,
            ) from error
        return path


def _old_file(directory: Path, system: System) -> dict[Path, bytes]:
    """The machine zero in this directory until now, to be kept: path and content; nothing where there is none.

    Raises OSError where it is there and cannot be kept.
    """
    try:
        return {directory / OLD_FILE_NAME: system.read_file(directory / FILE_NAME, _MAX_FILE_BYTES)}
    except FileNotFoundError:
        return {}


def withdraw_zero(directory: Path, system: System) -> None:
    """Take the machine zero in this directory out of use, before its gauges are accepted to take another one.

    A daemon that starts before the other one is written would use it with gauges that have lost their counts. The file
    stays as OLD_FILE_NAME. Raises StateError when the disk refuses.
    """
    path = directory / FILE_NAME
    try:
        system.rename(path, directory / OLD_FILE_NAME)
    except FileNotFoundError:
        pass
    except OSError as error:
        raise StateError.of(
            str(path), f"machine zero cannot be replaced: {error.strerror}", next_step=_MAKE_WRITABLE
        ) from error


def zero_at_start(
    directory: Path, zero_hash: str, channels: tuple[str, ...], has_gauges: bool, system: System
) -> MachineZero | StateError:
    """The machine zero on disk, or why there is none: the daemon runs without one, so that it can be taken.

    Without any gauge nothing is read at machine zero, and nobody has to take it: it is made, and kept as any other.

    zero_hash, channels : as of `load_zero`.
    """
    try:
        zero = load_zero(directory, zero_hash, channels, system)
    except StateError as error:
        if has_gauges:
            log.warning("no machine zero", reason=str(error))
            return error
        zero = MachineZero(zero_hash, system.utc().isoformat(timespec="seconds"), {})
        with suppress(StateError):  # without a disk it is another one after the next start
            zero.save(directory, system)
    log.info("machine zero", taken_at=zero.taken_at)
    return zero


def load_zero(directory: Path, zero_hash: str, channels: tuple[str, ...], system: System) -> MachineZero:
    """The machine zero in the file in this directory.

    Parameters
    ----------
    zero_hash : of the configuration.
    channels : "gauge.channel" of every length gauge in it.

    Raises
    ------
    StateError
        There is no file, it cannot be read, is damaged or was changed by hand, a later release wrote it, it was taken
        with another geometry, other gauges or another wiring, or it lacks a channel.
    """
    path = directory / FILE_NAME
    try:
        content = json.loads(system.read_file(path, _MAX_FILE_BYTES).decode())
    except FileNotFoundError as error:
        withdrawn = system.has_file(directory / OLD_FILE_NAME)
        what = f"was withdrawn to take it anew; it is in {OLD_FILE_NAME}" if withdrawn else "has never been taken"
        raise StateError.of(str(path), f"machine zero {what}", next_step=_TAKE_ONE) from error
    except OSError as error:
        raise StateError.of(str(path), f"machine zero cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise StateError.of(str(path), f"machine zero is not JSON: {error}", next_step=_TAKE_ONE) from error
    zero = _parse_zero(content, path)
    if zero.zero_hash != zero_hash:
        raise StateError.of(
            str(path),
            "machine zero was taken with another geometry, gauges or wiring",
            value=zero.zero_hash,
            allowed=zero_hash,
            next_step=_TAKE_ONE,
        )
    if missing := sorted(set(channels) - set(zero.readings_mm)):
        raise StateError.of(str(path), f"machine zero lacks {', '.join(missing)}", next_step=_TAKE_ONE)
    return zero


def _parse_zero(content: Any, path: Path) -> MachineZero:
    """The machine zero in the content of the file. Raises StateError for anything that is wrong with it."""
    if not ZERO_FILE.recognises(content):
        raise StateError(ZERO_FILE.refused(path))
    if isinstance(content, dict) and isinstance(version := content.get("format"), int) and version > _FORMAT:
        raise StateError.of(
            str(path),
            "was written by a later release of compd",
            value=f"format {version}",
            allowed=f"format {_FORMAT}",
            next_step="install that release, or move the file away and take machine zero with this one",
        )
    try:
        file = _ZeroFile.model_validate(content)
    except ValidationError as error:
        raise StateError(
            [
                Problem(
                    ": ".join([str(path), *map(str, detail["loc"])]),
                    f"is not a machine zero: {detail['msg']}",
                    next_step=_TAKE_ONE,
                )
                for detail in error.errors(include_url=False)
            ]
        ) from error
    zero = MachineZero(file.zero_hash, file.taken_at, file.readings_mm, file.quantities, file.ports)
    if file.format == 1:
        log.warning("machine zero has no checksum: what was changed in it cannot be seen", path=str(path))
    elif file.checksum != (checksum := checksum_of(zero._kept)):
        raise StateError.of(
            str(path),
            "was changed after it was written: its checksum does not fit",
            value=file.checksum or "no checksum",
            allowed=checksum,
            next_step=f"{_TAKE_ONE}; the one before it is in {OLD_FILE_NAME}",
        )
    return zero
