"""One part of a recording: files of whole lines at any time, and the models that the daemon computed with."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from io import FileIO
from pathlib import Path
from typing import Any

from compd.files import sync_directory, write_new_file
from compd.json_text import encode_compact
from compd.recording.columns import approach_columns, decimals, number_text
from compd.recording.sidecar import sidecar_contents, sidecar_text
from compd.units import UM_PER_MM

Message = Mapping[str, Any]

CYCLES_SUFFIX = ".cycles.jsonl"
MODEL_MARK = ".model-"


class RecordingPart:
    """NAME.csv, NAME.yaml and NAME.cycles.jsonl, for readings with one machine zero."""

    def __init__(
        self, stem: Path, opening: Sequence[Message], first: Message, origin_s: float, started_at: str
    ) -> None:
        """`opening`: the daemon's VERSION and its answer to WATCH; `first`: the part's first READINGS.

        origin_s : monotonic time that is 0 in the column time_s. Raises OSError.
        """
        version, watch = opening
        self.csv_path = stem.with_name(f"{stem.name}.csv")
        self._sidecar_path = stem.with_name(f"{stem.name}.yaml")
        self._cycles_path = stem.with_name(f"{stem.name}{CYCLES_SUFFIX}")
        self.zero: Message = first["zero"]
        self.start_s: float = first["time_s"]
        self.rows = 0
        self._columns: Sequence[Message] = watch["columns"]
        names = ["time_s", *(column["column"] for column in self._columns)]
        self._decimals = {name: decimals(name) for name in names}
        self._origin_s = origin_s
        sidecar = sidecar_text(self._sidecar(version, watch, started_at)).encode()
        opened = b"".join(encode_compact(message).encode() + b"\n" for message in opening)
        self._links = len(first.get("approach", ()))
        header = ",".join([*names, *approach_columns(self._links)]).encode() + b"\n"
        self._stem = stem
        self._models: dict[str, Path] = {}
        self._whole_size = 0
        self._write_whole(self._sidecar_path, sidecar)
        self._cycles = LinesFile(self._cycles_path)
        self._csv = LinesFile(self.csv_path)
        self._cycles.add(opened)
        self._csv.add(header)
        self.sync()
        sync_directory(stem.parent)

    @property
    def size(self) -> int:
        """Bytes of all files, with what waits to be written."""
        return self._whole_size + self._cycles.size + self._csv.size

    def add(self, line: bytes, message: Message) -> None:
        """One READINGS message and the line that it came in; `sync` writes it."""
        self._cycles.add(line)
        self._csv.add(self._row(message).encode() + b"\n")
        self.rows += 1

    def keep_model(self, hash_: str, file: Path) -> str:
        """Copy a model file beside the part, once; what is wrong with it, "" where nothing is. Raises OSError where
        the copy cannot be written."""
        if hash_ in self._models:
            return ""
        self._models[hash_] = self._stem.with_name(f"{self._stem.name}{MODEL_MARK}{hash_}.yaml")
        try:
            content = file.read_bytes()
        except OSError as error:
            return f"cannot be read: {error.strerror}"
        if not hashlib.sha256(content).hexdigest().startswith(hash_):
            return "has changed since the daemon read it"
        self._write_whole(self._models[hash_], content)
        return ""

    def sync(self) -> None:
        """What waits, onto the disk. Raises OSError; the files then end with the last line that is whole."""
        self._cycles.sync()
        self._csv.sync()

    def close(self) -> None:
        """Nothing is added any more."""
        try:
            self.sync()
        finally:
            self._cycles.close()
            self._csv.close()

    def delete(self) -> None:
        """Remove the files; the sidecar last, so that what is left says what it was."""
        for path in (self._cycles_path, self.csv_path, *self._models.values(), self._sidecar_path):
            path.unlink(missing_ok=True)

    def _write_whole(self, path: Path, content: bytes) -> None:
        write_new_file(path, content)
        self._whole_size += len(content)

    def _row(self, message: Message) -> str:
        now_s, readings = message["time_s"], message["readings"]
        cells = [self._number("time_s", now_s - self._origin_s)]
        cells += [self._cell(column, readings[column["channel"]], now_s) for column in self._columns]
        # empty until a link has moved
        cells += [str(way) if way else "" for way in message.get("approach", ())[: self._links]]
        return ",".join(cells)

    def _cell(self, column: Message, reading: Message, now_s: float) -> str:
        """Empty where the reading is not good, or too old for the daemon to use."""
        if "value" not in reading or now_s - reading["time_s"] > column["stale_after_s"]:
            return ""
        value, name = reading["value"], column["column"]
        if "sign" not in column:
            return repr(value)
        change_mm = column["sign"] * (value - self.zero["readings_mm"][column["channel"]])
        return self._number(name, change_mm * UM_PER_MM if name.endswith("_um") else change_mm)

    def _number(self, column: str, value: float) -> str:
        """`value` with the decimals of its column; -0 is written as 0."""
        places = self._decimals[column]
        return number_text((value if places is None else round(value, places)) + 0.0)

    def _sidecar(self, version: Message, watch: Message, started_at: str) -> dict[str, Any]:
        return sidecar_contents(
            version["machine"],
            provenance={
                "recorded_by": f"compd record {version['release']}",
                "config_hash": version["config_hash"],
                "started_at": started_at,
                "started_at_monotonic_s": self.start_s,
                "rate_hz": watch.get("rate_hz", "every cycle"),
                "cycles": self._cycles_path.name,
                "zero_taken_at": self.zero["taken_at"],
                "zero": {
                    column["column"]: {
                        "channel": column["channel"],
                        "sign": column["sign"],
                        "zero_mm": self.zero["readings_mm"][column["channel"]],
                    }
                    for column in self._columns
                    if "sign" in column
                },
            },
            notes="Raw readings less machine zero, before any correction: raw in mm = zero_mm + sign * column.",
        )


class LinesFile:
    """A new file to which only whole lines are added, many at a time."""

    def __init__(self, path: Path) -> None:
        self.size = 0
        self._file: FileIO = FileIO(path, "xb")
        self._waiting: list[bytes] = []
        self._written = 0

    def add(self, lines: bytes) -> None:
        self._waiting.append(lines)
        self.size += len(lines)

    def sync(self) -> None:
        """Write what waits. Raises OSError, and takes back the half line that a full disk leaves."""
        if not self._waiting:
            return
        block = memoryview(b"".join(self._waiting))
        self._waiting.clear()
        try:
            while block:
                block = block[self._file.write(block) :]
            os.fsync(self._file.fileno())
        except OSError:
            self._file.truncate(self._written)
            raise
        self._written = self.size

    def close(self) -> None:
        self._file.close()
