"""A client's connection to the daemon: a real Unix socket, whose waiting is virtual."""

from __future__ import annotations

import json
import math
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from selectors import EVENT_READ
from typing import Any

from tests.worlds.virtual_system import VirtualSystem

_RECEIVE_BYTES = 1 << 16


class Connection:
    """One connection. Raises OSError where nobody listens, and where the other end has gone."""

    def __init__(self, system: VirtualSystem, path: Path) -> None:
        self._system = system
        self._received = b""
        self._lines: list[bytes] = []
        self._socket = socket.socket(socket.AF_UNIX)
        self._selector = system.selector()
        try:
            self._socket.connect(str(path))
        except OSError:
            self.close()
            raise
        self._socket.setblocking(False)
        self._selector.register(self._socket, EVENT_READ)

    def __enter__(self) -> Connection:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close it."""
        self._selector.close()
        self._socket.close()

    def send(self, message: dict[str, Any], file: Path | None = None) -> None:
        """Send a message. `file`: whose descriptor goes along."""
        line = json.dumps(message).encode() + b"\n"
        if file is None:
            self._socket.sendall(line)
            return
        descriptor = os.open(file, os.O_RDONLY | os.O_CLOEXEC)
        try:
            socket.send_fds(self._socket, [line], [descriptor])
        finally:
            os.close(descriptor)

    def send_bytes(self, data: bytes) -> None:
        """Send what need not be a line."""
        self._socket.sendall(data)

    def line(self, until_s: float = math.inf) -> bytes:
        """The next line; b"" where none has come until `until_s`, monotonic s."""
        while not self._lines:
            left_s = until_s - self._system.monotonic()
            if left_s <= 0.0:
                return b""
            self._selector.select(None if left_s == math.inf else left_s)
            try:
                data = self._socket.recv(_RECEIVE_BYTES)
            except BlockingIOError:
                continue
            if not data:
                raise ConnectionResetError("the daemon has closed the connection")
            *lines, self._received = (self._received + data).split(b"\n")
            self._lines.extend(lines)
        return self._lines.pop(0) + b"\n"

    def messages(self, until_s: float = math.inf) -> Iterator[dict[str, Any]]:
        """The messages that come until `until_s`, monotonic s."""
        while line := self.line(until_s):
            yield json.loads(line)
