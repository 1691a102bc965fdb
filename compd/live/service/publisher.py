"""The publisher: takes setpoints and cycles from their rings and sends them to clients.

The loop never waits for it, and it waits for no client. Its thread sleeps until something is there that a client is due
for, and sends it to the clients that are due. Their requests come after that, one of each client in turn, and what the
loop has made in between goes out before the next: a client that asks without end waits, and nobody else does. Where the
loop makes no setpoints, the publisher says so in the loop's place.
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

from compd.live.loop import CycleUnpacker, Setpoint
from compd.live.memory import RingReader, SharedRing
from compd.live.service.client_session import ClientSession, Stream
from compd.live.service.connection_limits import WRONG_TOKEN_REST_S, prepare_tcp, seat_lost, seat_refused
from compd.live.service.descriptor_bin import DescriptorBin
from compd.live.service.listeners import Listeners
from compd.live.service.loop_watch import LoopWatch
from compd.live.service.messages import ErrorCode, ProtocolError
from compd.live.service.requests import Requests
from compd.live.system import System

# Between two looks for clients that are to lose their place.
_LOOK_EVERY_S = 0.25
# The requests of all clients but the controller take at most a third of the time.
_REST_PER_TURN = 2.0
# The process may have been suspended in a turn.
_MAX_REST_S = 0.05
# Of a setpoint for clients, s: older ones have piled up while this process stood still, and only make a client late.
_MAX_AGE_S = 1.0

_log = structlog.get_logger()


class Publisher:
    """Serves the clients of the Unix socket and, where configured, of TCP."""

    def __init__(
        self,
        *,
        listeners: Listeners,
        setpoints: SharedRing,
        cycles: SharedRing,
        watch: LoopWatch,
        period_s: float,
        system: System,
        observers: Sequence[Callable[[Setpoint], None]] = (),
        packet_hash: bytes | None = None,
    ) -> None:
        """`period_s`: of the loop. `observers` are called with every setpoint that is read, on the publisher's thread:
        the first of a new state is always among them, for the log. With a `packet_hash` there are UDP packets, and all
        setpoints are read."""
        self._listeners = listeners
        self._setpoints, self._cycles = RingReader(setpoints), RingReader(cycles)
        self._watch = watch
        self._half_period_s = period_s / 2
        self._system = system
        self._observers = tuple(observers)
        self._packet_hash = packet_hash
        self._unpacker = CycleUnpacker()
        self._sessions: set[ClientSession] = set()
        self._answers: deque[tuple[ClientSession, bytes]] = deque()
        self._orders: deque[bytes] = deque()
        self._unwanted = DescriptorBin(system)
        self._waiting: list[ClientSession] = []  # with lines to answer
        self._next_turn_s = self._next_look_s = -math.inf
        self._selector: selectors.BaseSelector  # from `run` on, in the process that serves
        self._requests: Requests  # likewise: it needs the publisher's own figures for STATUS
        self._due_s = dict.fromkeys(Stream, math.inf)
        self._last_state = -1
        self.dropped_clients = 0  #: that were too far behind

    def run(self, requests: Requests, keep_on: Callable[[], bool], each_round: Callable[[], None]) -> None:
        """Serve on this thread, as long as `keep_on`. `each_round` is called at least every `LoopWatch.limit_s`."""
        self._requests = requests
        self._selector = self._system.selector()
        for listener in (self._listeners.tcp, self._listeners.unix):
            if listener is not None:
                listener.setblocking(False)
                accept = partial(self._accept, listener, listener is self._listeners.unix)
                self._selector.register(listener, selectors.EVENT_READ, accept)
        for reader in (self._setpoints, self._cycles):
            self._selector.register(reader.ring.woken, selectors.EVENT_READ, partial(self._be_woken, reader.ring))
        self._schedule()
        while keep_on():
            for key, events in self._selector.select(self._wait_s()):
                key.data(events)
            self._forward()
            self._take_turns()
            self._look_at_seats()
            each_round()

    def end(self, reason: str) -> None:
        """Send a last setpoint, a `stop` with this reason, and close every connection."""
        self._forward()
        self._publish_in_place_of_loop(self._watch.stop(self._system.monotonic(), reason))
        for session in self._sessions:
            session.close()
        self._selector.close()

    def summary(self) -> dict[str, Any]:
        """Clients now, and clients and setpoints dropped so far, for STATUS."""
        controller = self._requests.context.controller
        sessions = sorted(self._sessions, key=lambda session: session.connected_s)
        return {
            "clients": len(sessions),
            "connected": [session.summary(session is controller) for session in sessions],
            "dropped_clients": self.dropped_clients,
            "dropped_setpoints": self._setpoints.dropped + self._cycles.dropped,
        }

    def _wait_s(self) -> float:
        now_s = self._system.monotonic()
        wait_s = self._watch.wait_s(now_s)
        return min(wait_s, max(self._next_turn_s - now_s, 0.0)) if self._waiting else wait_s

    def _accept(self, listener: socket.socket, local: bool, _events: int) -> None:
        try:
            connection, address = listener.accept()
        except OSError as error:
            _log.warning("a client could not be accepted", error=error.strerror)
            return
        if not local and not self._requests.admits(address[0]):
            _log.warning("a client is not allowed", client=address[0])
            connection.close()
            return
        if not local:
            prepare_tcp(connection)
        name = "unix" if local else f"{address[0]}:{address[1]}"
        session = ClientSession(
            connection, name, local, self._unwanted, self._system.monotonic(), self._requests.place_of
        )
        tcp_clients = sum(not other.local for other in self._sessions)
        if (refusal := seat_refused(local, len(self._sessions), tcp_clients)) is not None:
            session.send(refusal.to_json())
            session.close()
            return
        self._sessions.add(session)
        self._selector.register(connection, selectors.EVENT_READ, partial(self._serve, session))
        self._send(session, self._requests.greeting(session))

    def _serve(self, session: ClientSession, events: int) -> None:
        if events & selectors.EVENT_WRITE:
            session.flush()
        if events & selectors.EVENT_READ and self._is_read(session):
            session.receive(self._system.monotonic())
            if session.has_ended:
                self._requests.context.release(session)
            if session.has_lines and session not in self._waiting:
                self._waiting.append(session)
        self._update_events(session)

    def _take_turns(self) -> None:
        """Answer one request of each client that waits: of the controller now, of the others when they are due."""
        start_s = self._system.monotonic()
        controller = self._requests.context.controller
        others = start_s >= self._next_turn_s
        turns = [session for session in self._waiting if others or session is controller]
        for session in turns:
            if not session.open:
                continue
            self._forward()  # what has been computed until now is not for a client that asks only now
            session.asked_s = self._system.monotonic()
            reply = self._reply(session, session.next_line())
            self._schedule()  # before the answer: a client that has it can rely on the next setpoint
            self._send(session, reply)
        if others and turns:
            now_s = self._system.monotonic()
            self._next_turn_s = now_s + min(_REST_PER_TURN * (now_s - start_s), _MAX_REST_S)
        self._waiting = [
            session for session in self._waiting if session.open and session.is_served and session.has_lines
        ]
        for session in turns:
            self._update_events(session)
        if turns:
            self._schedule()

    def _reply(self, session: ClientSession, received: bytes | ProtocolError) -> bytes:
        try:
            if isinstance(received, ProtocolError):
                raise received
            return self._requests.answer(session, received, partial(self._answer_later, session))
        except ProtocolError as error:
            if not session.authorized and session.is_served:
                _log.warning("a client has not shown the token", client=session.name, reason=error.code)
                session.dismissed_s = self._system.monotonic() + WRONG_TOKEN_REST_S
            return error.to_json() if session.is_served else b""
        finally:
            session.end_line()

    def _look_at_seats(self) -> None:
        """Close the connections of clients that have lost their place."""
        now_s = self._system.monotonic()
        if now_s < self._next_look_s:
            return
        self._next_look_s = now_s + _LOOK_EVERY_S
        for session in list(self._sessions):
            lost = seat_lost(session, session is self._requests.context.controller, now_s)
            if now_s >= session.dismissed_s:
                lost = ProtocolError(ErrorCode.NOT_AUTHORIZED, "the token is wrong, or AUTH was not the first line")
            if lost is None:
                continue
            _log.warning("client dropped", client=session.name, reason=lost.text)
            session.send(lost.to_json())
            session.open = False
            self._update_events(session)

    def _answer_later(self, session: ClientSession, answer: bytes) -> None:
        """Hand an answer that took time to the publisher's thread; called from any thread."""
        self._answers.append((session, answer))
        self._setpoints.ring.wake_reader()

    def tell_order(self, order: bytes) -> None:
        """Hand an ORDER line, for whoever watches readings, to the publisher's thread; called from any thread."""
        self._orders.append(order)
        self._setpoints.ring.wake_reader()

    def _be_woken(self, ring: SharedRing, _events: int) -> None:
        """Send the late answers, and orders to those who record; what is in the rings follows after them."""
        os.eventfd_read(ring.woken)
        while self._answers:
            self._send(*self._answers.popleft())
        while self._orders:
            order = self._orders.popleft()
            for session in [session for session in self._sessions if session.watches_readings]:
                self._send(session, order)

    def _forward(self) -> None:
        """Publish what is due; where there is nothing from the loop, say so."""
        for content in self._setpoints.contents(self._is_setpoint_due):
            setpoint = Setpoint.unpack(content)
            if self._watch.admits(setpoint.seq, setpoint.time_s):
                self._publish(setpoint)
        for content in self._cycles.contents(lambda time_s, _: self._is_due(Stream.READINGS, time_s)):
            cycle = self._unpacker.unpack(content)
            readings = self._requests.context.messages.readings
            assert readings is not None, "who watches them has been told their columns"
            self._send_to_watchers(Stream.READINGS, cycle.inputs.snapshot.time_s, readings.line(cycle))
        if (stop := self._watch.missing(self._system.monotonic())) is not None:
            self._publish_in_place_of_loop(stop)

    def _is_setpoint_due(self, time_s: float, state: int) -> bool:
        return self._packet_hash is not None or state != self._last_state or self._is_due(Stream.SETPOINTS, time_s)

    def _is_due(self, stream: Stream, time_s: float) -> bool:
        return time_s >= self._due_s[stream] - self._half_period_s

    def _publish(self, setpoint: Setpoint) -> None:
        self._last_state = setpoint.state.code
        for observe in self._observers:
            observe(setpoint)
        if self._system.monotonic() - setpoint.time_s <= _MAX_AGE_S:
            self._send_to_watchers(Stream.SETPOINTS, setpoint.time_s, setpoint.line)

    def _publish_in_place_of_loop(self, setpoint: Setpoint) -> None:
        _, content = setpoint.pack(self._packet_hash)
        self._publish(Setpoint.unpack(content))

    def _send_to_watchers(self, stream: Stream, time_s: float, line: bytes) -> None:
        """Send a line to the clients of a stream that are due at `time_s`."""
        for session in list(self._sessions):
            if session.stream is stream and session.take(time_s, self._half_period_s):
                self._send(session, line)
        self._schedule()

    def _schedule(self) -> None:
        """Note when the next client of each stream is due, and ask to be woken then."""
        for stream, reader in ((Stream.SETPOINTS, self._setpoints), (Stream.READINGS, self._cycles)):
            due_s = min((session.due_s for session in self._sessions if session.stream is stream), default=math.inf)
            self._due_s[stream] = due_s
            every_one = stream is Stream.SETPOINTS and self._packet_hash is not None
            reader.ring.wake_from(-math.inf if every_one else due_s - self._half_period_s)

    def _send(self, session: ClientSession, data: bytes) -> None:
        if data and session.open and not session.send(data):
            self.dropped_clients += 1
            session.open = False
            _log.warning("slow client dropped", client=session.name)
        self._update_events(session)

    def _is_read(self, session: ClientSession) -> bool:
        """Whether more is received from a client: behind a line that waits only of the controller."""
        return session.is_read and (not session.has_lines or session is self._requests.context.controller)

    def _update_events(self, session: ClientSession) -> None:
        """Ask for what a client is ready for; forget one that has gone.

        That it can be written to matters only while data wait for it.
        """
        if session not in self._sessions:
            return
        if session.has_ended and not session.has_lines:
            session.open = False
        connection = session.connection
        registered = connection in self._selector.get_map()
        events = selectors.EVENT_WRITE if session.has_unsent else 0
        if self._is_read(session):
            events |= selectors.EVENT_READ
        if registered and (not session.open or not events):
            self._selector.unregister(connection)
        elif session.open and events and not registered:
            self._selector.register(connection, events, partial(self._serve, session))
        elif session.open and events and self._selector.get_key(connection).events != events:
            self._selector.modify(connection, events, partial(self._serve, session))
        if not session.open:
            self._sessions.discard(session)
            self._requests.context.release(session)
            session.close()
