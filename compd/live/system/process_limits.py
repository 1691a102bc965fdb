"""Limits of this process (`ulimit`, and `Limit...=` of a systemd unit) under which the daemon cannot run.

They are looked at before anything is loaded: what fails for them later fails anywhere, and says something else.
"""

from __future__ import annotations

import errno
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from compd.errors import DaemonError, Problem

# Open in the supervisor while the daemon starts, beside one port for each line: sockets, pipes, memory.
_DESCRIPTORS = 24
# Address space of the shipped hexapod's supervisor, with compiled kernels: 1.03 GB.
_ADDRESS_SPACE = 1_100_000_000
# Machine zero and the last readings take some kilobytes; memory that the processes share counts as a file.
_FILE_SIZE = 16 << 20
_THREAD = "can't start new thread"


class _Limit(NamedTuple):
    """number : of the limit. needed : the least with which the daemon runs. what : is limited. shell, unit : set it."""

    number: int
    needed: int
    what: str
    shell: str
    unit: str


def require_limits() -> None:
    """Raises DaemonError for every limit of memory or of files' size that is too low."""
    _require(
        _Limit(resource.RLIMIT_AS, _ADDRESS_SPACE, "bytes of memory", "ulimit -v unlimited", "LimitAS=infinity"),
        _Limit(resource.RLIMIT_FSIZE, _FILE_SIZE, "bytes in a file", "ulimit -f unlimited", "LimitFSIZE=infinity"),
    )


def require_descriptors(lines: int) -> None:
    """Raises DaemonError where a daemon with so many lines may not open enough files."""
    needed = _DESCRIPTORS + lines
    _require(_Limit(resource.RLIMIT_NOFILE, needed, "open files", "ulimit -n 1024", "LimitNOFILE=1024"))


def _require(*limits: _Limit) -> None:
    problems = []
    for limit in limits:
        allowed, _ = resource.getrlimit(limit.number)
        if allowed != resource.RLIM_INFINITY and allowed < limit.needed:
            problems.append(
                Problem(
                    "limits of this process",
                    f"the daemon needs more {limit.what} than it may have",
                    value=str(allowed),
                    allowed=f"{limit.needed} or more",
                    next_step=f"`{limit.shell}` before the command, or {limit.unit} in the unit's [Service] section",
                )
            )
    if problems:
        raise DaemonError(problems)


@contextmanager
def exhaustion_named() -> Iterator[None]:
    """Raises DaemonError in place of an error that says that memory, files or threads of this process are used up."""
    try:
        yield
    except (MemoryError, OSError, RuntimeError) as error:
        used_up = isinstance(error, MemoryError) or _THREAD in str(error)
        if not used_up and getattr(error, "errno", None) not in (errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EFBIG):
            raise
        raise DaemonError.of(
            "limits of this process",
            "memory, files or threads are used up",
            value=str(error) or type(error).__name__,
            next_step="`ulimit -a` shows the limits; raise the one that is low, or end what takes the rest",
        ) from error
