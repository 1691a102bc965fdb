"""The table of a part while it is recorded: lines of CSV, or an Arrow stream that becomes Parquet at the end."""

from __future__ import annotations

import fcntl
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from compd.columns import number_text
from compd.errors import CompdError
from compd.files import sync_directory
from compd.live.record.appended_file import AppendedFile
from compd.recording import ARROW, OpenPartFormat, close_part
from compd.table_file import CSV, PARQUET
from compd.tables import TableFormat

# One value of every column; None where nothing was measured.
Row = Sequence[float | None]
_BYTES_PER_NUMBER = 8


class PartTable(Protocol):
    """The table of one part. What was added is on the disk after `write`, and stays there after `keep`.

    Attributes
    ----------
    path : the file in the end.
    size : bytes on the disk, with what is still to be written.
    """

    path: Path

    @property
    def size(self) -> int: ...

    def begin(self) -> None:
        """Create the file. Raises OSError."""

    def add(self, row: Row) -> None: ...

    def write(self) -> None:
        """Write what was added. Raises OSError: a part of it may be in the file."""

    def keep(self) -> None: ...

    def cut(self) -> None:
        """Take away all that came after the last `keep`."""

    def close(self) -> None:
        """Make it the file that it is in the end. Raises OSError; then what was kept stays on the disk."""

    def delete(self) -> None: ...


def part_table(stem: Path, table_format: TableFormat, names: Sequence[str], in_full: Collection[str]) -> PartTable:
    """The table of a part, not begun yet.

    stem : its path without suffix. in_full : columns of CSV that are written with every digit.
    Raises RecordingError for Parquet without pyarrow.
    """
    if table_format is TableFormat.PARQUET:
        return _ParquetTable(stem, names)
    return _CsvTable(stem, names, in_full)


def close_left_parts(name: Path, report: Callable[[str], None]) -> None:
    """Make every NAME-0001.arrow that a recorder left when it was killed into NAME-0001.parquet.

    Parts that a running recorder has open are left alone, and those that cannot be read or written.
    """
    for path in sorted(name.parent.glob(f"{name.name}-[0-9][0-9][0-9][0-9]{ARROW}")):
        with path.open("r+b") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                continue
            try:
                close_part(path, path.with_suffix(PARQUET))
                path.unlink()
            except (CompdError, OSError) as error:
                report(f"{path} is left as it is: {error}")
                continue
        report(f"{path}, left by a recorder that was killed, is {path.with_suffix(PARQUET).name} now")


class _CsvTable:
    def __init__(self, stem: Path, names: Sequence[str], in_full: Collection[str]) -> None:
        self.path = stem.with_name(stem.name + CSV)
        self._header = ",".join(names).encode() + b"\n"
        self._texts = [repr if name in in_full else number_text for name in names]

    def begin(self) -> None:
        self._file = AppendedFile(self.path)
        self._file.add(self._header)

    @property
    def size(self) -> int:
        return self._file.size

    def add(self, row: Row) -> None:
        cells = ("" if value is None else text(value) for text, value in zip(self._texts, row, strict=True))
        self._file.add(",".join(cells).encode() + b"\n")

    def write(self) -> None:
        self._file.write()

    def keep(self) -> None:
        self._file.keep()

    def cut(self) -> None:
        self._file.cut()

    def close(self) -> None:
        self._file.close()

    def delete(self) -> None:
        self.path.unlink(missing_ok=True)


class _ParquetTable:
    """NAME.arrow, which can be read to the last `write` whatever ends the process; `close` makes it NAME.parquet."""

    def __init__(self, stem: Path, names: Sequence[str]) -> None:
        self.path = stem.with_name(stem.name + PARQUET)
        self._open_path = stem.with_name(stem.name + ARROW)
        self._names = names
        self._format = OpenPartFormat(self._open_path, names)
        self._rows: list[Row] = []
        self._closed_size = 0

    def begin(self) -> None:
        self._file = AppendedFile(self._open_path)
        with suppress(OSError):  # a file system without locks: then no other recorder can take the file for a left one
            fcntl.flock(self._file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._file.add(self._format.head)

    @property
    def size(self) -> int:
        return self._closed_size or self._file.size + len(self._rows) * len(self._names) * _BYTES_PER_NUMBER

    def add(self, row: Row) -> None:
        self._rows.append(row)

    def write(self) -> None:
        if self._rows:
            columns = zip(self._names, zip(*self._rows, strict=True), strict=True)
            self._file.add(self._format.batch(dict(columns)))
            self._rows.clear()
        self._file.write()

    def keep(self) -> None:
        self._file.keep()

    def cut(self) -> None:
        self._rows.clear()
        self._file.cut()

    def close(self) -> None:
        try:
            close_part(self._open_path, self.path)
            self._closed_size = self.path.stat().st_size
            self._open_path.unlink()
            sync_directory(self.path.parent)
        finally:
            self._file.close()

    def delete(self) -> None:
        for path in (self._open_path, self.path):
            path.unlink(missing_ok=True)
