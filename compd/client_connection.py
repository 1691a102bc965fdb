"""A connection to the daemon: one JSON object per line, each way, over TCP or the Unix socket."""

from __future__ import annotations

import json
import socket
import time
from collections import deque
from contextlib import suppress
from typing import Any

import orjson

from compd.errors import DaemonError

_IS_IT_RUNNING = "is `compd run` running? its configuration says where it listens, under `sockets:`"
_NOT_ALLOWED = "join the socket's group: `usermod --append --groups compd NAME`, then log in again; or name host:port"

_RECEIVE_BYTES = 1 << 16

Message = dict[str, Any]


def open_connection(address: str, timeout_s: float) -> ClientConnection:
    """Connect to ``"host:port"``, or to the Unix socket with this path.

    timeout_s : for connecting, and for each message after it, s.
    Raises DaemonError where the address is none, or no daemon answers there.
    """
    try:
        connected = _unix_socket(address, timeout_s) if "/" in address else _tcp_socket(address, timeout_s)
    except ValueError as error:
        raise DaemonError.of(
            "address", "not an address", value=address, allowed="host:port, or the path of a Unix socket"
        ) from error
    except OSError as error:
        step = _NOT_ALLOWED if isinstance(error, PermissionError) else _IS_IT_RUNNING
        raise DaemonError.of(address, f"no daemon answers: {error.strerror or error}", next_step=step) from error
    return ClientConnection(connected, address)


class ClientConnection:
    """Messages to and from the daemon. Used by one thread; another may call `shutdown`."""

    def __init__(self, connected: socket.socket, address: str) -> None:
        """`connected`: an open socket with its timeout set; `address`: the name of the other end in errors."""
        self.address = address
        self._socket = connected
        self._timeout_s = connected.gettimeout()
        self._lines: deque[bytes] = deque()
        self._rest = b""

    @property
    def same_clock(self) -> bool:
        """Whether the daemon runs on this computer: nothing else reaches its Unix socket."""
        return self._socket.family == socket.AF_UNIX

    def send(self, message: Message, descriptor: int | None = None) -> None:
        """descriptor : open file that goes with the message; over TCP none does. Raises DaemonError where the daemon
        has gone."""
        line = json.dumps(message).encode() + b"\n"
        try:
            if descriptor is not None and self.same_clock:
                line = line[socket.send_fds(self._socket, [line], [descriptor]) :]
            self._socket.sendall(line)
        except OSError as error:
            raise self._lost(error.strerror or str(error)) from error

    def read(self) -> tuple[bytes, Message]:
        """The next line, and the message in it.

        Raises DaemonError where it is an ERROR message or none of compd's, and where nothing came within the timeout.
        """
        while not self._lines:
            try:
                self._receive()
            except OSError as error:
                raise self._lost(error.strerror or "no answer in time") from error
        line = self._lines.popleft() + b"\n"
        try:
            message: Message = orjson.loads(line)
            error_code = message["code"] if message["class"] == "ERROR" else None
        except (ValueError, TypeError, KeyError) as error:
            raise DaemonError.of(
                self.address,
                "what answers here is not compd",
                value=repr(line[:40]),
                next_step="give the address under `sockets:` in the daemon's configuration",
            ) from error
        if error_code is not None:
            raise DaemonError.of(self.address, message["text"], value=error_code)
        return line, message

    def has_line(self, wait_s: float) -> bool:
        """Whether a line has come that was not read, or comes within `wait_s`. Raises DaemonError as `read`."""
        end_s = time.monotonic() + wait_s
        try:
            while not self._lines:
                self._socket.settimeout(max(end_s - time.monotonic(), 0.0))
                self._receive()
        except (TimeoutError, BlockingIOError):
            return False
        except OSError as error:
            raise self._lost(error.strerror or str(error)) from error
        finally:
            self._socket.settimeout(self._timeout_s)
        return True

    def shutdown(self) -> None:
        """End both directions: a `read` that waits on another thread raises DaemonError."""
        with suppress(OSError):  # the daemon was first
            self._socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _receive(self) -> None:
        """Take what has come, or comes within the socket's timeout. Raises OSError, and DaemonError at the end."""
        piece = self._socket.recv(_RECEIVE_BYTES)
        if not piece:
            raise self._lost("it closed the connection")
        *lines, self._rest = (self._rest + piece).split(b"\n")
        self._lines += lines

    def _lost(self, why: str) -> DaemonError:
        return DaemonError.of(self.address, f"the daemon is gone: {why}", next_step=_IS_IT_RUNNING)


def _tcp_socket(address: str, timeout_s: float) -> socket.socket:
    host, _, port = address.rpartition(":")
    return socket.create_connection((host.strip("[]"), int(port)), timeout_s)


def _unix_socket(path: str, timeout_s: float) -> socket.socket:
    connected = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connected.settimeout(timeout_s)
    try:
        connected.connect(path)
    except OSError:
        connected.close()
        raise
    return connected
