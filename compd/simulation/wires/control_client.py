"""Client of the simulated machine's control socket (`control`): drives the machine and asks for the true tip."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any, Self

from compd.errors import DaemonError


class ControlClient:
    """A connection to the control socket at `path`; a context manager that closes it."""

    def __init__(self, path: Path) -> None:
        """Raises DaemonError if no simulated machine answers."""
        self._path = path
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.connect(str(path))
        except OSError as error:
            self._socket.close()
            raise DaemonError.of(
                str(path),
                f"no simulated machine answers: {error.strerror}",
                next_step="start it with `compd sim run CONFIG --directory`, and give that directory",
            ) from error
        self._lines = self._socket.makefile("rb")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._lines.close()
        self._socket.close()

    def ask(self, message_class: str, **values: Any) -> dict[str, Any]:
        """Send one request, return its answer. Raises DaemonError for the answer ERROR, or none."""
        try:
            self._socket.sendall(json.dumps({"class": message_class, **values}).encode() + b"\n")
            line = self._lines.readline()
        except OSError:
            line = b""
        if not line.endswith(b"\n"):
            raise DaemonError.of(str(self._path), "the simulated machine is gone")
        answer: dict[str, Any] = json.loads(line)
        if answer.get("class") == "ERROR":
            raise DaemonError.of("simulated machine", str(answer.get("text")), value=message_class)
        return answer
