"""HTTP over one connection by uvicorn, with limits of time and size before and after a token is shown.

Each stage of a request has its time, however many bytes come meanwhile: the head, the body, the answer. A connection
that has shown no token is closed at the end of it, and after its answer. Uvicorn's setting of a time,
`timeout_keep_alive`, limits none of these: it ends with the first byte of a head.
"""

from __future__ import annotations

import asyncio
import socket
import struct
from typing import Any

import h11
from starlette.types import Scope
from uvicorn.config import Config
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from compd.page.connections import Connections

# Time limit (s) for a request's head, from the connection's start or the end of the previous answer.
HEAD_WITHIN_S = 5.0
# Time limit (s) for each stage without a token, and for an ignored body.
UNKNOWN_WITHIN_S = 5.0
# Time limit (s) for a body with a token: an instrument's export over a slow wireless network.
BODY_WITHIN_S = 600.0
# Time limit (s) for sending the rest after the server has closed its end.
FLUSH_WITHIN_S = 60.0
# Largest head (bytes) of a request.
MAX_HEAD_BYTES = 16 * 1024
# Connections accepted in one turn of the event loop: far fewer than are kept without a token, so that a new one has its
# turns to show one before as many others arrive.
ACCEPTED_AT_ONCE = 8
# Connections that wait in the system meanwhile: backlog of listen(2).
WAITING = 1024
# Bytes that the system buffers of a stream of events for a browser that does not read: a few seconds. Any other answer
# is sent many times faster with the system's own size.
EVENTS_BUFFER_BYTES = 32 * 1024
_STATE_KEY = "connection"
# struct linger of socket(7): on, 0 s.
_NO_LINGER = struct.pack("ii", 1, 0)


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
        """The connection of a request; None for one of another server."""
        connection: LimitedProtocol | None = scope.get("state", {}).get(_STATE_KEY)
        return connection

    def admit(self, name: str) -> bool:
        """A request has shown the token of this name; False if its limit of connections is reached."""
        self._known = self._all.admit(self, name)
        self._watch()
        return self._known

    def begin_events(self) -> None:
        """The answer is a stream of events, of which a slow browser gets the newest instead of all."""
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, EVENTS_BUFFER_BYTES)

    def note(self, what: str) -> None:
        """Count an event of a request in the log."""
        self._all.log.note(what)

    @property
    def idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def drop(self) -> None:
        """Close the connection at once; unsent data is lost, including that in the system's buffers."""
        if self._socket.fileno() >= 0:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _NO_LINGER)
        self.transport.abort()

    @property
    def _socket(self) -> socket.socket:
        own: socket.socket = self.transport.get_extra_info("socket")
        return own

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """As asyncio.Protocol."""
        super().connection_made(transport)
        self._watch()
        self._all.came(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """As asyncio.Protocol."""
        self._all.went(self)
        if self._deadline is not None:
            self._deadline.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """As asyncio.Protocol."""
        self._received = True
        super().data_received(data)
        self._watch()

    def on_response_complete(self) -> None:
        """The whole answer has been handed over for sending."""
        super().on_response_complete()
        self._watch()

    def send_400_response(self, msg: str) -> None:
        """The received data is no HTTP, or its head is too large. The connection just ends if an answer has begun."""
        self._all.log.note("no_http")
        if self.idle and self.conn.our_state is h11.IDLE:
            super().send_400_response(msg)
        else:
            self.drop()

    def _watch(self) -> None:
        """Start the time limit of a stage; bytes received in the stage do not extend it."""
        watched = (self.transport.is_closing(), self.idle, self.conn.their_state, self._known, id(self.cycle))
        if watched == self._watched:
            return
        self._watched = watched
        if self._deadline is not None:
            self._deadline.cancel()
        within_s = self._within_s()
        self._deadline = None if within_s is None else self.loop.call_later(within_s, self._late)

    def _within_s(self) -> float | None:
        """Time limit (s) of this stage; None for an answer to a token."""
        if not self._known:
            return UNKNOWN_WITHIN_S
        if self.transport.is_closing():
            return FLUSH_WITHIN_S
        if self.conn.their_state is h11.SEND_BODY:
            return UNKNOWN_WITHIN_S if self.idle else BODY_WITHIN_S
        return HEAD_WITHIN_S if self.conn.their_state is h11.IDLE else None

    def _late(self) -> None:
        if self._known and self.conn.their_state is h11.IDLE and not self.transport.is_closing():
            self.transport.close()  # the end of an answer may still be in transit
            self._watch()
        elif self._received:
            self._all.closed(self, "too_slow")
        else:
            self.drop()  # browsers connect in advance, and may never use the connection
