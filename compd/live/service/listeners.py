"""The sockets that the daemon listens on: TCP, and a Unix socket for clients of the same computer."""

from __future__ import annotations

import socket
import stat
from contextlib import suppress
from pathlib import Path

from compd.errors import DaemonError, Problem
from compd.operation_settings import SocketSettings

_UNIX_SOCKET_MODE = 0o660  # the daemon's user and group
_BACKLOG = 16
_OTHER_PATH = "give a path in a directory that the daemon's user may write, at which there is nothing"


class Listeners:
    """The sockets on which one configuration asks to listen; they stay open while the processes behind them change."""

    def __init__(self, settings: SocketSettings, before: Listeners | None = None) -> None:
        """`before`: those of the configuration until now, of which sockets at the same address are taken over.

        Raises DaemonError where an address cannot be had; what `before` has stays as it is then.
        """
        self._settings = settings
        self._file: tuple[int, int]
        self.unix: socket.socket  #: for clients of this computer
        old = before._settings if before is not None else None
        same_unix = old is not None and old.unix.path == settings.unix.path
        same_tcp = old is not None and old.tcp == settings.tcp
        self.tcp: socket.socket | None = None  #: None where TCP is not configured
        if settings.tcp is not None:
            kept = before.tcp if before is not None and same_tcp else None
            self.tcp = kept or listen_tcp(settings.tcp.host, settings.tcp.port)
        path = Path(settings.unix.path)
        try:
            self.unix = before.unix if before is not None and same_unix else listen_unix(path)
        except DaemonError:
            if self.tcp is not None and not same_tcp:
                self.tcp.close()
            raise
        self._file = before._file if before is not None and same_unix else _identity(path)

    @property
    def tcp_port(self) -> int | None:
        """The TCP port; None where TCP is not configured."""
        return None if self.tcp is None else self.tcp.getsockname()[1]

    def close(self, after: Listeners | None = None) -> None:
        """Close the sockets, but for those that `after` has; the Unix socket's file is removed, if it is still ours."""
        if self.tcp is not None and (after is None or after.tcp is not self.tcp):
            self.tcp.close()
        if after is None or after.unix is not self.unix:
            self.unix.close()
            path = Path(self._settings.unix.path)
            with suppress(OSError):
                if _identity(path) == self._file:
                    path.unlink()


def listen_tcp(host: str, port: int) -> socket.socket:
    """Listen on a TCP port; 0 for any that is free. Raises DaemonError where it cannot be had."""
    try:
        return socket.create_server(
            (host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET, backlog=_BACKLOG
        )
    except OSError as error:
        raise DaemonError.of(
            f"sockets.tcp {host}:{port}",
            f"cannot listen: {error.strerror}",
            next_step="is another compd running? choose another port, or an address of this computer",
        ) from error


def listen_unix(path: Path) -> socket.socket:
    """Listen on a Unix socket at `path`, which the daemon's user and group may use.

    The socket is made under another name and renamed once it listens, so that no client finds it half made; one that a
    crash left behind is replaced. Raises DaemonError where another daemon listens there, something else than a socket
    is there, or the path cannot be had.
    """
    unfinished = path.with_name(f".{path.name}.new")
    for place in (path, unfinished):
        if (problem := unix_path_problem(place)) is not None:
            raise DaemonError(problem)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        if _is_alive(path):
            raise DaemonError.of(f"sockets.unix {path}", "another daemon is listening here", next_step="stop it first")
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished.unlink(missing_ok=True)
        listener.bind(str(unfinished))
        unfinished.chmod(_UNIX_SOCKET_MODE)
        listener.listen(_BACKLOG)
        unfinished.rename(path)
    except OSError as error:
        listener.close()
        raise DaemonError.of(
            f"sockets.unix {path}",
            f"cannot listen: {error.strerror or error}",
            next_step="give a path in a directory that the daemon's user may write",
        ) from error
    except DaemonError:
        listener.close()
        raise
    return listener


def unix_path_problem(path: Path) -> Problem | None:
    """What is wrong with a path for a Unix socket: something else is there, which is never replaced."""
    try:
        is_socket = stat.S_ISSOCK(path.lstat().st_mode)
    except FileNotFoundError:
        return None
    except OSError as error:
        return Problem(f"sockets.unix {path}", f"cannot be used: {error.strerror}", next_step=_OTHER_PATH)
    if is_socket:
        return None
    what = "there is a file of another kind, which is not replaced"
    return Problem(f"sockets.unix {path}", what, allowed="no file, or a socket", next_step=_OTHER_PATH)


def _identity(path: Path) -> tuple[int, int]:
    """Device and number of the file at this path."""
    status = path.lstat()
    return status.st_dev, status.st_ino


def _is_alive(path: Path) -> bool:
    """Whether a process listens at `path`."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        try:
            probe.connect(str(path))
        except OSError:
            return False
        return True
