"""The path of a file that a command reads or writes: no folder, and written over only if compd has made it itself."""

from __future__ import annotations

import errno
from collections.abc import Sequence
from pathlib import Path

from compd.errors import CompdError, Problem

# Enough for the head of a page.
_HEAD_BYTES = 4096
# What the system refuses for a reason outside the program, by errno(3).
_REFUSALS = {
    errno.EACCES: "give this user the right, or choose a directory of its own",
    errno.EPERM: "give this user the right, or choose a directory of its own",
    errno.EROFS: "choose a directory on another file system",
    errno.ENOSPC: "make room there",
    errno.EDQUOT: "make room there",
}


def check_replaceable(path: Path, marks: Sequence[bytes], what: str, overwrite: bool | None = None) -> None:
    """Raise CompdError where a file is there that a command must not write over: a recording, or anybody's.

    Parameters
    ----------
    path : of the file that is to be written; nothing need be there.
    marks : what the first bytes of a file of this kind contain, any of them; () where each is a measurement of its own.
    what : the kind, for the message: "a page of compd".
    overwrite : whether the person wants it replaced all the same; None where the command has no such option. What is
        no regular file is never replaced.
    """
    problem = None
    if path.is_file():
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
        if head and not overwrite and not any(mark in head for mark in marks):
            problem = f"is there already, and is not {what}" if marks else "is there already"
    elif path.exists():
        problem = "is not a file"
    if problem is not None:
        next_step = "choose another name, or " + ("remove it" if overwrite is None else "write over it: --overwrite")
        raise CompdError.of(str(path), problem, next_step=next_step)


def folder_problem(path: Path, where: str = "", allowed: str = "") -> Problem | None:
    """The problem of a path that names a folder in place of a file; None for any other."""
    if path.name and not path.is_dir():
        return None
    return Problem(
        where or str(path), "is a folder, not a file", allowed=allowed, next_step=f"give a file in it: {path / 'NAME'}"
    )


def check_directory(path: Path) -> None:
    """Raise CompdError where the directory of a file that is to be written is not there; called before long work."""
    if not path.parent.is_dir():
        raise CompdError.of(str(path), "its directory does not exist", value=str(path.parent), next_step="make it")


def refused_path(error: OSError) -> Problem | None:
    """The problem of a file or directory that the system refused; None for any other error."""
    next_step = _REFUSALS.get(error.errno or 0)
    if next_step is None or error.filename is None:
        return None
    return Problem(str(error.filename), f"was refused: {error.strerror}", next_step=next_step)
