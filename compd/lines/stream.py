"""A line of bytes with deadlines: what an ASCII driver, and the Modbus RTU master, talk through."""

from __future__ import annotations

import threading

from compd.clock import Clock
from compd.gauge import LineFault, Quality
from compd.lines.port import Port

SHOWN_BYTES = 40  # of a broken reply, for a person
# A line that babbles is drained for at most so many timeouts.
MOST_DRAIN_TIMEOUTS = 10
# A rest that takes longer than this on the wire is slept through, not taken byte by byte.
WORTH_SLEEPING_S = 1e-3


def shown(data: bytes) -> str:
    """Bytes for a fault's detail: b'+    12.34'."""
    return repr(data[:SHOWN_BYTES]) + ("..." if len(data) > SHOWN_BYTES else "")


class StreamLine:
    """`ByteLine` over a port. One thread uses it.

    Two rules keep a reply with its request: a request leaves only when nothing has come for `gap_s`, and
    what comes unasked is thrown away and counted in `unexpected_bytes`.
    """

    def __init__(self, port: Port, timeout_s: float, gap_s: float, clock: Clock) -> None:
        """`timeout_s`: for the first byte of a reply, and again for the rest of it beside its time on the wire."""
        self.unexpected_bytes = 0
        self._port = port
        self._timeout_s = timeout_s
        self._gap_s = gap_s
        self._clock = clock
        self._never = threading.Event()
        self._waiting = bytearray()
        self._last_byte_s = clock.monotonic()

    def send(self, request: bytes) -> float:
        """Write `request` once the line is quiet; the monotonic time (s) at which its last bit had left.

        Raises LineFault: MISMATCH when the line is never quiet, LINE_LOST.
        """
        self._become_quiet()
        started_s = self._clock.monotonic()
        self._port.write(request)
        return started_s + len(request) * self._port.character_s

    def listen(self) -> float:
        """Throw away what has come so far, without waiting for quiet; the monotonic time (s) of it.

        Raises LineFault: MISMATCH when there is no end of it, LINE_LOST.
        """
        self._waiting.clear()
        give_up_s = self._clock.monotonic() + self._timeout_s
        while data := self._port.read(0.0):
            self._last_byte_s = self._clock.monotonic()
            if self._last_byte_s > give_up_s:
                raise LineFault(Quality.MISMATCH, f"more comes than can be read: {shown(data)}")
        return self._clock.monotonic()

    def receive(self, count: int, timeout_s: float | None = None) -> bytes:
        """Exactly `count` bytes. Raises LineFault: TIMEOUT, INCOMPLETE, LINE_LOST."""
        deadline_s = self._first_byte(timeout_s) + count * self._port.character_s
        while len(self._waiting) < count:
            self._more(count, deadline_s)
        return self._take(count)

    def receive_until(self, terminator: bytes, limit: int, timeout_s: float | None = None) -> bytes:
        """Bytes up to and including `terminator`. Raises LineFault: MISMATCH beyond `limit` bytes, TIMEOUT,
        INCOMPLETE, LINE_LOST."""
        deadline_s = self._first_byte(timeout_s) + limit * self._port.character_s
        searched = 0
        while True:
            found = self._waiting.find(terminator, searched)
            if 0 <= found <= limit - len(terminator):
                return self._take(found + len(terminator))
            if len(self._waiting) >= limit:
                raise LineFault(Quality.MISMATCH, f"no end within {limit} bytes: {shown(bytes(self._waiting))}")
            searched = max(0, len(self._waiting) - len(terminator) + 1)
            self._more(limit, deadline_s)

    def drain(self) -> bytes:
        """After a fault: wait until nothing has come for the line's timeout; what came (its first bytes)."""
        dropped = self._take(len(self._waiting))
        until_s = self._clock.monotonic() + MOST_DRAIN_TIMEOUTS * self._timeout_s
        while (data := self._port.read(self._timeout_s)) and self._clock.monotonic() < until_s:
            dropped += data
        self.unexpected_bytes += len(dropped)
        return dropped

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def _become_quiet(self) -> None:
        self.unexpected_bytes += len(self._waiting)
        self._waiting.clear()
        give_up_s = self._clock.monotonic() + self._timeout_s
        while data := self._port.read(self._last_byte_s + self._gap_s - self._clock.monotonic()):
            self._last_byte_s = self._clock.monotonic()
            self.unexpected_bytes += len(data)
            if self._last_byte_s > give_up_s:
                raise LineFault(Quality.MISMATCH, f"the line is never quiet: {shown(data)}")

    def _first_byte(self, timeout_s: float | None) -> float:
        """Wait for the first byte of a reply; the time (s) by which the rest must be here, its wire time apart."""
        if not self._waiting:
            wait_s = self._timeout_s if timeout_s is None else timeout_s
            data = self._port.read(wait_s)
            if not data:
                raise LineFault(Quality.TIMEOUT, f"no byte within {wait_s:g} s")
            self._arrived(data)
        return self._last_byte_s + self._timeout_s

    def _more(self, count: int, deadline_s: float) -> None:
        """More of a reply of at most `count` bytes."""
        on_the_wire_s = (count - len(self._waiting)) * self._port.character_s
        if on_the_wire_s > WORTH_SLEEPING_S:
            self._clock.wait(self._never, on_the_wire_s)
        data = self._port.read(deadline_s - self._clock.monotonic())
        if not data:
            raise LineFault(Quality.INCOMPLETE, f"only {len(self._waiting)} bytes: {shown(bytes(self._waiting))}")
        self._arrived(data)

    def _arrived(self, data: bytes) -> None:
        self._waiting += data
        self._last_byte_s = self._clock.monotonic()

    def _take(self, count: int) -> bytes:
        taken = bytes(self._waiting[:count])
        del self._waiting[:count]
        return taken
