"""The injector's ends of a line: to the daemon a pty or a listening socket, to the simulated device its port."""

from __future__ import annotations

import os
import socket
import struct
import tty
from contextlib import suppress
from pathlib import Path
from typing import Protocol

LOOPBACK = "127.0.0.1"
MAX_BYTES = 4096
# Closing a socket with this option resets its connection.
RESET = struct.pack("ii", 1, 0)


class End(Protocol):
    """An end with descriptors to wait on."""

    def fds(self) -> list[int]: ...
    def read(self, fd: int) -> bytes: ...
    def write(self, data: bytes) -> None: ...
    def close(self) -> None: ...


class PtyEnd:
    """A pty for the daemon, found by a link; closing it is pulling the plug."""

    def __init__(self, link: Path) -> None:
        self._link = link
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        link.unlink(missing_ok=True)
        link.symlink_to(os.ttyname(self._slave))

    def fds(self) -> list[int]:
        return [self._master]

    def read(self, fd: int) -> bytes:
        return os.read(fd, MAX_BYTES)

    def write(self, data: bytes) -> None:
        os.write(self._master, data)

    def close(self) -> None:
        self._link.unlink(missing_ok=True)
        os.close(self._slave)
        os.close(self._master)


class ListeningEnd:
    """A TCP server for the daemon; what is written goes to the latest connection. Closing it resets all of them."""

    def __init__(self, port: int = 0) -> None:
        self._listener = socket.create_server((LOOPBACK, port))
        self.port: int = self._listener.getsockname()[1]
        self._connections: dict[int, socket.socket] = {}

    def fds(self) -> list[int]:
        return [self._listener.fileno(), *self._connections]

    def read(self, fd: int) -> bytes:
        if fd == self._listener.fileno():
            connection, _ = self._listener.accept()
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._connections[connection.fileno()] = connection
            return b""
        data = b""
        with suppress(OSError):
            data = self._connections[fd].recv(MAX_BYTES)
        if not data:
            self._connections.pop(fd).close()
        return data

    def write(self, data: bytes) -> None:
        for connection in list(self._connections.values())[-1:]:
            with suppress(OSError):
                connection.sendall(data)

    def close(self) -> None:
        for connection in self._connections.values():
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
            connection.close()
        self._connections.clear()
        self._listener.close()


class DevicePort:
    """The port of a simulated serial device."""

    def __init__(self, path: Path) -> None:
        self._fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._fd)

    def fds(self) -> list[int]:
        return [self._fd]

    def read(self, fd: int) -> bytes:
        return os.read(fd, MAX_BYTES)

    def write(self, data: bytes) -> None:
        os.write(self._fd, data)

    def close(self) -> None:
        os.close(self._fd)


class DeviceConnection:
    """A connection to a simulated device that listens."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.create_connection((host, port))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def fds(self) -> list[int]:
        return [self._socket.fileno()]

    def read(self, fd: int) -> bytes:
        return self._socket.recv(MAX_BYTES)

    def write(self, data: bytes) -> None:
        self._socket.sendall(data)

    def close(self) -> None:
        self._socket.close()
