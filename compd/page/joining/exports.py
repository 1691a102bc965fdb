"""Exports of instruments in the directory `exports/` beside the recordings: listed, and brought by a browser."""

from __future__ import annotations

import asyncio
import filecmp
import os
import re
import secrets
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

from compd.errors import Problem, RecordingError

# NAME or NAME.ext: a file's name on every system and never a path.
EXPORT_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}(\.[A-Za-z0-9]{1,8})?")
# Some million rows.
MOST_BYTES = 64 * 2**20
_NOT_IN_A_NAME = re.compile(r"[^A-Za-z0-9_-]+")
_LONGEST_STEM = 64


class Exports:
    """Those in `directory`, which need not be there yet."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def listed(self) -> list[str]:
        """Their names, the newest first."""
        by_age = []
        for path in self.directory.glob("*"):
            try:
                if EXPORT_NAME.fullmatch(path.name) and path.is_file() and not path.is_symlink():
                    by_age.append((-path.stat().st_mtime, path.name))
            except FileNotFoundError:  # somebody has just removed it
                continue
        return [name for _, name in sorted(by_age)]

    def path_of(self, name: str) -> Path | None:
        """The file of that name; None where there is none."""
        path = self.directory / name
        return path if EXPORT_NAME.fullmatch(name) and path.is_file() and not path.is_symlink() else None

    async def keep(self, file_name: str, pieces: AsyncIterator[bytes]) -> dict[str, Any]:
        """Write what a browser brings, and tell its `name` here and its `bytes`.

        file_name : the file's name on the person's computer; what cannot stand in a name here becomes "-".

        Raises RecordingError for a name that is none, for a file that is empty, larger than MOST_BYTES, or another than
        the one that has its name already; and where the disk refuses.
        """
        name = kept_name(file_name)
        self.directory.mkdir(parents=True, exist_ok=True)
        temporary = self.directory / f".{secrets.token_hex(8)}"
        try:
            count = await _written(temporary, pieces)
            if not count:
                raise _refused(name, "is empty", allowed="an instrument's export")
            await asyncio.to_thread(self._name, temporary, name)
        except OSError as error:
            raise _refused(str(self.directory), f"cannot be written to: {error.strerror}") from error
        finally:
            temporary.unlink(missing_ok=True)
        return {"name": name, "bytes": count}

    def _name(self, temporary: Path, name: str) -> None:
        """Give a file its name. Nothing is ever replaced: the same bytes may come again, others need another name."""
        path = self.directory / name
        try:
            os.link(temporary, path)
        except FileExistsError:
            if self.path_of(name) is None or not filecmp.cmp(temporary, path, shallow=False):
                raise _refused(
                    name, "is there already, with other content", next_step="rename the file, then bring it again"
                ) from None


def kept_name(file_name: str) -> str:
    """The name under which a file is kept. Raises RecordingError for what is a path, or has no letter or digit."""
    stem, dot, ending = file_name.rpartition(".")
    if not dot:
        stem, ending = ending, ""
    stem = _NOT_IN_A_NAME.sub("-", stem).strip("-_")[:_LONGEST_STEM]
    name = f"{stem}.{ending}" if ending else stem
    if "/" in file_name or "\\" in file_name or not EXPORT_NAME.fullmatch(name):
        allowed = "letters, digits, - and _, such as run-1.txt"
        raise _refused("export", "is no name of a file", ascii(file_name[:_LONGEST_STEM]), allowed)
    return name


async def _written(path: Path, pieces: AsyncIterator[bytes]) -> int:
    """Number of bytes that are in the new file `path` now."""
    count = 0
    with path.open("xb") as file:
        async for piece in pieces:
            count += len(piece)
            if count > MOST_BYTES:
                raise _refused("export", "is too large", allowed=f"{MOST_BYTES >> 20} MB", next_step="split it")
            file.write(piece)
    path.chmod(0o644)
    return count


def _refused(where: str, what: str, value: str = "", allowed: str = "", next_step: str = "") -> RecordingError:
    return RecordingError(Problem(where=where, what=what, value=value, allowed=allowed, next_step=next_step))
