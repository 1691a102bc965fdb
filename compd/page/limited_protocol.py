"""HTTP over one connection, as uvicorn has it, within limits of time and size before and after a token is seen.

Each stage of a request has its time, however many bytes come meanwhile: the head, the body, the answer. A connection
that has shown no token is closed at the end of it, and after its answer.
"""

from __future__ import annotations

import asyncio
import socket
import struct
from enum import Enum, auto
from typing import Any

import h11
from starlette.types import Scope
from uvicorn.config import Config
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from compd.page.connections import Connections

# From a connection's begin, or from the end of an answer, to the end of the next request's head.
HEAD_WITHIN_S = 5.0
# A body, or reading an answer, without a token; and a body that nobody wants.
UNKNOWN_WITHIN_S = 5.0
# A body with a token: an instrument's export over a slow wireless network.
BODY_WITHIN_S = 600.0
# What is still to be sent when the server has closed its end.
FLUSH_WITHIN_S = 60.0
# Of a request's head.
LARGEST_HEAD_BYTES = 16 * 1024
# Connections that are taken in one turn of the event loop. It is much smaller than the number without a token that are
# kept, so that a newcomer has had its turns to show one before so many others have come.
ACCEPTED_AT_ONCE = 8
# Connections that wait in the system meanwhile, listen(2).
WAITING = 1024
_STATE_KEY = "connection"
# struct linger of socket(7): on, 0 s.
_NO_LINGER = struct.pack("ii", 1, 0)


class Stage(Enum):
    """What a connection is waiting for."""

    HEAD = auto()
    BODY = auto()
    UNWANTED_BODY = auto()
    ANSWER = auto()
    END = auto()


class LimitedProtocol(H11Protocol):
    """One connection, among `all_connections`."""

    def __init__(
        self,
        all_connections: Connections,
        config: Config,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        super().__init__(config, server_state, {**app_state, _STATE_KEY: self}, _loop)
        self._all = all_connections
        self._known = self._received = False
        self._watched: tuple[object, ...] = ()
        self._deadline: asyncio.TimerHandle | None = None

    @staticmethod
    def of(scope: Scope) -> LimitedProtocol | None:
        """The connection of a request; None where another server took it."""
        connection: LimitedProtocol | None = scope.get("state", {}).get(_STATE_KEY)
        return connection

    def admit(self, name: str) -> bool:
        """A request has shown the token of this name; False where there is no place for one more connection with it."""
        self._known = self._all.admit(self, name)
        self._watch()
        return self._known

    def note(self, what: str) -> None:
        """Count in the log what a request did."""
        self._all.note(what)

    @property
    def idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def drop(self) -> None:
        """Close the connection at once; what is still to be sent is lost, in the system's buffers, too."""
        own = self.transport.get_extra_info("socket")
        if own.fileno() >= 0:
            own.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _NO_LINGER)
        self.transport.abort()

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """As of asyncio.Protocol."""
        super().connection_made(transport)
        self._watch()
        self._all.came(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """As of asyncio.Protocol."""
        self._all.went(self)
        if self._deadline is not None:
            self._deadline.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """As of asyncio.Protocol."""
        self._received = True
        super().data_received(data)
        self._watch()

    def on_response_complete(self) -> None:
        """The whole answer is on its way."""
        super().on_response_complete()
        self._watch()

    def send_400_response(self, msg: str) -> None:
        """What came is no HTTP, or its head is too large. Where an answer has begun, the connection just ends."""
        self._all.note("no_http")
        if self.idle and self.conn.our_state is h11.IDLE:
            super().send_400_response(msg)
        else:
            self.drop()

    def _stage(self) -> Stage:
        if self.transport.is_closing():
            return Stage.END
        if self.conn.their_state is h11.SEND_BODY:
            return Stage.UNWANTED_BODY if self.idle else Stage.BODY
        return Stage.HEAD if self.conn.their_state is h11.IDLE else Stage.ANSWER

    def _watch(self) -> None:
        """Give a stage that has begun its time; bytes that come in a stage do not make it longer."""
        watched = (self._stage(), self._known, id(self.cycle))
        if watched == self._watched:
            return
        self._watched = watched
        if self._deadline is not None:
            self._deadline.cancel()
        within_s = self._within_s(watched[0])
        self._deadline = None if within_s is None else self.loop.call_later(within_s, self._late)

    def _within_s(self, stage: Stage) -> float | None:
        if stage is Stage.HEAD:
            return HEAD_WITHIN_S
        if not self._known or stage is Stage.UNWANTED_BODY:
            return UNKNOWN_WITHIN_S
        return {Stage.BODY: BODY_WITHIN_S, Stage.END: FLUSH_WITHIN_S}.get(stage)

    def _late(self) -> None:
        if self._known and self._stage() is Stage.HEAD:
            self.transport.close()  # the end of an answer may still be on its way
            self._watch()
        elif self._received:
            self._all.closed(self, "too_slow")
        else:
            self.drop()  # browsers connect in advance, and may need it never
