"""The page's connection to the daemon: the newest message of each class, and whether the daemon is reachable.

One connection watches READINGS, another asks for STATUS, MODEL and BUDGET. Both are made again by themselves; meanwhile
`connected` is False and there are no messages, so that outdated values disappear.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import orjson
import structlog

Message = dict[str, Any]

READINGS_HZ = 20.0
BUDGET_EVERY_S = 0.2
STATUS_EVERY_S = 1.0
# Silence (s) after which the daemon counts as gone: it sends a message in every cycle, in every state.
SILENT_AFTER_S = 2.0
_AGAIN_AFTER_S = 1.0
_MAX_LINE_BYTES = 4 * 1024 * 1024

_log = structlog.get_logger()


@dataclass
class DaemonLink:
    """The newest messages of the daemon at `path`, its Unix socket; used by the event loop's thread alone."""

    path: str
    connected: bool = False  #: whether the messages below are of a daemon that is there
    reason: str = "not connected yet"  #: why it is not
    machine: Message | None = None  #: machine, columns: MACHINE, and the `columns` of WATCH
    columns: list[Message] = field(default_factory=list)
    #: readings, status, budget, models: the newest of each, `models` of MODEL; None before the first
    readings: Message | None = None
    status: Message | None = None
    budget: Message | None = None
    models: Message | None = None
    #: notified with every READINGS, and when the daemon comes or goes
    news: asyncio.Condition = field(default_factory=asyncio.Condition)

    async def run(self) -> None:
        """Keep the link until cancelled."""
        while True:
            try:
                await self._serve()
            except* (OSError, ValueError, TimeoutError, EOFError) as errors:
                error = errors.exceptions[0]
                await self._gone(self._why(error))
            except* (LookupError, TypeError, AttributeError) as errors:
                await self._gone(f"it tells what this page does not understand: {errors.exceptions[0]!r}")
            await asyncio.sleep(_AGAIN_AFTER_S)

    def _why(self, error: Exception) -> str:
        if isinstance(error, OSError) and not self.connected:
            return f"no daemon answers at {self.path}: {error.strerror or type(error).__name__}"
        if isinstance(error, TimeoutError):
            return f"it has said nothing for {SILENT_AFTER_S:g} s"
        return str(error) or type(error).__name__

    async def _serve(self) -> None:
        """Receive messages until the connection ends."""
        async with DaemonConnection(self.path) as stream, DaemonConnection(self.path) as asked:
            self.machine = await asked.ask({"class": "MACHINE"})
            watching = await stream.ask({"class": "WATCH", "what": "readings", "rate_hz": READINGS_HZ})
            self.columns = watching["columns"]
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._take_readings(stream))
                tasks.create_task(self._ask_again_and_again(asked))

    async def _take_readings(self, stream: DaemonConnection) -> None:
        while True:
            async with asyncio.timeout(SILENT_AFTER_S):  # wait_for of Python 3.11 may lose a cancellation
                message = await stream.read()
            if message["class"] != "READINGS":  # an order stands among them
                continue
            async with self.news:
                self.readings = message
                if not self.connected:
                    _log.info("the daemon is there", path=self.path)
                self.connected, self.reason = True, ""
                self.news.notify_all()

    async def _ask_again_and_again(self, asked: DaemonConnection) -> None:
        loop = asyncio.get_running_loop()
        status_due_s = loop.time()
        while True:
            self.budget = await asked.ask({"class": "BUDGET"})
            if loop.time() >= status_due_s:
                # first the models: a reader of the change in STATUS finds them here
                self.models = await asked.ask({"class": "MODEL"})
                self.status = await asked.ask({"class": "STATUS"})
                status_due_s = loop.time() + STATUS_EVERY_S
            await asyncio.sleep(BUDGET_EVERY_S)

    async def _gone(self, reason: str) -> None:
        async with self.news:
            if self.connected:
                _log.warning("the daemon is gone", path=self.path, reason=reason)
            self.connected, self.reason = False, reason
            self.readings = self.status = self.budget = self.models = None
            self.news.notify_all()


class DaemonConnection:
    """JSON lines to and from the daemon."""

    def __init__(self, path: str) -> None:
        self._path = path

    async def __aenter__(self) -> DaemonConnection:
        self._reader, self._writer = await asyncio.open_unix_connection(self._path, limit=_MAX_LINE_BYTES)
        try:
            _agreed(await self.read(), "the connection")  # the greeting
        except BaseException:  # a cancelled task closes its connection, too
            await self._close()
            raise
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._close()

    async def _close(self) -> None:
        self._writer.close()
        with suppress(OSError):
            await self._writer.wait_closed()

    async def read(self) -> Message:
        """The next message. Raises EOFError at the end."""
        line = await self._reader.readline()
        if not line.endswith(b"\n"):
            raise EOFError("it closed the connection")
        message: Message = orjson.loads(line)
        return message

    async def ask(self, request: Message) -> Message:
        """The answer to a request. Raises ValueError if the daemon refuses it."""
        self._writer.write(orjson.dumps(request) + b"\n")
        async with asyncio.timeout(SILENT_AFTER_S):
            answer = await self.read()
        return _agreed(answer, request["class"])


def _agreed(answer: Message, request: str) -> Message:
    if answer["class"] == "ERROR":
        raise ValueError(f"the daemon refuses {request}: {answer['text']}")
    return answer
