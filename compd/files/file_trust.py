"""Whether a file can be trusted: who could have put something else in its place.

Code that a file holds runs as whoever loads it. Such a file must belong to somebody who may do that anyway, and nobody
else may be able to write it, or any directory above it.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Collection
from pathlib import Path

from compd.errors import Problem

_ROOT = 0


def own_users() -> frozenset[int]:
    """Numbers of the users whose files are trusted: root, and the user as whom this process runs."""
    return frozenset({_ROOT, os.geteuid()})


def trust_problem(path: Path, where: str, what: str, users: Collection[int]) -> Problem | None:
    """Why a file cannot be trusted; None where it can.

    Parameters
    ----------
    path : absolute, with every symbolic link resolved: what is checked is then what is opened.
    where, what : for the message: the place that names the file, and what the file is.
    users : numbers of the users whose files and directories are trusted.

    A directory above the one with the file may be writable by all where only a file's owner can rename it (mode 1777,
    as /tmp). Raises OSError where the file or a directory cannot be looked at.
    """
    for place in (path, *path.parents):
        status = place.stat()
        is_file, is_shared = place == path, bool(status.st_mode & stat.S_ISVTX) and place != path.parent
        name = f"the {what}'s file" if is_file else f"the directory of the {what}'s file"
        if status.st_uid not in users:
            return Problem(
                where,
                f"{name} belongs to another user, who could put anything in its place",
                value=f"{place}: user {status.st_uid}",
                allowed=f"user {', '.join(map(str, sorted(users)))}",
                next_step=f"look at it, then copy it with `install -m 644` to a directory of your own or of root's, "
                f"or `chown` {place}",
            )
        if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and (is_file or not is_shared):
            return Problem(
                where,
                f"{name} may be written by group or others",
                value=f"{place}: mode {stat.S_IMODE(status.st_mode):o}",
                allowed="mode 644 or stricter" if is_file else "mode 755 or stricter",
                next_step=f"chmod go-w {place}",
            )
    return None
