"""A file that grows by whole pieces, and of which nothing is taken for kept that the disk may lose."""

from __future__ import annotations

import os
from io import FileIO
from pathlib import Path


class AppendedFile:
    """A new file to which whole pieces are appended, many at a time. `size` includes those not yet written."""

    def __init__(self, path: Path) -> None:
        self.size = 0
        self._file: FileIO = FileIO(path, "xb")
        self._queue: list[bytes] = []
        self._kept = 0

    def add(self, piece: bytes) -> None:
        """Append whole lines, or another piece of which no part is of use."""
        self._queue.append(piece)
        self.size += len(piece)

    def write(self) -> None:
        """Write the queued pieces. Raises OSError: a part of them may be in the file."""
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

    def fileno(self) -> int:
        """The file's descriptor."""
        return self._file.fileno()

    def close(self) -> None:
        self._file.close()
