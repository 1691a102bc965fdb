"""One part of a recording: its table, its sidecar, the daemon's messages and copies of the model files."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from compd.documents import MAX_BYTES
from compd.files import read_small_file, sync_directory, write_new_file
from compd.live.record.appended_file import AppendedFile
from compd.live.record.part_table import part_table
from compd.live.record.table_rows import Message, TableRows
from compd.recording import EXTERNAL, sidecar_contents, sidecar_text
from compd.tables import TableFormat
from compd.text import encode_compact

CYCLES_SUFFIX = ".cycles.jsonl"
MODEL_MARK = ".model-"
# Class of the messages that stand among the READINGS and have no row.
ORDER = "ORDER"


class RecordingPart:
    """A table, NAME.yaml and NAME.cycles.jsonl, for readings of one daemon with one machine zero.

    The files consist of whole rows at any time, and every row has its cycle.

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
        table_format: TableFormat = TableFormat.CSV,
        machine_file: Path | None = None,
    ) -> None:
        """Write the sidecar and begin the other files. Raises OSError, and leaves none of them then.

        Parameters
        ----------
        stem : path of the files without their suffixes.
        first_messages : the daemon's VERSION and its answer to WATCH.
        first_readings : the first READINGS of the part.
        origin_s : monotonic time that is 0 in the column time_s.
        started_at : UTC of the first row, ISO 8601.
        table_format : of the table.
        machine_file : the machine's configuration, where it is known.
        """
        version, watch = self.first_messages = first_messages
        self._machine_file = machine_file
        self._sidecar_path = stem.with_name(f"{stem.name}.yaml")
        self._cycles_path = stem.with_name(f"{stem.name}{CYCLES_SUFFIX}")
        self.zero: Message = first_readings["zero"]
        self.start_s: float = first_readings["time_s"]
        self.rows = 0
        self._rows_added = 0
        self._table_rows = TableRows(watch, first_readings, origin_s)
        sidecar = sidecar_text(self._sidecar(version, watch, started_at), stem.parent).encode()
        first_lines = b"".join(encode_compact(message).encode() + b"\n" for message in first_messages)
        self._table = part_table(stem, table_format, self._table_rows.names, self._table_rows.in_full)
        self._stem = stem
        self._models: dict[str, Path] = {}
        self._complete_size = 0
        try:
            self._write_complete(self._sidecar_path, sidecar)
            self._cycles = AppendedFile(self._cycles_path)
            self._table.begin()
            self._cycles.add(first_lines)
            self.sync()
            sync_directory(stem.parent)
        except FileExistsError:
            raise  # somebody else's
        except OSError:
            self.delete()
            raise

    @property
    def path(self) -> Path:
        """The table's file when the part is closed, NAME.csv or NAME.parquet."""
        return self._table.path

    @property
    def size(self) -> int:
        """Bytes of all files, with what is still to be written."""
        return self._complete_size + self._cycles.size + self._table.size

    def add(self, line: bytes, message: Message) -> None:
        """Append a READINGS message and the line in which it came; `sync` writes both."""
        self._cycles.add(line)
        self._table.add(self._table_rows.row(message))
        self._rows_added += 1

    def add_order(self, line: bytes) -> None:
        """Append an ORDER line as it came; it has no row."""
        self._cycles.add(line)

    def copy_model(self, hash_: str, file: Path) -> str:
        """Copy a model file beside the part, once. Returns what is wrong with the file, "" where nothing is.

        Raises OSError where the copy cannot be written.
        """
        if hash_ in self._models:
            return ""
        self._models[hash_] = self._stem.with_name(f"{self._stem.name}{MODEL_MARK}{hash_}.yaml")
        try:
            # the path is what a client called the file
            content = read_small_file(file, MAX_BYTES)
        except OSError as error:
            return f"cannot be read: {error.strerror or error}"
        if not hashlib.sha256(content).hexdigest().startswith(hash_):
            return "has changed since the daemon read it"
        self._write_complete(self._models[hash_], content)
        return ""

    def sync(self) -> None:
        """Write what was added to the disk. Raises OSError; then all that was added since the last time is lost, in
        every file.
        """
        files = (self._cycles, self._table)
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
            self._table.close()

    def delete(self) -> None:
        """Delete the files; the sidecar last, so that whatever is left is described."""
        self._cycles_path.unlink(missing_ok=True)
        self._table.delete()
        for path in (*self._models.values(), self._sidecar_path):
            path.unlink(missing_ok=True)

    def _write_complete(self, path: Path, content: bytes) -> None:
        write_new_file(path, content)
        self._complete_size += len(content)

    def _sidecar(self, version: Message, watch: Message, started_at: str) -> dict[str, Any]:
        return sidecar_contents(
            version["machine"],
            provenance={
                "recorded_by": f"compd {version['release']}",
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
                    for column in watch["columns"]
                    if "sign" in column
                },
            },
            # effects of an external machine count as they are written
            quantities_at_zero=None if version["machine"] == EXTERNAL else self.zero.get("quantities"),
            machine_file=self._machine_file,
            notes="Raw readings less machine zero, before any correction: raw in mm = zero_mm + sign * column.",
        )
