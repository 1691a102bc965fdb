"""One part of a recording: its CSV, its sidecar, the daemon's messages and copies of the model files."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from io import FileIO
from pathlib import Path
from typing import Any

from compd.files import sync_directory, write_new_file
from compd.json_text import encode_compact
from compd.recording.columns import SKEW_COLUMN, approach_columns, decimals, number_text
from compd.recording.sidecar import sidecar_contents, sidecar_text
from compd.units import UM_PER_MM

Message = Mapping[str, Any]

CYCLES_SUFFIX = ".cycles.jsonl"
MODEL_MARK = ".model-"


class RecordingPart:
    """NAME.csv, NAME.yaml and NAME.cycles.jsonl, for readings of one daemon with one machine zero.

    The files consist of whole lines at any time, and every row has its cycle.

    Attributes
    ----------
    first_messages : the daemon's VERSION and its answer to WATCH.
    rows : rows on the disk.
    """

    def __init__(
        self,
        stem: Path,
        first_messages: tuple[Message, Message],
        first_readings: Message,
        origin_s: float,
        started_at: str,
    ) -> None:
        """Write the sidecar and begin the other files. Raises OSError, and leaves none of them then.

        Parameters
        ----------
        stem : path of the files without their suffixes.
        first_messages : the daemon's VERSION and its answer to WATCH.
        first_readings : the first READINGS of the part.
        origin_s : monotonic time that is 0 in the column time_s.
        started_at : UTC of the first row, ISO 8601.
        """
        version, watch = self.first_messages = first_messages
        self.csv_path = stem.with_name(f"{stem.name}.csv")
        self._sidecar_path = stem.with_name(f"{stem.name}.yaml")
        self._cycles_path = stem.with_name(f"{stem.name}{CYCLES_SUFFIX}")
        self.zero: Message = first_readings["zero"]
        self.start_s: float = first_readings["time_s"]
        self.rows = 0
        self._rows_added = 0
        self._columns: Sequence[Message] = watch["columns"]
        names = ["time_s", *(column["column"] for column in self._columns), SKEW_COLUMN]
        self._decimals = {name: decimals(name) for name in names}
        self._origin_s = origin_s
        sidecar = sidecar_text(self._sidecar(version, watch, started_at)).encode()
        first_lines = b"".join(encode_compact(message).encode() + b"\n" for message in first_messages)
        self._links = len(first_readings.get("approach", ()))
        header = ",".join([*names, *approach_columns(self._links)]).encode() + b"\n"
        self._stem = stem
        self._models: dict[str, Path] = {}
        self._complete_size = 0
        try:
            self._write_complete(self._sidecar_path, sidecar)
            self._cycles = LinesFile(self._cycles_path)
            self._csv = LinesFile(self.csv_path)
            self._cycles.add(first_lines)
            self._csv.add(header)
            self.sync()
            sync_directory(stem.parent)
        except FileExistsError:
            raise  # somebody else's
        except OSError:
            self.delete()
            raise

    @property
    def size(self) -> int:
        """Bytes of all files, with what is still to be written."""
        return self._complete_size + self._cycles.size + self._csv.size

    def add(self, line: bytes, message: Message) -> None:
        """Append a READINGS message and the line in which it came; `sync` writes both."""
        self._cycles.add(line)
        self._csv.add(self._row(message).encode() + b"\n")
        self._rows_added += 1

    def copy_model(self, hash_: str, file: Path) -> str:
        """Copy a model file beside the part, once. Returns what is wrong with the file, "" where nothing is.

        Raises OSError where the copy cannot be written.
        """
        if hash_ in self._models:
            return ""
        self._models[hash_] = self._stem.with_name(f"{self._stem.name}{MODEL_MARK}{hash_}.yaml")
        try:
            content = file.read_bytes()
        except OSError as error:
            return f"cannot be read: {error.strerror}"
        if not hashlib.sha256(content).hexdigest().startswith(hash_):
            return "has changed since the daemon read it"
        self._write_complete(self._models[hash_], content)
        return ""

    def sync(self) -> None:
        """Write what was added to the disk. Raises OSError; then all that was added since the last time is lost, in
        every file.
        """
        files = (self._cycles, self._csv)
        try:
            for file in files:
                file.write()
        except OSError:
            self._rows_added = self.rows
            for file in files:
                file.cut()
            raise
        for file in files:
            file.keep()
        self.rows = self._rows_added

    def close(self) -> None:
        """Write what was added, and close the files."""
        try:
            self.sync()
        finally:
            self._cycles.close()
            self._csv.close()

    def delete(self) -> None:
        """Delete the files; the sidecar last, so that whatever is left is described."""
        for path in (self._cycles_path, self.csv_path, *self._models.values(), self._sidecar_path):
            path.unlink(missing_ok=True)

    def _write_complete(self, path: Path, content: bytes) -> None:
        write_new_file(path, content)
        self._complete_size += len(content)

    def _row(self, message: Message) -> str:
        now_s, readings = message["time_s"], message["readings"]
        cells = [self._number("time_s", now_s - self._origin_s)]
        cells += [self._cell(column, readings[column["channel"]], now_s) for column in self._columns]
        cells += [self._number(SKEW_COLUMN, message["setpoint"]["skew_s"]) if "skew_s" in message["setpoint"] else ""]
        # empty until a link has moved
        cells += [str(direction) if direction else "" for direction in message.get("approach", ())[: self._links]]
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
    """A new file to which whole lines are appended, many at a time. `size` includes those not yet written."""

    def __init__(self, path: Path) -> None:
        self.size = 0
        self._file: FileIO = FileIO(path, "xb")
        self._queue: list[bytes] = []
        self._kept = 0

    def add(self, lines: bytes) -> None:
        self._queue.append(lines)
        self.size += len(lines)

    def write(self) -> None:
        """Write the queued lines. Raises OSError: a part of them may be in the file."""
        if not self._queue:
            return
        block = memoryview(b"".join(self._queue))
        self._queue.clear()
        while block:
            block = block[self._file.write(block) :]
        os.fsync(self._file.fileno())

    def keep(self) -> None:
        """What is in the file stays there."""
        self._kept = self.size

    def cut(self) -> None:
        """Take away all that came after the last `keep`."""
        self._queue.clear()
        self._file.truncate(self._kept)
        self._file.seek(self._kept)
        self.size = self._kept

    def close(self) -> None:
        self._file.close()
