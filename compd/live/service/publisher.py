"""The publisher: one thread between the loop and its clients. The loop never waits for it, and it waits for no client.

The loop calls `deliver` with every setpoint. The publisher's thread takes them from a bounded queue, encodes each once,
sends it to the clients that are due, and answers their requests.
"""

from __future__ import annotations

import math
import os
import selectors
import socket
import threading
from collections import deque
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import structlog

from compd.configuration.operation import SocketSettings
from compd.errors import DaemonError
from compd.live.loop.setpoint import Setpoint
from compd.live.loop.states import State
from compd.live.service.client_session import ClientSession
from compd.live.service.listeners import listen_tcp, listen_unix
from compd.live.service.messages import ErrorCode, ProtocolError
from compd.live.service.requests import Requests

# Half a second at 1 kHz: longer than any pause of the publisher that is not a fault.
_QUEUE_LENGTH = 512
MAX_CLIENTS = 32

_log = structlog.get_logger()


class Publisher:
    """Listens on the Unix socket and, where configured, on TCP; sends setpoints and answers."""

    def __init__(self, sockets: SocketSettings, period_s: float, observe: Callable[[Setpoint], None]) -> None:
        """`period_s`: of the loop; `observe` is called with every setpoint that is queued, on the publisher's thread:
        the first of a new state is always among them, for the log."""
        self._sockets = sockets
        self._half_period_s = period_s / 2
        self._observe = observe
        self._selector = selectors.DefaultSelector()
        self._sessions: set[ClientSession] = set()
        self._queue: deque[Setpoint] = deque()
        self._answers: deque[tuple[ClientSession, bytes]] = deque()
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="publisher", daemon=True)
        self._requests: Requests  # from `start` on: it needs the publisher's own figures for STATUS
        # Read by the loop's thread: when a client is due, and the state of the setpoint that was queued last.
        self._next_due_s = math.inf
        self._last_state: State | None = None
        self.dropped_setpoints = 0
        self.dropped_clients = 0
        self.tcp_port: int | None = None

    def start(self, requests: Requests) -> None:
        """Listen, and serve on a thread of its own. Raises DaemonError where an address cannot be had."""
        self._requests = requests
        try:
            if self._sockets.tcp is not None:
                listener = listen_tcp(self._sockets.tcp.host, self._sockets.tcp.port)
                self.tcp_port = listener.getsockname()[1]
                self._selector.register(listener, selectors.EVENT_READ, partial(self._accept, listener, False))
            listener = listen_unix(Path(self._sockets.unix.path))
            self._selector.register(listener, selectors.EVENT_READ, partial(self._accept, listener, True))
        except DaemonError:
            self._close()
            raise
        self._selector.register(self._wake, selectors.EVENT_READ, self._send_queued)
        self._thread.start()

    def stop(self) -> None:
        """Close every connection; return when the thread has ended."""
        self._stop.set()
        os.eventfd_write(self._wake, 1)
        self._thread.join()
        Path(self._sockets.unix.path).unlink(missing_ok=True)
        self._close()

    def _close(self) -> None:
        for key in list(self._selector.get_map().values()):
            if isinstance(key.fileobj, socket.socket):
                key.fileobj.close()
        self._selector.close()
        os.close(self._wake)

    @property
    def alive(self) -> bool:
        """False once the thread has ended, for whatever reason."""
        return self._thread.is_alive()

    def deliver(self, setpoint: Setpoint) -> None:
        """Queue a setpoint when a client is due or the state is new; called by the loop with every setpoint.

        When the queue is full the oldest setpoint is dropped and counted.
        """
        if setpoint.time_s < self._next_due_s - self._half_period_s and setpoint.state is self._last_state:
            return
        self._last_state = setpoint.state
        if len(self._queue) >= _QUEUE_LENGTH:
            try:
                self._queue.popleft()
                self.dropped_setpoints += 1
            except IndexError:
                pass  # the publisher has just emptied it
        self._queue.append(setpoint)
        os.eventfd_write(self._wake, 1)

    def summary(self) -> dict[str, Any]:
        """Clients now, and clients and setpoints dropped so far, for STATUS."""
        return {
            "clients": len(self._sessions),
            "dropped_clients": self.dropped_clients,
            "dropped_setpoints": self.dropped_setpoints,
        }

    def _run(self) -> None:
        while not self._stop.is_set():
            for key, events in self._selector.select():
                key.data(events)

    def _accept(self, listener: socket.socket, local: bool, _events: int) -> None:
        try:
            connection, address = listener.accept()
        except OSError as error:
            _log.warning("a client could not be accepted", error=error.strerror)
            return
        if not local:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        session = ClientSession(connection, "unix" if local else f"{address[0]}:{address[1]}", local)
        if len(self._sessions) >= MAX_CLIENTS:
            session.send(ProtocolError(ErrorCode.TOO_MANY_CLIENTS, f"{MAX_CLIENTS} clients at most").to_json())
            session.close()
            return
        self._sessions.add(session)
        self._selector.register(connection, selectors.EVENT_READ, partial(self._serve, session))
        self._send(session, self._requests.version)

    def _serve(self, session: ClientSession, events: int) -> None:
        if events & selectors.EVENT_WRITE:
            session.flush()
        if events & selectors.EVENT_READ:
            for received in session.receive():
                reply = self._reply(session, received)
                self._schedule()  # before the answer: a client that has it can rely on the next setpoint
                self._send(session, reply)
        self._update_events(session)
        self._schedule()

    def _reply(self, session: ClientSession, received: bytes | ProtocolError) -> bytes:
        if isinstance(received, ProtocolError):
            return received.to_json()
        try:
            return self._requests.answer(session, received, partial(self._answer_later, session))
        except ProtocolError as error:
            return error.to_json()

    def _answer_later(self, session: ClientSession, answer: bytes) -> None:
        """Hand an answer that took time to the publisher's thread; called from any thread."""
        self._answers.append((session, answer))
        os.eventfd_write(self._wake, 1)

    def _send_queued(self, _events: int) -> None:
        """Send the late answers and the setpoints that wait. A setpoint is encoded once per kind of message, and only
        for a client that is due."""
        os.eventfd_read(self._wake)
        while self._answers:
            self._send(*self._answers.popleft())
        while self._queue:
            setpoint = self._queue.popleft()
            self._observe(setpoint)
            encoded: dict[Callable[[Setpoint], bytes], bytes] = {}
            for session in list(self._sessions):
                if session.take(setpoint.time_s, self._half_period_s):
                    if session.encode not in encoded:
                        encoded[session.encode] = session.encode(setpoint)
                    self._send(session, encoded[session.encode])
        self._schedule()

    def _schedule(self) -> None:
        """Note for `deliver` when the next client is due."""
        self._next_due_s = min((session.due_s for session in self._sessions), default=math.inf)

    def _send(self, session: ClientSession, data: bytes) -> None:
        if data and session.open and not session.send(data):
            self.dropped_clients += 1
            session.open = False
            _log.warning("slow client dropped", client=session.name)
        self._update_events(session)

    def _update_events(self, session: ClientSession) -> None:
        """Ask for room to write only while data wait for this client; forget a client that has gone."""
        if session not in self._sessions:
            return
        if session.open:
            events = selectors.EVENT_READ | (selectors.EVENT_WRITE if session.has_unsent else 0)
            if self._selector.get_key(session.connection).events != events:
                self._selector.modify(session.connection, events, partial(self._serve, session))
            return
        self._sessions.discard(session)
        self._selector.unregister(session.connection)
        self._requests.release(session)
        session.close()
