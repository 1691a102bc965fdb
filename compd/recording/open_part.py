"""The open part of a recording as Parquet: NAME.arrow, an Arrow stream readable to its last whole batch.

Parquet has its table of contents at the end, so that a file without it cannot be read. Rows that come one by one are
therefore appended to a stream, and made into Parquet when the part is closed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from compd.errors import RecordingError
from compd.files import write_files
from compd.recording.parquet_writer import arrow_batch, arrow_schema, write_parquet
from compd.tables import arrow_modules

ARROW = ".arrow"


class OpenPartFormat:
    """The bytes of an open part: `head`, then those of one batch of rows after the other."""

    def __init__(self, path: Path, names: Sequence[str]) -> None:
        """path : NAME.arrow. names : of its columns. Raises RecordingError if pyarrow is not installed."""
        self._path = path
        self._schema = arrow_schema(path, names)
        self.head = bytes(self._schema.serialize())

    def batch(self, columns: Mapping[str, Sequence[float | None]]) -> bytes:
        """One batch. columns : name -> (N,) values, None if nothing was measured."""
        return bytes(arrow_batch(self._path, self._schema, columns).serialize())


class OpenPart:
    """An interrupted NAME.arrow: its batches up to the last whole one."""

    def __init__(self, path: Path) -> None:
        """Raises RecordingError if pyarrow is not installed, and for a file that is unreadable or no stream."""
        self._path = path
        self._arrow, _ = arrow_modules(path)
        with self._file() as file:
            self.schema = self._reader(file).schema

    def batches(self) -> Iterator[Any]:
        """The record batches, without an incomplete last one."""
        with self._file() as file:
            reader = self._reader(file)
            while True:
                try:
                    batch = reader.read_next_batch()
                    batch.validate(full=True)
                except (StopIteration, OSError, MemoryError, self._arrow.ArrowException):
                    return
                yield batch

    @property
    def row_count(self) -> int:
        """Rows in whole batches."""
        return sum(batch.num_rows for batch in self.batches())

    def _file(self) -> Any:
        try:
            return self._path.open("rb")
        except OSError as error:
            raise RecordingError.of(
                str(self._path), f"cannot be read: {error.strerror}", next_step="give NAME.arrow"
            ) from error

    def _reader(self, file: Any) -> Any:
        try:
            return self._arrow.ipc.open_stream(file)
        except (OSError, MemoryError, self._arrow.ArrowException) as error:
            raise RecordingError.of(
                str(self._path),
                "is no Arrow stream, or ends before its first row",
                allowed="what `compd recording start --format parquet` left",
            ) from error


def close_part(source: Path, destination: Path) -> None:
    """Make NAME.arrow (`source`) into NAME.parquet (`destination`), whole or not at all, in constant memory.

    The source stays. Raises RecordingError for a source that cannot be read, OSError where the disk does not take it.
    """
    part = OpenPart(source)
    write_files({destination: lambda file: write_parquet(file, destination, part.schema, part.batches())}, mode=0o644)
