"""A wire in virtual time: thousands of faults a second, exact to the byte, the same on every computer."""

from __future__ import annotations

import heapq
import itertools
import threading

from compd.commissioning.conformance.peer import Peer
from compd.gauge import LineFault, Quality
from compd.lines.modbus_rtu import RtuMaster
from compd.lines.stream import StreamLine

TURNAROUND_S = 1e-3  # from the last bit of a request to the first of the reply
GAP_S = 2e-3  # silence before a request, as `open_line` keeps it at 19200 baud and below


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

    def __init__(self, peer: Peer, registers: bool, timeout_s: float = 0.1, character_s: float = 0.0) -> None:
        self.peer = peer
        self.clock = VirtualClock()
        self.timeout_s = timeout_s
        self.character_s = character_s
        self.plugged = True
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

    def close(self) -> None:
        """Nothing to give back."""

    def check(self) -> None:
        if not self.plugged:
            raise LineFault(Quality.LINE_LOST, "unplugged")

    def carry(self, request: bytes) -> None:
        """To the device; its reply gets under way, character by character where the line has a pace."""
        heard_s = self.clock.now_s + len(request) * self.character_s
        for piece in self.peer.answer(request, heard_s, self.timeout_s):
            start_s = heard_s + TURNAROUND_S + piece.delay_s
            if not self.character_s:
                heapq.heappush(self._arriving, (start_s, next(self._order), piece.data))
                continue
            for place, byte in enumerate(piece.data, start=1):
                due_s = start_s + place * self.character_s
                heapq.heappush(self._arriving, (due_s, next(self._order), bytes([byte])))

    def arrive(self, timeout_s: float) -> bytes:
        """What comes within `timeout_s`; time moves on to there."""
        until_s = self.clock.now_s + max(0.0, timeout_s)
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
        """Simulated devices do not see it."""

    def set_break(self, on: bool) -> None:
        """Nor this."""

    def close(self) -> None:
        """Nothing to give back."""
