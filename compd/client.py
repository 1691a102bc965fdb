"""A small client of the daemon: blocking, one connection, standard library alone.

from compd.client import connect

with connect("127.0.0.1:7750") as client:
    for setpoint in client.watch(rate_hz=10):
        if setpoint["valid"]:
            print(setpoint["tip_M_mm"])
"""

from __future__ import annotations

import json
import socket
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from compd.errors import DaemonError, Problem

DEFAULT_ADDRESS = "127.0.0.1:7750"
_IS_IT_RUNNING = "is `compd run` running? its configuration says where it listens, under `sockets:`"

Message = dict[str, Any]


def connect(address: str | Path = DEFAULT_ADDRESS, timeout_s: float = 5.0) -> Client:
    """Connect to "host:port" or to the path of a Unix socket.

    timeout_s : for connecting, and for each answer. Raises DaemonError when nobody answers there.
    """
    text = str(address)
    try:
        if "/" in text:
            connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            connection.settimeout(timeout_s)
            try:
                connection.connect(text)
            except OSError:
                connection.close()
                raise
        else:
            host, _, port = text.rpartition(":")
            connection = socket.create_connection((host.strip("[]"), int(port)), timeout_s)
    except ValueError as error:
        raise DaemonError(
            Problem(
                where="address", what="not an address", value=text, allowed="host:port, or the path of a Unix socket"
            )
        ) from error
    except OSError as error:
        raise DaemonError(
            Problem(where=text, what=f"no daemon answers: {error.strerror or error}", next_step=_IS_IT_RUNNING)
        ) from error
    try:
        return Client(connection, text)
    except DaemonError:
        connection.close()
        raise


class Client:
    """A connection to the daemon. Messages are dictionaries as README.md describes them.

    version : the daemon's VERSION message.
    """

    def __init__(self, connection: socket.socket, address: str) -> None:
        self._connection = connection
        self._address = address
        self._lines = connection.makefile("rb")
        self._setpoints: deque[Message] = deque()
        self.version = self._await("VERSION")

    def watch(self, rate_hz: float | None = None) -> Iterator[Message]:
        """SETPOINT messages for ever, `rate_hz` per second; None for every one of them.

        Raises DaemonError when the daemon goes away.
        """
        self._ask({"class": "WATCH"} if rate_hz is None else {"class": "WATCH", "rate_hz": rate_hz}, "WATCH")
        while True:
            yield self._setpoints.popleft() if self._setpoints else self._next_setpoint()

    def readings(self, rate_hz: float | None = None) -> Iterator[tuple[bytes, Message]]:
        """What the cycles compute from: lines as they came, and the messages in them. First the answer to WATCH, with
        the columns of a recording, then READINGS for ever, `rate_hz` per second; None for every cycle.

        Unix socket only. Raises DaemonError when the daemon refuses or goes away.
        """
        asked = {"class": "WATCH", "what": "readings"}
        self._send(asked if rate_hz is None else asked | {"rate_hz": rate_hz})
        while True:
            yield self._read()

    def target(
        self,
        tip_B0_mm: Sequence[float] | None = None,
        rotation_B0_rad: Sequence[float] | None = None,
        tip_P_mm: Sequence[float] | None = None,
    ) -> None:
        """Say where the tip shall be, as the controller; the next setpoint is computed for it.

        The first client that does so is the controller until it goes or calls `release`. There is no answer;
        an ERROR (another client is the controller) raises DaemonError from whatever is read next.
        """
        keys = {"tip_B0_mm": tip_B0_mm, "rotation_B0_rad": rotation_B0_rad, "tip_P_mm": tip_P_mm}
        self._send({"class": "TARGET", **{key: list(value) for key, value in keys.items() if value is not None}})

    def release(self) -> None:
        """Give the controller role back: the daemon returns to CMM mode."""
        self._ask({"class": "RELEASE"}, "RELEASE")

    def status(self) -> Message:
        """The daemon's STATUS."""
        return self._ask({"class": "STATUS"}, "STATUS")

    def zero(self) -> Message:
        """Take machine zero, with the machine at rest at its zero position (Unix socket only).

        Raises DaemonError when a gauge cannot be read or the machine moves.
        """
        return self._ask({"class": "ZERO"}, "ZERO")

    def model(self, file: str | None = None, shadow: bool = False) -> Message:
        """The models that the daemon runs with, as it tells them (Unix socket only).

        file : a model file to adopt first, or to run as a shadow; an absolute path on the daemon's computer, "" for
        none. Raises DaemonError where the daemon cannot use it.
        """
        order = {} if file is None else {"file": file, "shadow": shadow}
        return self._ask({"class": "MODEL", **order}, "MODEL")

    def close(self) -> None:
        self._lines.close()
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _next_setpoint(self) -> Message:
        self._await("SETPOINT")
        return self._setpoints.popleft()

    def _ask(self, message: Message, answer: str) -> Message:
        self._send(message)
        return self._await(answer)

    def _send(self, message: Message) -> None:
        try:
            self._connection.sendall(json.dumps(message).encode() + b"\n")
        except OSError as error:
            raise self._lost(error.strerror or str(error)) from error

    def _await(self, wanted: str) -> Message:
        """Read until a message of class `wanted`; setpoints that come before it are kept for `watch`."""
        while True:
            _, message = self._read()
            if message["class"] == "SETPOINT":
                self._setpoints.append(message)
            if message["class"] == wanted:
                return message

    def _read(self) -> tuple[bytes, Message]:
        """The next line, and the message that it is."""
        try:
            line = self._lines.readline()
        except OSError as error:
            raise self._lost(error.strerror or "no answer in time") from error
        if not line.endswith(b"\n"):
            raise self._lost("it closed the connection")
        message: Message = json.loads(line)
        if message["class"] == "ERROR":
            raise DaemonError(Problem(where=self._address, what=message["text"], value=message["code"]))
        return line, message

    def _lost(self, why: str) -> DaemonError:
        return DaemonError(Problem(where=self._address, what=f"the daemon is gone: {why}", next_step=_IS_IT_RUNNING))
