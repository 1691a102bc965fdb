"""The publisher: takes setpoints from the ring and sends them to clients. The loop never waits for it, and it waits
for no client.

Its thread sleeps until a setpoint is there that a client is due for, encodes each once, sends it to the clients that
are due, and answers their requests. Where the loop makes no setpoints, it says so in the loop's place.
"""

from __future__ import annotations

import math
import os
import selectors
import socket
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import structlog

from compd.clock import Clock
from compd.live.loop.sent_cycle import CycleDecoder, SentCycle
from compd.live.loop.setpoint import Setpoint
from compd.live.memory.setpoint_ring import ENTRIES, SetpointRing
from compd.live.service.client_session import ClientSession
from compd.live.service.listeners import Listeners
from compd.live.service.loop_watch import LoopWatch
from compd.live.service.messages import ErrorCode, ProtocolError
from compd.live.service.requests import Requests

MAX_CLIENTS = 32
# Entries that the loop may write while one is read.
_MARGIN = 16

_log = structlog.get_logger()


class Publisher:
    """Serves the clients of the Unix socket and, where configured, of TCP.

    Attributes
    ----------
    dropped_setpoints : that the ring no longer had when they were to be read.
    dropped_clients : that were too far behind.
    """

    def __init__(
        self,
        listeners: Listeners,
        ring: SetpointRing,
        watch: LoopWatch,
        period_s: float,
        clock: Clock,
        observers: Sequence[Callable[[Setpoint], None]] = (),
        every_cycle: bool = False,
    ) -> None:
        """`period_s`: of the loop. `observers` are called with every setpoint that is read, on the publisher's thread:
        the first of a new state is always among them, for the log, and with `every_cycle` all of them are read."""
        self._listeners = listeners
        self._ring = ring
        self._watch = watch
        self._half_period_s = period_s / 2
        self._clock = clock
        self._observers = tuple(observers)
        self._every_cycle = every_cycle
        self._decoder = CycleDecoder()
        self._sessions: set[ClientSession] = set()
        self._answers: deque[tuple[ClientSession, bytes]] = deque()
        self._selector: selectors.BaseSelector  # from `run` on, in the process that serves
        self._requests: Requests  # likewise: it needs the publisher's own figures for STATUS
        self._next_entry = 0
        self._next_due_s = math.inf
        self._last_state = -1
        self.dropped_setpoints = 0
        self.dropped_clients = 0

    def run(self, requests: Requests, keep_on: Callable[[], bool], each_round: Callable[[], None]) -> None:
        """Serve on this thread, as long as `keep_on`. `each_round` is called at least every `LoopWatch.limit_s`."""
        self._requests = requests
        self._selector = selectors.DefaultSelector()
        if self._listeners.tcp is not None:
            tcp = self._listeners.tcp
            self._selector.register(tcp, selectors.EVENT_READ, partial(self._accept, tcp, False))
        unix = self._listeners.unix
        self._selector.register(unix, selectors.EVENT_READ, partial(self._accept, unix, True))
        self._selector.register(self._ring.woken, selectors.EVENT_READ, self._be_woken)
        self._schedule()
        while keep_on():
            for key, events in self._selector.select(self._watch.limit_s):
                key.data(events)
            self._forward()
            each_round()

    def end(self, reason: str) -> None:
        """Send a last setpoint, a `stop` with this reason, and close every connection."""
        self._forward()
        self._publish(SentCycle(self._watch.stop(self._clock.monotonic(), reason)))
        for session in self._sessions:
            session.close()
        self._selector.close()

    def summary(self) -> dict[str, Any]:
        """Clients now, and clients and setpoints dropped so far, for STATUS."""
        return {
            "clients": len(self._sessions),
            "dropped_clients": self.dropped_clients,
            "dropped_setpoints": self.dropped_setpoints,
        }

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
        self._forward()  # what has been computed until now is not for a client that asks only now
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
        self._ring.wake_reader()

    def _be_woken(self, _events: int) -> None:
        """Send the late answers; the setpoints follow at the end of the round."""
        os.eventfd_read(self._ring.woken)
        while self._answers:
            self._send(*self._answers.popleft())

    def _forward(self) -> None:
        """Publish the setpoints that are due and those of a new state; where there are none from the loop, say so."""
        ring = self._ring
        count = ring.count
        if (behind := count - self._next_entry - ENTRIES + _MARGIN) > 0:
            self.dropped_setpoints += behind
            self._next_entry += behind
        while self._next_entry < count:
            time_s, state = ring.when(self._next_entry)
            is_due = self._every_cycle or time_s >= self._next_due_s - self._half_period_s
            if is_due or state != self._last_state:
                if (entry := ring.get(self._next_entry)) is None:
                    self.dropped_setpoints += 1
                else:
                    cycle = self._decoder.decode(entry.content)
                    self._watch.note(cycle.setpoint.seq)
                    self._publish(cycle)
                    self._schedule()
            self._next_entry += 1
        if (stop := self._watch.missing(self._clock.monotonic())) is not None:
            self._publish(SentCycle(stop))
            self._schedule()

    def _publish(self, cycle: SentCycle) -> None:
        """Send a cycle to the clients that are due. It is encoded once per kind of message."""
        setpoint = cycle.setpoint
        self._last_state = setpoint.state.code
        for observe in self._observers:
            observe(setpoint)
        encoded: dict[Callable[[SentCycle], bytes], bytes] = {}
        for session in list(self._sessions):
            if session.take(setpoint.time_s, self._half_period_s):
                if session.encode not in encoded:
                    encoded[session.encode] = session.encode(cycle)
                self._send(session, encoded[session.encode])

    def _schedule(self) -> None:
        """Note when the next client is due, and ask to be woken then."""
        self._next_due_s = min((session.due_s for session in self._sessions), default=math.inf)
        self._ring.wake_from(-math.inf if self._every_cycle else self._next_due_s - self._half_period_s)

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
