"""The sockets that the daemon listens on: TCP, and a Unix socket for clients of the same computer."""

from __future__ import annotations

import socket
from pathlib import Path

from compd.errors import DaemonError, Problem

_UNIX_SOCKET_MODE = 0o660  # the daemon's user and group
_BACKLOG = 16


def listen_tcp(host: str, port: int) -> socket.socket:
    """Listen on a TCP port; 0 for any that is free. Raises DaemonError where it cannot be had."""
    try:
        return socket.create_server(
            (host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET, backlog=_BACKLOG
        )
    except OSError as error:
        raise DaemonError(
            Problem(
                where=f"sockets.tcp {host}:{port}",
                what=f"cannot listen: {error.strerror}",
                next_step="is another compd running? choose another port, or an address of this computer",
            )
        ) from error


def listen_unix(path: Path) -> socket.socket:
    """Listen on a Unix socket at `path`, which the daemon's user and group may use.

    The socket is made under another name and renamed once it listens, so that no client finds it half made; one that a
    crash left behind is replaced. Raises DaemonError where another daemon listens there, or the path cannot be had.
    """
    unfinished = path.with_name(f".{path.name}.new")
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        if _is_alive(path):
            raise DaemonError(
                Problem(
                    where=f"sockets.unix {path}", what="another daemon is listening here", next_step="stop it first"
                )
            )
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished.unlink(missing_ok=True)
        listener.bind(str(unfinished))
        unfinished.chmod(_UNIX_SOCKET_MODE)
        listener.listen(_BACKLOG)
        unfinished.rename(path)
    except OSError as error:
        listener.close()
        raise DaemonError(
            Problem(
                where=f"sockets.unix {path}",
                what=f"cannot listen: {error.strerror or error}",
                next_step="give a path in a directory that the daemon's user may write",
            )
        ) from error
    except DaemonError:
        listener.close()
        raise
    return listener


def _is_alive(path: Path) -> bool:
    """Whether a process listens at `path`."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.connect(str(path))
        except OSError:
            return False
        return True
