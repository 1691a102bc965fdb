"""A disk of a world: full, read-only, slow; and files that a power cut has torn."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from io import FileIO
from pathlib import Path
from typing import Any
from unittest.mock import patch

from greenlet import getcurrent

from compd.files import Content, write_new_file
from tests.worlds.hub import Actor, Hub

FULL, READ_ONLY = errno.ENOSPC, errno.EROFS
# Of a full disk: what still fits of a piece, as a share.
_FITS = 0.5


class Disk:
    """What every write has to pass.

    Attributes
    ----------
    refuses : error numbers of the faults that are present; the last one is raised.
    slow_s : how long a write takes, of the faults that are present; the longest counts.
    torn : names of files that a power cut has torn, and nobody has written since.
    """

    def __init__(self, hub: Hub) -> None:
        self.refuses: list[int] = []
        self.slow_s: list[float] = []
        self.torn: set[str] = set()
        self._hub = hub

    def write(self) -> None:
        """Begin a write: the actor waits for a slow disk. Raises OSError where it is refused."""
        if self.slow_s and isinstance(getcurrent(), Actor):
            self._hub.sleep_until(self._hub.now_s + max(self.slow_s))
        if self.refuses:
            raise OSError(self.refuses[-1], os.strerror(self.refuses[-1]))

    def rename(self) -> None:
        """Begin to rename a file, for which a full disk has room. Raises OSError where it is refused."""
        with self._room():
            self.write()

    @contextmanager
    def _room(self) -> Iterator[None]:
        refuses, self.refuses = self.refuses, [code for code in self.refuses if code != FULL]
        try:
            yield
        finally:
            self.refuses = refuses

    def tear(self, path: Path, how: str) -> None:
        """Leave of a file what a power cut may: "part" of it, "nothing", or "random" bytes in its end."""
        content, rng = path.read_bytes(), self._hub.rng
        if how == "random":
            kept = len(content) // 2
            path.write_bytes(content[:kept] + rng.randbytes(len(content) - kept))
        else:
            path.write_bytes(content[: rng.randrange(len(content)) if how == "part" and content else 0])
        self.torn.add(path.name)


class _File(FileIO):
    """A file of a recorder: of what a full disk refuses a part is in it."""

    def __init__(self, disk: Disk, path: Path, mode: str) -> None:
        self._disk = disk
        super().__init__(path, mode)

    def write(self, block: Any) -> int:
        try:
            self._disk.write()
        except OSError as error:
            if error.errno == FULL:
                super().write(block[: int(_FITS * len(block))])
            raise
        return super().write(block)


@contextmanager
def recording_to(disk: Disk) -> Iterator[None]:
    """Recorders write to this disk."""

    def write_new(path: Path, content: Content) -> None:
        disk.write()
        write_new_file(path, content)

    with (
        patch("compd.live.record.appended_file.FileIO", partial(_File, disk)),
        patch("compd.live.record.recording_part.write_new_file", write_new),
    ):
        yield
