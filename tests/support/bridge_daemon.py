"""The daemon's end of a Unix socket, in a test's hands."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any

from tests.support.patience import PATIENCE_S


class BridgeDaemon:
    """Greets whoever connects, and sends what the test says."""

    def __init__(self, path: Path) -> None:
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(path))
        self._listener.listen()
        self._listener.settimeout(PATIENCE_S)
        self._connection: socket.socket | None = None

    def greet(self) -> None:
        """Accept the connection that waits, and greet it."""
        self._connection, _ = self._listener.accept()
        self.send(b'{"class":"VERSION"}\n')

    @property
    def connection(self) -> socket.socket:
        assert self._connection is not None
        return self._connection

    def send(self, data: bytes) -> None:
        self.connection.sendall(data)

    def send_message(self, message: dict[str, Any]) -> None:
        self.send(json.dumps(message).encode() + b"\n")

    def close(self) -> None:
        if self._connection is not None:
            self._connection.close()
        self._listener.close()
