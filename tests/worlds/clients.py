"""Clients of a world's daemon: persons who ask, a program that watches, and one that records."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from compd.configuration import Configuration
from compd.errors import CompdError, DaemonError
from compd.live.record import ReadingsFeed, Recorder, RecordingLimits
from tests.worlds.connection import Connection
from tests.worlds.virtual_system import VirtualSystem

# Longest time (s) for which a person waits for an answer: a model may take the loop's successor some seconds.
PATIENCE_S = 30.0
# Until a client that has lost its daemon tries again, s.
AGAIN_S = 0.2
# Between two bursts of a program that asks without end, s.
_FLOODS_EVERY_S = 0.02
# Of a recording: no part is closed for its size or age.
_LIMITS = RecordingLimits(10**9, 1e9, 10**10, drop_oldest=False)


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
    asks : called with the number of each request, the request and its file. replies : called with number and answer.
    heard_s : when the program that watches got its last setpoint, s.
    """

    def __init__(self, system: VirtualSystem, path: Path) -> None:
        self.answers: list[Answer] = []
        self.asks: list[Callable[[int, dict[str, Any], Path | None], object]] = []
        self.replies: list[Callable[[int, dict[str, Any] | None], object]] = []
        self.heard_s = system.monotonic()
        self._system = system
        self._path = path
        self._numbers = self._requests = 0

    def ask(self, message: dict[str, Any], file: Path | None = None) -> None:
        """Send a request; the answer comes into `answers`. `file`: whose descriptor goes along."""
        self._start(partial(self._asked, message, file))

    def apply_shadow(self) -> None:
        """Ask which model runs as the shadow, and let it be applied."""

        def converse() -> None:
            models = self._asked({"class": "MODEL"}) or {}
            if hash_ := models.get("shadow", {}).get("model"):
                self._asked({"class": "MODEL", "hash": hash_})

        self._start(converse)

    def _asked(self, message: dict[str, Any], file: Path | None = None) -> dict[str, Any] | None:
        """Send a request, and wait for its answer."""
        self._requests += 1
        number, reply = self._requests, None
        for hear_request in self.asks:
            hear_request(number, message, file)
        with suppress(OSError), Connection(self._system, self._path) as connection:
            connection.send(message, file)
            answers = connection.messages(self._system.monotonic() + PATIENCE_S)
            reply = next((one for one in answers if one["class"] in (message["class"], "ERROR")), None)
        self.answers.append(Answer(self._system.monotonic(), message["class"], reply))
        for hear_reply in self.replies:
            hear_reply(number, reply)
        return reply

    def watch(self, rate_hz: float) -> None:
        """A program that wants setpoints, and comes again when the daemon has gone."""

        def follow() -> None:
            while True:
                with suppress(OSError), Connection(self._system, self._path) as connection:
                    connection.send({"class": "WATCH", "rate_hz": rate_hz})
                    for message in connection.messages():
                        if message["class"] == "SETPOINT":
                            self.heard_s = self._system.monotonic()
                self._system.sleep_until(self._system.monotonic() + AGAIN_S)

        self._start(follow)

    def does_not_read(self, lasts_s: float) -> None:
        """A program that watches all readings and reads none of them."""

        def hang() -> None:
            with suppress(OSError), Connection(self._system, self._path) as connection:
                connection.send({"class": "WATCH", "what": "readings"})
                self._system.sleep_until(self._system.monotonic() + lasts_s)

        self._start(hang)

    def floods(self, per_s: float, lasts_s: float) -> None:
        """A program that asks without end, and reads the answers now and then."""
        end_s = self._system.monotonic() + lasts_s

        def ask() -> None:
            while self._system.monotonic() < end_s:
                with suppress(OSError), Connection(self._system, self._path) as connection:
                    while self._system.monotonic() < end_s:
                        connection.send_bytes(b'{"class":"STATUS"}\n' * max(1, round(per_s * _FLOODS_EVERY_S)))
                        connection.line(self._system.monotonic() + _FLOODS_EVERY_S)
                self._system.sleep_until(self._system.monotonic() + AGAIN_S)

        self._start(ask)

    def goes_within_a_line(self, line: bytes) -> None:
        """A program that ends within a line."""

        def go() -> None:
            with suppress(OSError), Connection(self._system, self._path) as connection:
                connection.send_bytes(line[: len(line) // 2])
                self._system.sleep_until(self._system.monotonic() + AGAIN_S)

        self._start(go)

    def record(self, name: Path, configuration: Configuration) -> Recording:
        """A program that records the readings of every cycle."""
        recording = Recording(self._system, self._path, name, configuration)
        self._start(recording.run)
        return recording

    def _start(self, run: Callable[[], object]) -> None:
        self._numbers += 1
        self._system.start(run, f"client {self._numbers}")


class _EndedByPerson(Exception):
    """Somebody presses Ctrl-C."""


class Recording:
    """`compd recording start`, in a world.

    Attributes
    ----------
    name : of its parts. done : whether its files are closed. summary : what it says at its end. said : what it has said
        before. failure : what ended it; "" where a person did.
    received : the lines of all READINGS that came.
    """

    def __init__(self, system: VirtualSystem, path: Path, name: Path, configuration: Configuration) -> None:
        self.done = False
        self.summary = ""
        self.failure = ""
        self.said: list[str] = []
        self.received: list[bytes] = []
        self.name = name
        self._system = system
        self._path = path
        self._configuration = configuration
        self._ends = False

    def end(self) -> None:
        """A person ends it; it is done soon after that."""
        self._ends = True

    def run(self) -> None:
        """As the command does."""
        feed = ReadingsFeed(self._connect, None, self.said.append, self._system)
        recorder = Recorder(
            self.name, *feed.first_messages, _LIMITS, self.said.append, self._system, configuration=self._configuration
        )
        recorder.start()
        try:
            with suppress(_EndedByPerson), closing(feed.messages()) as messages:
                recorder.follow(messages)
        except CompdError as failure:
            self.failure = str(failure)
        finally:
            with suppress(CompdError):  # it has been said
                recorder.close()
            self.summary, self.done = recorder.summary(), True

    def _connect(self) -> _Readings:
        try:
            return _Readings(Connection(self._system, self._path), lambda: self._ends, self._system, self.received)
        except OSError as error:
            raise DaemonError.of("the daemon", str(error)) from error


class _Readings:
    """What `ReadingsFeed` needs of a client."""

    def __init__(
        self, connection: Connection, ends: Callable[[], bool], system: VirtualSystem, received: list[bytes]
    ) -> None:
        self._received = received
        self._connection = connection
        self._ends = ends
        self._system = system
        self.version = next(connection.messages())

    def readings(self, rate_hz: float | None = None) -> Iterator[tuple[bytes, dict[str, Any]]]:
        """The lines that come, as `compd.client.Client.readings`."""
        asked = {} if rate_hz is None else {"rate_hz": rate_hz}
        self._connection.send({"class": "WATCH", "what": "readings", **asked})
        try:
            while not self._ends():
                if line := self._connection.line(self._system.monotonic() + AGAIN_S):
                    message = json.loads(line)
                    if message["class"] == "READINGS":
                        self._received.append(line)
                    yield line, message
        except OSError as error:
            raise DaemonError.of("the daemon", str(error)) from error
        raise _EndedByPerson

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()
