"""Exports of instruments in the directory `exports/` beside the recordings: list, upload, delete.

What a browser brings is kept under its name and SUFFIX: nothing imports, runs or reads a file of that suffix by itself,
whatever its content is.
"""

from __future__ import annotations

import asyncio
import filecmp
import os
import re
import secrets
import stat
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from compd.errors import RecordingError

SUFFIX = ".export"
# NAME or NAME.ext, with SUFFIX for an upload of this release: a valid file name on every system, never a path.
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}(\.[A-Za-z0-9]{1,8})?")
EXPORT_NAME = re.compile(rf"{_NAME.pattern}({re.escape(SUFFIX)})?")
# Largest file (bytes): some million rows.
MAX_BYTES = 64 * 2**20
# Largest total (bytes) of the directory, including running uploads.
MAX_FILES = 200
MAX_BYTES_OF_ALL = 16 * MAX_BYTES
# Mode of a file: readable by the page's group for backups, never executable.
_MODE = 0o640
_TEMPORARY = re.compile(r"\.[0-9a-f]{16}")
# Age (s) of the last write from which a partial file belongs to an ended process.
_LEFT_AFTER_S = 3600.0
_NOT_IN_A_NAME = re.compile(r"[^A-Za-z0-9_-]+")
_MAX_STEM = 64
_DIRECTORY = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW
_NEW_FILE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC


class Usage(NamedTuple):
    """Contents of the directory."""

    files: int
    bytes: int

    def as_json(self) -> dict[str, int]:
        """The contents beside the limits."""
        return {**self._asdict(), "most_files": MAX_FILES, "most_bytes": MAX_BYTES_OF_ALL}


