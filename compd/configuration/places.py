"""Paths in a configuration: directories and files that it names."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path

from compd.documents import Document
from compd.errors import Problem
from compd.operation_settings import SocketSettings, StateSettings

# Below these the service manager creates the daemon's own directory: RuntimeDirectory=, StateDirectory=.
_OF_SERVICE_MANAGER = tuple(map(Path, ("/run", "/var/lib")))
# File systems of the kernel, where no directory can be created.
_OF_KERNEL = tuple(map(Path, ("/proc", "/sys")))
# Usually in memory, emptied at each start.
_EMPTIED = tuple(map(Path, ("/run", "/var/run", "/dev/shm")))
# Shared directories of the Filesystem Hierarchy Standard 3.0.
_SYSTEMS = frozenset(
    map(
        Path,
        (
            *("/bin", "/boot", "/dev", "/etc", "/home", "/lib", "/media", "/mnt", "/opt", "/root", "/run", "/sbin"),
            *("/srv", "/usr", "/usr/bin", "/usr/lib", "/usr/local", "/usr/share"),
            *("/var", "/var/cache", "/var/lib", "/var/log", "/var/run", "/var/spool"),
        ),
    )
)


def place_problems(document: Document, sockets: SocketSettings | None, state: StateSettings | None) -> list[Problem]:
    """A path that can never serve its purpose in the configuration."""
    problems = []
    if sockets is not None and _is_something_else(Path(sockets.unix.path)):
        problems.append(
            Problem(
                document.where(("sockets", "unix", "path")),
                "there is something else that is no socket",
                value=sockets.unix.path,
                next_step="choose a name that is not used yet",
            )
        )
    if state is not None and state.model_file is not None and not os.path.lexists(state.model_file):
        problems.append(
            Problem(
                document.where(("state", "model_file")),
                "there is no such file",
                value=state.model_file,
                next_step="`compd model add` writes a model file; or leave the key out",
            )
        )
    for location, path, *_ in _directories(sockets, state):
        if why := _why_impossible(path):
            problems.append(
                Problem(
                    document.where(location),
                    f"there can be no such directory: {why}",
                    value=str(path),
                    next_step="choose another one",
                )
            )
    return problems


def place_warnings(document: Document, sockets: SocketSettings | None, state: StateSettings | None) -> list[Problem]:
    """A directory that this user can neither write nor create, and sockets open to other computers."""
    warnings = []
    for location, path, what_for in _directories(sockets, state):
        if _why_impossible(path) or path.parent in _OF_SERVICE_MANAGER:
            continue
        existing = _nearest(path)
        if not os.access(existing, os.W_OK | os.X_OK):
            what = "cannot be written" if existing == path else f"does not exist, and {existing} cannot be written"
            warnings.append(
                Problem(
                    document.where(location),
                    f"the directory for {what_for} {what} by this user",
                    value=str(path),
                    next_step=f"as root: install -d -o USER {path}; USER is who runs the daemon",
                )
            )
    return [
        *warnings,
        *_directory_slips(document, sockets, state),
        *_open_socket_warnings(document, sockets),
    ]


def _directory_slips(
    document: Document, sockets: SocketSettings | None, state: StateSettings | None
) -> Iterator[Problem]:
    """A directory that is public, the system's, or emptied when the computer starts."""
    for location, path, what_for in _directories(sockets, state):
        existing = _nearest(path)
        why = ""
        if existing.is_dir() and existing.stat().st_mode & stat.S_IWOTH:
            why = f"is everybody's, as {existing} is: any user of this computer can put a file there"
        elif path in _SYSTEMS or path.parent == path:
            why = "is the system's: its files would lie among others, and its rights would be changed"
        elif location[0] == "state" and any(path.is_relative_to(place) for place in _EMPTIED):
            why = "is emptied when the computer starts"
        if why:
            yield Problem(
                document.where(location),
                f"the directory for {what_for} {why}",
                value=str(path),
                next_step="choose one of its own, such as /var/lib/compd for files and /run/compd for the socket",
            )


def _open_socket_warnings(document: Document, sockets: SocketSettings | None) -> Iterator[Problem]:
    if sockets is None or sockets.tcp is None or not sockets.tcp.is_open:
        return
    yield Problem(
        document.where(("sockets", "tcp", "host")),
        "OPEN TO THE NETWORK: other computers can watch and, with the token, set targets; nothing on the way is "
        "encrypted, the token neither",
        value=f"{sockets.tcp.host}, allowed from {', '.join(sockets.tcp.allow)}",
        allowed="127.0.0.1, or ::1, for this computer alone",
        next_step="put a proxy with TLS in front of 127.0.0.1, or keep everyone else off the network; `target: "
        "{unix_only: true}` lets other computers only watch",
    )


def _directories(
    sockets: SocketSettings | None, state: StateSettings | None
) -> Iterator[tuple[tuple[str, ...], Path, str]]:
    """Location in the file, path and purpose of every directory that the daemon creates."""
    if sockets is not None:
        yield ("sockets", "unix", "path"), Path(sockets.unix.path).parent, "the Unix socket"
    if state is not None:
        yield ("state", "directory"), Path(state.directory), "machine zero"


def _why_impossible(path: Path) -> str:
    existing = _nearest(path)
    if not existing.is_dir():
        return f"{existing} is no directory"
    if existing != path and any(existing.is_relative_to(place) for place in _OF_KERNEL):
        return f"{existing} is the kernel's"
    return ""


def _nearest(path: Path) -> Path:
    """The path itself, or its nearest existing ancestor."""
    return next((place for place in (path, *path.parents) if os.path.lexists(place)), Path("/"))


def _is_something_else(path: Path) -> bool:
    try:
        return not stat.S_ISSOCK(path.lstat().st_mode)
    except OSError:
        return False
