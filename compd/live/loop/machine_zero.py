"""Machine zero: what every length gauge reads there, kept on disk."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from compd.errors import Problem, StateError
from compd.files import write_files

FILE_NAME = "machine-zero.json"
_FORMAT = 1
_TAKE_ONE = "bring the machine to its zero position and run `compd zero`"


@dataclass(frozen=True)
class MachineZero:
    """Raw readings (mm) by "gauge.channel", before any sign, and what they belong to.

    zero_hash : of geometry, gauges and wiring; another machine's zero is no zero.
    taken_at : UTC, ISO 8601, for people.
    """

    zero_hash: str
    taken_at: str
    readings_mm: Mapping[str, float]

    def to_json(self) -> dict[str, Any]:
        """Plain data, from which `MachineZero(**data)` is the same again."""
        return {"zero_hash": self.zero_hash, "taken_at": self.taken_at, "readings_mm": dict(self.readings_mm)}

    def save(self, directory: Path) -> Path:
        """Write it whole or not at all, so that a power cut leaves the old one or the new one.

        Raises StateError when the disk refuses.
        """
        path = directory / FILE_NAME
        text = json.dumps({"format": _FORMAT, **self.to_json()}, indent=1, allow_nan=False) + "\n"
        try:
            directory.mkdir(parents=True, exist_ok=True)
            write_files({path: text})
        except OSError as error:
            raise StateError(
                Problem(
                    where=str(path),
                    what=f"machine zero cannot be written: {error.strerror}",
                    next_step="make the state directory writable for the daemon's user, then take zero again",
                )
            ) from error
        return path


def load_zero(directory: Path, zero_hash: str, channels: tuple[str, ...]) -> MachineZero:
    """The zero on disk, if it belongs to this configuration.

    channels : every length gauge's "gauge.channel". Raises StateError where there is no zero, it cannot be
    read, or it was taken with another geometry, other gauges or another wiring.
    """
    path = directory / FILE_NAME
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise StateError(
            Problem(where=str(path), what="machine zero has never been taken", next_step=_TAKE_ONE)
        ) from error
    except OSError as error:
        raise StateError(Problem(where=str(path), what=f"machine zero cannot be read: {error.strerror}")) from error
    except ValueError as error:
        raise StateError(
            Problem(where=str(path), what=f"machine zero is not JSON: {error}", next_step=_TAKE_ONE)
        ) from error
    zero = _checked(content, path)
    if zero.zero_hash != zero_hash:
        raise StateError(
            Problem(
                where=str(path),
                what="machine zero was taken with another geometry, gauges or wiring",
                value=zero.zero_hash,
                allowed=zero_hash,
                next_step=_TAKE_ONE,
            )
        )
    if missing := sorted(set(channels) - set(zero.readings_mm)):
        raise StateError(Problem(where=str(path), what=f"machine zero lacks {', '.join(missing)}", next_step=_TAKE_ONE))
    return zero


def _checked(content: Any, path: Path) -> MachineZero:
    """The file's content, or StateError: half a zero is none."""
    match content:
        case {
            "format": int(version),
            "zero_hash": str(zero_hash),
            "taken_at": str(taken_at),
            "readings_mm": dict(readings),
        } if version == _FORMAT:
            numbers = [v for v in readings.values() if isinstance(v, int | float) and not isinstance(v, bool)]
            if len(numbers) == len(readings) and all(map(math.isfinite, numbers)):
                return MachineZero(zero_hash, taken_at, {name: float(value) for name, value in readings.items()})
    raise StateError(Problem(where=str(path), what="is not a machine zero of this release", next_step=_TAKE_ONE))
