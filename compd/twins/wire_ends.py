"""Ends of a simulated line: a pty's master side, or a listening TCP socket."""

from __future__ import annotations

import os
import socket
import tty
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

LOOPBACK = "127.0.0.1"
MAX_BYTES = 4096  # of one read
# For the daemon: a device path, a URL, or host and port.
Port = str | tuple[str, int]


class End(Protocol):
    """An end that can be selected, read and written, by file descriptor.

    port : for the daemon. number : of the network port, 0 where it has none; it is opened there again.
    """

    @property
    def port(self) -> Port: ...
    @property
    def number(self) -> int: ...
    def fds(self) -> list[int]: ...
    def read(self, fd: int) -> bytes: ...
    def write(self, fd: int, data: bytes) -> None: ...
    def close(self) -> None: ...


class PtyEnd:
    """A pty with a symbolic link to the daemon's side; closing it unplugs the line."""

    number = 0

    def __init__(self, link: Path) -> None:
        self._link = link
        # The daemon's side stays open here, so that the daemon can close and reopen it.
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        link.unlink(missing_ok=True)
        link.symlink_to(os.ttyname(self._slave))

    @property
    def port(self) -> str:
        return str(self._link)

    def fds(self) -> list[int]:
        return [self._master]

    def read(self, fd: int) -> bytes:
        return os.read(fd, MAX_BYTES)

    def write(self, fd: int, data: bytes) -> None:
        os.write(fd, data)

    def close(self) -> None:
        self._link.unlink(missing_ok=True)
        os.close(self._slave)
        os.close(self._master)


class TcpEnd:
    """A listening socket; a reply goes to the connection that sent the request."""

    def __init__(self, number: int) -> None:
        """`number`: of the port, 0 for any."""
        self._connections: dict[int, socket.socket] = {}
        self._listener = socket.create_server((LOOPBACK, number))
        self.number: int = self._listener.getsockname()[1]

    @property
    def port(self) -> Port:
        return LOOPBACK, self.number

    def fds(self) -> list[int]:
        return [self._listener.fileno(), *self._connections]

    def read(self, fd: int) -> bytes:
        """Bytes that a client sent; b"" for a new or closed connection."""
        if fd == self._listener.fileno():
            connection, _ = self._listener.accept()
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._connections[connection.fileno()] = connection
            return b""
        try:
            data = self._connections[fd].recv(MAX_BYTES)
        except OSError:
            data = b""
        if not data:
            self._connections.pop(fd).close()
        return data

    def write(self, fd: int, data: bytes) -> None:
        with suppress(OSError):  # the client has closed the connection
            if fd in self._connections:
                self._connections[fd].sendall(data)

    def close(self) -> None:
        for connection in (self._listener, *self._connections.values()):
            connection.close()
        self._connections.clear()


def tcp_end(settings: Any, link: Path, number: int) -> End:
    """See `compd.twins.polled_twin.PolledTwin.end`."""
    return TcpEnd(number)
