"""Client of the simulated machine's control socket (`control`): drives the machine and asks for the true tip."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any, Self

from compd.errors import DaemonError, Problem


class ControlClient:
    """A connection to the control socket at `path`; a context manager that closes it."""

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.connect(str(path))
        self._lines = self._socket.makefile("rb")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._lines.close()
        self._socket.close()

    def ask(self, message_class: str, **values: Any) -> dict[str, Any]:
        """Send one request, return its answer. Raises DaemonError for the answer ERROR."""
        self._socket.sendall(json.dumps({"class": message_class, **values}).encode() + b"\n")
        answer: dict[str, Any] = json.loads(self._lines.readline())
        if answer.get("class") == "ERROR":
            raise DaemonError(Problem(where="simulated machine", what=str(answer.get("text")), value=message_class))
        return answer
