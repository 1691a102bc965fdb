"""A line of bytes with deadlines, for drivers of ASCII and binary protocols and for the Modbus RTU master."""

from __future__ import annotations

import math
import threading

from compd.clock import Clock
from compd.gauge import LineFault, Quality
from compd.lines.echo import is_echo
from compd.lines.port import Port
from compd.lines.usual_time import UsualWait

SHOWN_BYTES = 40  # of a broken reply, in a fault's detail
# Longest draining (timeouts) of a line that never becomes quiet.
MAX_DRAIN_TIMEOUTS = 10
# Least time (s) of a reply's rest on the wire for waiting as a whole instead of byte by byte.
WORTH_SLEEPING_S = 1e-3
# Least wait for a reply's rest, as a share of the timeout: a device may pause within a reply.
MIN_REST = 0.5


def shown(data: bytes) -> str:
    """The first bytes of a reply as text, for a fault's detail: b'+    12.34'."""
    return repr(data[:SHOWN_BYTES]) + ("..." if len(data) > SHOWN_BYTES else "")


class StreamLine:
    """A `ByteLine` over a port. Used by one thread.

    Two rules keep a reply with its request: a request is written only when nothing has come for `gap_s`, and what came
    without a request is discarded and counted in `unexpected_bytes`. `last_request_s` is the monotonic time of the
    last request, s; -inf before the first.
    """

    def __init__(self, port: Port, timeout_s: float, gap_s: float, clock: Clock, echo: bool = False) -> None:
        """`timeout_s`: longest wait for the first byte of a reply, and again for the rest beyond its time on the wire.

        `gap_s`: silence before a request, s. `echo`: the adapter repeats every request, which is taken out.
        """
        self.unexpected_bytes = 0
        self.last_request_s = -math.inf
        self._port = port
        self._timeout_s = timeout_s
        self._gap_s = gap_s
        self._clock = clock
        self._echo = echo
        self._next_line_s = math.nan  # earliest sampling time of the next unsolicited line, s
        self._looks_s = (-math.inf, -math.inf)  # when the last two looks for bytes began
        self._left_s = -math.inf  # when the last bit of the last request will have left
        self._request = b""
        self._came = b""  # since the request, as many bytes as it has
        self._no_event = threading.Event()  # never set: the clock waits for it to pause
        self._received = bytearray()
        self._last_byte_s = clock.monotonic()
        self._first_byte = UsualWait(timeout_s)
        self._rest = UsualWait(timeout_s, MIN_REST * timeout_s)  # of a reply, beyond its time on the wire
        self._not_waited_s = 0.0  # what the last wait in vain was shorter than the timeout
        self._first_s = -math.inf  # when the first byte of the frame whose head was taken was there

    def send(self, request: bytes) -> float:
        """Write `request` once the line is quiet; the monotonic time (s) at which its last bit will have left.

        Raises LineFault: MISMATCH when the line is never quiet, LINE_LOST; where an echo is expected, TIMEOUT,
        INCOMPLETE or MISMATCH for any other.
        """
        self._wait_for_silence()
        self._request, self._came, self._not_waited_s = request, b"", 0.0
        self.last_request_s = self._clock.monotonic()
        self._left_s = self.last_request_s + len(request) * self._port.character_s
        self._port.write(request)
        if self._echo:
            self._take_echo(request)
        return self._left_s

    def pulse_dtr(self, low_s: float) -> float:
        """Ask by DTR, which is LOW for at least `low_s` (s) and HIGH again; the monotonic time (s) of its beginning.

        Raises LineFault: MISMATCH when the line is never quiet, LINE_LOST also where the port has no DTR.
        """
        self._wait_for_silence()
        self._request = b""
        self.last_request_s = self._clock.monotonic()
        self._port.set_dtr(False)
        try:
            self._clock.wait(self._no_event, low_s)
        finally:
            self._port.set_dtr(True)
        return self.last_request_s

    def send_break(self, duration_s: float) -> None:
        """A break of at least `duration_s` (s), once the line is quiet.

        Raises LineFault: MISMATCH when the line is never quiet, LINE_LOST also where the port has no break.
        """
        self._wait_for_silence()
        self._port.set_break(True)
        try:
            self._clock.wait(self._no_event, duration_s)
        finally:
            self._port.set_break(False)

    def rest_until(self, time_s: float) -> None:
        """Wait until the monotonic time `time_s` (s), for a busy device."""
        rest_s = time_s - self._clock.monotonic()
        if rest_s > 0:
            self._clock.wait(self._no_event, rest_s)

    def listen(self) -> float:
        """Discard what has come so far, without waiting for silence; the monotonic time (s) now.

        Raises LineFault: MISMATCH when bytes come faster than they are read, LINE_LOST.
        """
        self._received.clear()
        self._next_line_s = math.nan
        give_up_s = self._clock.monotonic() + self._timeout_s
        while data := self._port.read(0.0):
            self._last_byte_s = self._clock.monotonic()
            if self._last_byte_s > give_up_s:
                raise LineFault(Quality.MISMATCH, f"more comes than can be read: {shown(data)}")
        return self._clock.monotonic()

    def next_line(
        self, terminator: bytes, limit: int, timeout_s: float | None = None, gap_timeout_s: float | None = None
    ) -> tuple[bytes, float]:
        """The next unsolicited line without `terminator`, and its `time_s`; see `ByteLine`.

        Raises LineFault: MISMATCH beyond `limit` bytes, TIMEOUT, INCOMPLETE, LINE_LOST.
        """
        time_s = self._next_line_s
        if not math.isnan(time_s):
            self._look(0.0)
            if self._received.count(terminator) > 1:  # more than one has come since the last: they are old
                time_s = math.nan
        if math.isnan(time_s):
            time_s = self.listen()
            # what is left of the line under way; the end of a terminator alone ends with the line behind it
            self._line_until(terminator, limit + len(terminator) - 1, timeout_s, gap_timeout_s)
        self._next_line_s = math.nan
        line, ended_s = self._line_until(terminator, limit, timeout_s, gap_timeout_s)
        looked_s = self._clock.monotonic()
        self._look(0.0)
        if not self._received:  # the line after it has not begun by now
            ended_s = looked_s
        self._next_line_s = ended_s - (len(line) + len(terminator)) * self._port.character_s
        return line, time_s

    def receive(self, count: int, timeout_s: float | None = None) -> bytes:
        """Exactly `count` bytes. Raises LineFault: TIMEOUT, INCOMPLETE, LINE_LOST."""
        first_s = self._wait_for_first_byte(timeout_s)
        while len(self._received) < count:
            self._read_more(count, first_s)
        self._whole(first_s, count)
        return self._take(count)

    def receive_head(self, count: int) -> bytes:
        """The first `count` bytes of a frame, which say how long it is; `receive_rest` makes it whole.

        Raises LineFault: TIMEOUT, INCOMPLETE, LINE_LOST.
        """
        self._first_s = self._wait_for_first_byte(None)
        while len(self._received) < count:
            self._read_more(count, self._first_s)
        return self._take(count)

    def receive_rest(self, head: bytes, count: int) -> bytes:
        """The `count` bytes behind the `head` of a frame; it is whole with them, also where that is none.

        Raises LineFault: INCOMPLETE, LINE_LOST.
        """
        head_there_s = self._first_s + len(head) * self._port.character_s
        while len(self._received) < count:
            self._read_more(count, head_there_s, head)
        self._whole(head_there_s, count)
        return self._take(count)

    def receive_until(self, terminator: bytes, limit: int, timeout_s: float | None = None) -> bytes:
        """Bytes up to and including `terminator`.

        Raises LineFault: MISMATCH beyond `limit` bytes, TIMEOUT, INCOMPLETE, LINE_LOST.
        """
        first_s = self._wait_for_first_byte(timeout_s)
        searched = 0
        while True:
            end = self._received.find(terminator, searched)
            if 0 <= end <= limit - len(terminator):
                self._whole(first_s, end + len(terminator))
                return self._take(end + len(terminator))
            if len(self._received) >= limit:
                raise LineFault(Quality.MISMATCH, f"no end within {limit} bytes: {shown(bytes(self._received))}")
            searched = max(0, len(self._received) - len(terminator) + 1)
            self._read_more(limit, first_s)

    @property
    def received(self) -> bytes:
        """What has come and is not taken yet."""
        return bytes(self._received)

    def drain(self, quiet_s: float | None = None) -> bytes:
        """Wait until nothing has come for `quiet_s`; all that came, also before.

        None: for the line's timeout, and what is left of the timeout of the last request.
        """
        if quiet_s is None:
            quiet_s, self._not_waited_s = self._timeout_s + self._not_waited_s, 0.0
        dropped = self._take(len(self._received))
        self._next_line_s = math.nan
        until_s = self._clock.monotonic() + MAX_DRAIN_TIMEOUTS * self._timeout_s
        while (data := self._port.read(quiet_s)) and self._clock.monotonic() < until_s:
            dropped += data
            self._came_after_all()
        self.unexpected_bytes += len(dropped)
        return dropped

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    @property
    def request_came_back(self) -> bool:
        """Whether the first bytes that came after the last request are that request: see `compd.lines.echo`."""
        return not self._echo and is_echo(self._request, self._came)

    def _take_echo(self, request: bytes) -> None:
        """Receive the request as the adapter repeats it. Raises LineFault."""
        try:
            came = self.receive_head(len(request))  # of an exchange: it says nothing of the device's pauses
        except LineFault as fault:
            if fault.quality is Quality.LINE_LOST:
                raise
            text = f"{fault.detail}: the adapter has not repeated the request, as `echo: true` of the line says"
            raise LineFault(fault.quality, text) from fault
        if came != request:
            text = f"{shown(came)} came in place of the echo of {shown(request)}: see `echo` of the line"
            raise LineFault(Quality.MISMATCH, text)

    def _wait_for_silence(self) -> None:
        """Discard what comes until nothing has come for `gap_s`. Raises LineFault: MISMATCH, LINE_LOST."""
        self.unexpected_bytes += len(self._received)
        self._received.clear()
        self._next_line_s = math.nan
        give_up_s = self._clock.monotonic() + self._timeout_s
        # also behind what was sent and is not answered
        while data := self._port.read(max(self._last_byte_s, self._left_s) + self._gap_s - self._clock.monotonic()):
            self._last_byte_s = self._clock.monotonic()
            self.unexpected_bytes += len(data)
            self._came_after_all()
            if self._last_byte_s > give_up_s:
                raise LineFault(Quality.MISMATCH, f"the line is never quiet: {shown(data)}")

    def _look(self, wait_s: float) -> bool:
        """Receive what has come, or comes within `wait_s` (s); whether that was anything."""
        self._looks_s = (self._looks_s[1], self._clock.monotonic())
        data = self._port.read(wait_s)
        if data:
            self._store(data)
        return bool(data)

    def _line_until(
        self, terminator: bytes, limit: int, timeout_s: float | None, gap_timeout_s: float | None
    ) -> tuple[bytes, float]:
        """A line without `terminator`, and a time (s) before which its last byte had not come. Raises LineFault."""
        wait_s = self._timeout_s if timeout_s is None else timeout_s
        gap_s = self._timeout_s if gap_timeout_s is None else gap_timeout_s
        while (end := self._received.find(terminator)) < 0:
            if len(self._received) >= limit:
                raise LineFault(Quality.MISMATCH, f"no end within {limit} bytes: {shown(bytes(self._received))}")
            if not self._look(gap_s if self._received else wait_s):
                if not self._received:
                    raise LineFault(Quality.TIMEOUT, f"no byte within {wait_s:g} s")
                raise LineFault(Quality.INCOMPLETE, f"only {shown(bytes(self._received))}")
        # the look before the last one has taken all that had come by then
        return self._take(end + len(terminator))[:end], self._looks_s[0]

    def _wait_for_first_byte(self, timeout_s: float | None) -> float:
        """Wait for a reply's first byte; the time (s) at which it was there."""
        if not self._received:
            wait_s = self._first_byte.wait_s if timeout_s is None else timeout_s
            leaving_s = max(0.0, self._left_s - self._clock.monotonic())  # of a long request, at a low baud rate
            data = self._port.read(wait_s + leaving_s if wait_s > 0 else 0.0)
            if not data:
                if timeout_s is None:
                    self._first_byte.missed()
                    self._not_waited_s = self._timeout_s - wait_s
                raise LineFault(Quality.TIMEOUT, f"no byte within {wait_s:.3g} s")
            self._store(data)
            if timeout_s is None:
                self._first_byte.took(self._last_byte_s - self._left_s)
        return self._last_byte_s

    def _whole(self, first_s: float, count: int) -> None:
        """Note how long the rest of a reply of `count` bytes took, whose first byte was there at `first_s` (s)."""
        self._rest.took(self._last_byte_s - first_s - count * self._port.character_s)

    def _came_after_all(self) -> None:
        """Bytes have come without a request: they belong to a reply that was given up."""
        self._first_byte.came_late()
        self._rest.came_late()

    def _read_more(self, count: int, first_s: float, head: bytes = b"") -> None:
        """Wait for more of a reply of at most `count` bytes, whose first was there at `first_s` (s).

        head : what was taken of it before, for the fault. Raises LineFault: INCOMPLETE, LINE_LOST.
        """
        deadline_s = first_s + self._rest.wait_s + count * self._port.character_s
        on_the_wire_s = (count - len(self._received)) * self._port.character_s
        if on_the_wire_s > WORTH_SLEEPING_S:
            self._clock.wait(self._no_event, on_the_wire_s)
        data = self._port.read(deadline_s - self._clock.monotonic())
        if not data:
            self._rest.missed()
            came = head + self._received
            raise LineFault(Quality.INCOMPLETE, f"only {len(came)} bytes: {shown(came)}")
        self._store(data)

    def _store(self, data: bytes) -> None:
        """Keep bytes that have come, and the time."""
        self._received += data
        if len(self._came) < len(self._request):
            self._came += data[: len(self._request) - len(self._came)]
        self._last_byte_s = self._clock.monotonic()

    def _take(self, count: int) -> bytes:
        """Remove the first `count` bytes that have come."""
        data = bytes(self._received[:count])
        del self._received[:count]
        return data
