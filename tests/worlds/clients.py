"""Clients of a world's daemon: real sockets, whose waiting is virtual."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from selectors import EVENT_READ
from typing import Any, NamedTuple

from tests.worlds.virtual_system import VirtualSystem

# Longest time (s) for which a person waits for an answer: a model may take the loop's successor some seconds.
PATIENCE_S = 30.0
# Until a client that has lost its daemon tries again, s.
AGAIN_S = 0.2
RECEIVE_BYTES = 1 << 16


class Answer(NamedTuple):
    """What a client was told. message : None where nobody answered in time."""

    time_s: float
    request: str
    message: dict[str, Any] | None


class Clients:
    """The persons and programs at the daemon's Unix socket.

    Attributes
    ----------
    answers : to the persons' requests, in the order in which they came.
    """

    def __init__(self, system: VirtualSystem, path: Path) -> None:
        self.answers: list[Answer] = []
        self._system = system
        self._path = path
        self._numbers = 0

    def ask(self, message: dict[str, Any], file: Path | None = None) -> None:
        """Send a request; the answer comes into `answers`. `file`: whose descriptor goes along."""

        def converse() -> None:
            reply = None
            with suppress(OSError):  # nobody listens, or the daemon has gone
                replies = (one for one in self._lines(message, file, PATIENCE_S) if one["class"] in expected)
                reply = next(replies, None)
            self.answers.append(Answer(self._system.monotonic(), message["class"], reply))

        expected = (message["class"], "ERROR")
        self._start(converse)

    def watch(self, rate_hz: float) -> Watcher:
        """A program that wants setpoints, and comes again when the daemon has gone."""
        watcher = Watcher()

        def follow() -> None:
            while True:
                with suppress(OSError):
                    for message in self._lines({"class": "WATCH", "rate_hz": rate_hz}, None, None):
                        if message["class"] == "SETPOINT":
                            watcher.take(message)
                self._system.sleep_until(self._system.monotonic() + AGAIN_S)

        self._start(follow)
        return watcher

    def _start(self, run: Callable[[], None]) -> None:
        self._numbers += 1
        self._system.start(run, f"client {self._numbers}")

    def _lines(self, request: dict[str, Any], file: Path | None, within_s: float | None) -> Iterator[dict[str, Any]]:
        """Send a request and iterate over the lines that come. Raises OSError where nobody listens."""
        system, received = self._system, b""
        until_s = None if within_s is None else system.monotonic() + within_s
        with socket.socket(socket.AF_UNIX) as connection, system.selector() as selector:
            connection.connect(str(self._path))
            connection.setblocking(False)
            selector.register(connection, EVENT_READ)
            line = json.dumps(request).encode() + b"\n"
            if file is None:
                connection.sendall(line)
            else:
                descriptor = os.open(file, os.O_RDONLY | os.O_CLOEXEC)
                try:
                    socket.send_fds(connection, [line], [descriptor])
                finally:
                    os.close(descriptor)
            while until_s is None or system.monotonic() < until_s:
                selector.select(None if until_s is None else until_s - system.monotonic())
                try:
                    data = connection.recv(RECEIVE_BYTES)
                except BlockingIOError:
                    continue
                if not data:
                    return
                *lines, received = (received + data).split(b"\n")
                yield from map(json.loads, lines)


class Watcher:
    """What a program has seen of the setpoints.

    Attributes
    ----------
    seen : how many. last : the newest.
    """

    def __init__(self) -> None:
        self.seen = 0
        self.last: dict[str, Any] = {}

    def take(self, message: dict[str, Any]) -> None:
        """A setpoint has come."""
        self.seen += 1
        self.last = message