class Exports:
    """Exports in `directory`, which may be created later; used by the event loop's thread alone."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        # temporary name -> bytes written so far
        self._arriving: dict[str, int] = {}

    def listed(self) -> list[str]:
        """Their names, the newest first."""
        by_age = [(-status.st_mtime, name) for name, status in self._entries() if _is_export(name, status)]
        return [name for _, name in sorted(by_age)]

    def path_of(self, name: str) -> Path | None:
        """The file of that name; None if it is missing, or if it or the directory is a link."""
        path = self.directory / name
        is_file = EXPORT_NAME.fullmatch(name) and path.is_file() and not path.is_symlink()
        return path if is_file and not self.directory.is_symlink() else None

    def usage(self) -> Usage:
        """Size of everything in the directory, under any name."""
        sizes = [status.st_size for _, status in self._entries()]
        return Usage(len(sizes), sum(sizes))

    def delete(self, name: str) -> bool:
        """Delete the export of that name; False if there is none. Raises RecordingError if the disk refuses."""
        if not EXPORT_NAME.fullmatch(name):
            return False
        with self._opened() as directory:
            try:
                if not _is_export(name, os.stat(name, dir_fd=directory, follow_symlinks=False)):
                    return False
                os.unlink(name, dir_fd=directory)
            except FileNotFoundError:
                return False
            except OSError as error:
                raise _refused(name, f"cannot be deleted: {error.strerror}") from error
        return True

    async def keep(self, file_name: str, pieces: AsyncIterator[bytes]) -> dict[str, Any]:
        """Store an upload; return its `name` here and its `bytes`.

        file_name : the file's name on the person's computer; what cannot stand in a name here becomes "-".

        Raises RecordingError for a name that is none, for a file that is empty, or another than the one that has its
        name already; where all files would be more than MAX_FILES or MAX_BYTES_OF_ALL; and where the disk refuses.
        """
        name = kept_name(file_name)
        self.directory.mkdir(parents=True, exist_ok=True)
        temporary = f".{secrets.token_hex(8)}"
        with self._opened() as directory:
            try:
                self._remove_left(directory)
                count = await self._written(directory, temporary, pieces)
                if not count:
                    raise _refused(name, "is empty", allowed="an instrument's export")
                await asyncio.to_thread(self._name, directory, temporary, name)
            except OSError as error:
                raise _refused(str(self.directory), f"cannot be written to: {error.strerror}") from error
            finally:
                self._arriving.pop(temporary, None)
                _removed(directory, temporary)
        return {"name": name, "bytes": count}

    async def _written(self, directory: int, temporary: str, pieces: AsyncIterator[bytes]) -> int:
        """Number of bytes in the new file so far."""
        kept = self._kept_before()
        if kept.files + len(self._arriving) >= MAX_FILES:
            raise _full(kept.files + len(self._arriving), kept.bytes + sum(self._arriving.values()))
        self._arriving[temporary] = 0
        with os.fdopen(os.open(temporary, _NEW_FILE, _MODE, dir_fd=directory), "wb") as file:
            os.fchmod(file.fileno(), _MODE)  # independent of the umask
            async for piece in pieces:
                self._arriving[temporary] += len(piece)
                # a file completed meanwhile is in the directory and no longer arriving: looked up again near the end
                self._require_room(kept)
                await asyncio.to_thread(file.write, piece)  # the disk may lag
        self._require_room(self._kept_before())
        return self._arriving[temporary]

    def _require_room(self, kept: Usage) -> None:
        """Raises RecordingError if stored and arriving files exceed the limits."""
        total = kept.bytes + sum(self._arriving.values())
        if total > MAX_BYTES_OF_ALL:
            raise _full(kept.files + len(self._arriving), total)

    def _kept_before(self) -> Usage:
        """Contents of the directory without running uploads."""
        sizes = [status.st_size for name, status in self._entries() if name not in self._arriving]
        return Usage(len(sizes), sum(sizes))

    def _name(self, directory: int, temporary: str, name: str) -> None:
        """Give a file its name, never replacing another: equal bytes may come again, others need a new name."""
        try:
            os.link(temporary, name, src_dir_fd=directory, dst_dir_fd=directory, follow_symlinks=False)
        except FileExistsError:
            path = self.path_of(name)
            if path is None or not filecmp.cmp(self.directory / temporary, path, shallow=False):
                raise _refused(
                    name, "is there already, with other content", next_step="rename the file, then bring it again"
                ) from None

    def _remove_left(self, directory: int) -> None:
        """Remove temporary files of processes that have ended in the middle of one."""
        for name, status in self._entries():
            left = name not in self._arriving and time.time() - status.st_mtime > _LEFT_AFTER_S
            if left and _TEMPORARY.fullmatch(name):
                _removed(directory, name)

    def _entries(self) -> Iterator[tuple[str, os.stat_result]]:
        """Name and status of every entry of the directory; a link is not followed."""
        if self.directory.is_symlink() or not self.directory.is_dir():
            return
        with os.scandir(self.directory) as entries:
            for entry in entries:
                try:
                    yield entry.name, entry.stat(follow_symlinks=False)
                except FileNotFoundError:  # removed meanwhile
                    continue

    @contextmanager
    def _opened(self) -> Iterator[int]:
        """The directory's descriptor. Raises RecordingError if it is missing or a link."""
        try:
            descriptor = os.open(self.directory, _DIRECTORY)
        except OSError as error:
            raise _refused(str(self.directory), f"is no directory here: {error.strerror}") from error
        try:
            yield descriptor
        finally:
            os.close(descriptor)


def kept_name(file_name: str) -> str:
    """The name under which a file is stored. Raises RecordingError for a path, or a name without letter or digit."""
    stem, dot, ending = file_name.removesuffix(SUFFIX).rpartition(".")
    if not dot:
        stem, ending = ending, ""
    stem = _NOT_IN_A_NAME.sub("-", stem).strip("-_")[:_MAX_STEM]
    name = f"{stem}.{ending}" if ending else stem
    if "/" in file_name or "\\" in file_name or not _NAME.fullmatch(name):
        allowed = "letters, digits, - and _, such as run-1.txt"
        raise _refused("export", "is no name of a file", ascii(file_name[:_MAX_STEM]), allowed)
    return f"{name}{SUFFIX}"


def _is_export(name: str, status: os.stat_result) -> bool:
    return bool(EXPORT_NAME.fullmatch(name)) and stat.S_ISREG(status.st_mode)


def _removed(directory: int, name: str) -> None:
    try:
        os.unlink(name, dir_fd=directory)
    except FileNotFoundError:
        return


def _full(files: int, total: int) -> RecordingError:
    """files, total : number and bytes of all files, including running uploads."""
    return _refused(
        "exports",
        "has no room for another file",
        f"{files} files with {total / 2**20:.1f} MB, those that are being brought among them",
        f"{MAX_FILES} files with {MAX_BYTES_OF_ALL >> 20} MB",
        "delete exports that are not needed any more",
    )


def _refused(where: str, what: str, value: str = "", allowed: str = "", next_step: str = "") -> RecordingError:
    return RecordingError.of(where, what, value=value, allowed=allowed, next_step=next_step)
