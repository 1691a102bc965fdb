"""Wires in virtual time: the ports that the daemon opens, and the twins of its devices at their far ends."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Sequence
from typing import Any

from greenlet import getcurrent

from compd.gauge import LineFault, Quality
from compd.line_settings import PolledLineSettings
from compd.lines import Ports, polled_definition
from tests.worlds.hub import Actor, Hub

# From the last bit of a request to the moment at which a device samples, and from there to its reply, s: the range.
SAMPLES_AFTER_S = (1e-4, 4e-4)
REPLIES_AFTER_S = (1e-4, 3e-4)
# Of a packet over Ethernet, s.
PACKET_S = 1e-4

# What becomes of a reply: pieces with their delays (s), none for one that is lost.
Fault = Callable[[bytes], Sequence[tuple[float, bytes]]]


def whole(reply: bytes) -> Sequence[tuple[float, bytes]]:
    """The reply as it is."""
    return [(0.0, reply)]


def lost(reply: bytes) -> Sequence[tuple[float, bytes]]:
    """No reply."""
    return []


class Wire:
    """One line's wire.

    Attributes
    ----------
    fault : of its replies; may be exchanged at any time.
    plugged : whether there is a connection at all.
    replies : how many were sent, faults included.
    listener : its devices. request : that `fault` is asked for the reply to.
    """

    def __init__(self, hub: Hub, settings: PolledLineSettings, devices: Sequence[Any]) -> None:
        self.fault: Fault = whole
        self.plugged = True
        self.replies = 0
        self.request = b""
        twin = polled_definition(settings).twin
        self.character_s = twin.character_s(settings)
        self.listener = twin.listener(settings, devices)
        self._hub = hub
        self._ports: list[WirePort] = []
        self._free_s = 0.0  # when the device has sent its last reply

    def open(self) -> WirePort:
        """Raises LineFault (LINE_LOST) while the plug is out."""
        if not self.plugged:
            raise LineFault(Quality.LINE_LOST, "unplugged")
        port = WirePort(self, self._hub)
        self._ports = [port]
        return port

    def unplug(self) -> None:
        self.plugged = False
        ports, self._ports = self._ports, []
        for port in ports:
            port.hang_up()

    def replug(self) -> None:
        self.plugged = True

    def carry(self, port: WirePort, request: bytes) -> None:
        """Send a request, which the device answers where it is whole."""
        rng = self._hub.rng
        heard_s = self._hub.now_s + (len(request) * self.character_s or PACKET_S)
        self._hub.at(max(heard_s, self._free_s) + rng.uniform(*SAMPLES_AFTER_S), lambda: self._answer(port, request))

    def _answer(self, port: WirePort, request: bytes) -> None:
        reply = self.listener.receive(request)
        if not reply:
            return
        self.replies += 1
        self.request = request
        begins_s = self._hub.now_s + self._hub.rng.uniform(*REPLIES_AFTER_S)
        for delay_s, piece in self.fault(reply):
            ends_s = begins_s + delay_s + (len(piece) * self.character_s or PACKET_S)
            self._free_s = max(self._free_s, ends_s)
            first = 1 if self.character_s and len(piece) > 1 else 0
            if first:
                port.arrives(begins_s + delay_s + self.character_s, piece[:first])
            port.arrives(ends_s, piece[first:])


class WirePort:
    """The daemon's end of a wire: a `Port`."""

    peer = ""

    def __init__(self, wire: Wire, hub: Hub) -> None:
        self.character_s = wire.character_s
        self._wire = wire
        self._hub = hub
        self._connected = True
        self._coming: list[tuple[float, int, bytes]] = []
        self._order = itertools.count()
        self._reader: Actor | None = None

    def arrives(self, time_s: float, data: bytes) -> None:
        """Bytes come at `time_s` (s)."""
        heapq.heappush(self._coming, (time_s, next(self._order), data))
        self._hub.at(time_s, self._wake_reader)

    def hang_up(self) -> None:
        self._connected = False
        self._wake_reader()

    def _wake_reader(self) -> None:
        self._hub.wake(self._reader)

    def read(self, timeout_s: float) -> bytes:
        until_s = self._hub.now_s + max(0.0, timeout_s)
        while True:
            self._check()
            if self._coming and self._coming[0][0] <= self._hub.now_s:
                return self._take()
            if self._hub.now_s >= until_s:
                return b""
            actor = getcurrent()
            assert isinstance(actor, Actor), "only an actor reads"
            self._reader = actor
            try:
                self._hub.sleep_until(until_s)
            finally:
                self._reader = None

    def _take(self) -> bytes:
        data = b""
        while self._coming and self._coming[0][0] <= self._hub.now_s:
            data += heapq.heappop(self._coming)[2]
        return data

    def write(self, data: bytes) -> None:
        self._check()
        self._wire.carry(self, data)

    def set_dtr(self, high: bool) -> None:
        self._check()

    def set_break(self, on: bool) -> None:
        self._check()

    def close(self) -> None:
        self._connected = False

    def _check(self) -> None:
        if not self._connected:
            raise LineFault(Quality.LINE_LOST, "read: the port has hung up")


class VirtualPorts(Ports):
    """Every serial port and TCP connection of a line is that of a wire, by its address."""

    def __init__(self) -> None:
        self.wires: dict[str, Wire] = {}

    def serial(self, port: str, *_: Any) -> WirePort:
        return self.wires[port].open()

    def tcp(self, host: str, port: int, timeout_s: float) -> WirePort:
        return self.wires[f"{host}:{port}"].open()
