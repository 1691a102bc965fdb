"""A wire in virtual time: thousands of faults a second, exact to the byte, the same on every computer."""

from __future__ import annotations

import heapq
import itertools
import threading
from collections.abc import Sequence

from compd.commissioning.conformance.faults import Piece
from compd.commissioning.conformance.peer import Peer
from compd.gauge import LineFault, Quality
from compd.lines.kinds.modbus_rtu.master import RtuMaster
from compd.lines.stream import StreamLine

TURNAROUND_S = 1e-3  # from the last bit of a request to the first of the reply
GAP_S = 2e-3  # silence before a request, as `open_line` keeps it at 19200 baud and below

# Between two lines of a device that speaks unasked, in line timeouts: the line's own timeout must be longer.
PAUSE_TIMEOUTS = 0.8


class VirtualClock:
    """Time that passes only while somebody waits."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        return self.now_s

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        self.now_s += timeout_s
        return event.is_set()


class VirtualWire:
    """A byte or RTU line; `open` gives the product's own line over it."""

    exact = True

    def __init__(
        self, peer: Peer, registers: bool, timeout_s: float = 0.1, character_s: float = 0.0, unasked: bool = False
    ) -> None:
        """unasked : the device speaks by itself, with `pause_s` between two lines."""
        self.peer = peer
        self.clock = VirtualClock()
        self.timeout_s = timeout_s
        self.character_s = character_s
        self.plugged = True
        self.pause_s = PAUSE_TIMEOUTS * timeout_s if unasked else 0.0
        self._speaks_s = self.clock.now_s + self.pause_s  # next
        self._dtr_fell_s: float | None = None
        self._registers = registers
        self._arriving: list[tuple[float, int, bytes]] = []
        self._order = itertools.count()

    def open(self) -> StreamLine | RtuMaster:
        """Raises LineFault(LINE_LOST) while the plug is out."""
        self.check()
        stream = StreamLine(VirtualPort(self), self.timeout_s, max(GAP_S, 3.5 * self.character_s), self.clock)
        return RtuMaster(stream) if self._registers else stream

    def unplug(self) -> None:
        self.plugged = False
        self._arriving.clear()

    def replug(self) -> None:
        self.plugged = True
        self._speaks_s = self.clock.now_s + self.pause_s

    def close(self) -> None:
        """Nothing to give back."""

    def check(self) -> None:
        if not self.plugged:
            raise LineFault(Quality.LINE_LOST, "unplugged")

    def carry(self, request: bytes) -> None:
        """To the device; its reply gets under way."""
        heard_s = self.clock.now_s + len(request) * self.character_s
        self._send(self.peer.answer(request, heard_s, self.timeout_s), heard_s + TURNAROUND_S)

    def set_dtr(self, high: bool) -> None:
        """A device that is asked by DTR answers when it is HIGH again, and may have sampled as soon as it fell."""
        if not high:
            self._dtr_fell_s = self.clock.now_s
        elif self._dtr_fell_s is not None:
            fell_s, self._dtr_fell_s = self._dtr_fell_s, None
            low_s = self.clock.now_s - fell_s
            self._send(self.peer.answer(b"", fell_s, self.timeout_s, low_s), self.clock.now_s + TURNAROUND_S)

    def rest(self, duration_s: float) -> None:
        """Time passes without anybody reading, s."""
        self.clock.now_s += duration_s
        while self.pause_s and self._speaks_s <= self.clock.now_s:
            self._speak()

    def _speak(self) -> None:
        """The next line of a device that speaks unasked."""
        begins_s = self._speaks_s
        pieces = self.peer.answer(b"", begins_s, self.timeout_s, self.pause_s)
        self._send(pieces, begins_s)
        length = sum(len(piece.data) for piece in pieces)
        self._speaks_s = begins_s + length * self.character_s + self.pause_s

    def _send(self, pieces: Sequence[Piece], first_s: float) -> None:
        """On their way to the product, from `first_s` on; character by character where the line has a pace."""
        for piece in pieces:
            start_s = first_s + piece.delay_s
            if not self.character_s:
                heapq.heappush(self._arriving, (start_s, next(self._order), piece.data))
                continue
            for place, byte in enumerate(piece.data, start=1):
                due_s = start_s + place * self.character_s
                heapq.heappush(self._arriving, (due_s, next(self._order), bytes([byte])))

    def arrive(self, timeout_s: float) -> bytes:
        """What comes within `timeout_s`; time moves on to there."""
        until_s = self.clock.now_s + max(0.0, timeout_s)
        while self.pause_s and self._speaks_s <= min([until_s, *(item[0] for item in self._arriving[:1])]):
            self._speak()
        if not self._arriving or self._arriving[0][0] > until_s:
            self.clock.now_s = until_s
            return b""
        self.clock.now_s = max(self.clock.now_s, self._arriving[0][0])
        data = b""
        while self._arriving and self._arriving[0][0] <= self.clock.now_s:
            data += heapq.heappop(self._arriving)[2]
        return data


class VirtualPort:
    """The product's end of a virtual wire."""

    def __init__(self, wire: VirtualWire) -> None:
        self.character_s = wire.character_s
        self._wire = wire

    def read(self, timeout_s: float) -> bytes:
        self._wire.check()
        return self._wire.arrive(timeout_s)

    def write(self, data: bytes) -> None:
        self._wire.check()
        self._wire.carry(data)

    def set_dtr(self, high: bool) -> None:
        self._wire.check()
        self._wire.set_dtr(high)

    def set_break(self, on: bool) -> None:
        """Simulated devices do not see it."""

    def close(self) -> None:
        """Nothing to give back."""
