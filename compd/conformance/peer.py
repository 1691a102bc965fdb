"""The far end of the wire under test: a simulated device whose sensors have known values, and faults in its replies."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from compd.conformance.faults import NONE, Fault, Piece
from compd.gauge import Channel
from compd.twins import ModbusSlaves, SimulatedByteDevice, SimulatedRegisterDevice

# Ranges of gauges without a stated one, by unit.
RANGES = {"mm": (-0.9, 0.9), "degC": (5.0, 45.0), "N": (-50.0, 50.0), "hPa": (950.0, 1050.0), "pct": (10.0, 90.0)}
OTHER_RANGE = (-0.9, 0.9)
GOLDEN = (math.sqrt(5) - 1) / 2  # its multiples modulo 1 spread evenly: neighbours in time are far apart


class SensorValues:
    """The sensors' values by channel: new ones for every poll, so that an old reply is wrong.

    extents : by channel, the lowest and highest value that it takes from poll to poll.
    whole : by channel, the lowest and highest value that the device was seen to show.
    sensed_s : by channel, when the device last looked at its sensor, s.
    """

    def __init__(self, channels: Sequence[Channel], extent: tuple[float, float] | None) -> None:
        self.values: dict[str, float] = {}
        self.extents = {c.name: extent or RANGES.get(c.unit, OTHER_RANGE) for c in channels}
        self.whole: dict[str, tuple[float, float]] = {}
        self.sensed_s: dict[str, float] = {}
        self._looked_at: set[str] = set()
        self._step = 0

    def advance(self) -> None:
        """New values: lowest + fraction (step x golden ratio + an offset per channel) x (highest - lowest)."""
        self._step += 1
        for index, (name, (lowest, highest)) in enumerate(self.extents.items()):
            share = (self._step * GOLDEN + index * 0.0719) % 1.0
            self.values[name] = lowest + share * (highest - lowest)

    def set_to_end(self, end: int) -> None:
        """Every channel to its lowest (0) or highest (1) value."""
        self.values = {name: extent[end] for name, extent in self.extents.items()}

    def sense(self, channel: str) -> float:
        self._looked_at.add(channel)
        return self.values[channel]

    def stamp(self, received_s: float) -> None:
        """Set the time of everything sensed since the last call to `received_s`."""
        self.sensed_s.update(dict.fromkeys(self._looked_at, received_s))
        self._looked_at.clear()


@dataclass(frozen=True)
class Exchange:
    """One request of a poll: time of reception (s), the device's reply, and its delivered part.

    request : b"" for a pulse of DTR or an unsolicited reading; it was received as DTR fell, or as the reading began.
    pause_s : before the reply, of no driver's making, s: DTR was LOW, or the device silent between two lines.
    """

    request: bytes
    received_s: float
    reply: bytes
    delivered: bytes
    pause_s: float = 0.0


class Peer:
    """The simulated device behind a damaging wire: each reply takes the next of the given faults.

    exchanges : of the poll under way; longest : bytes of the longest reply so far.
    """

    def __init__(self, simulator: Callable[..., Any], options: Any, sensors: SensorValues, over_tcp: bool) -> None:
        device = simulator(options, sensors.sense)
        registers = isinstance(device, SimulatedRegisterDevice)
        self._device: ModbusSlaves | SimulatedByteDevice = ModbusSlaves([device], over_tcp) if registers else device
        self.exchanges: list[Exchange] = []
        self.longest = 0
        self._sensors = sensors
        self._faults: Iterator[Fault] = iter(())
        self._beyond: Fault | None = None
        self._counts: dict[bytes, int] = {}  # fewest registers requested, by unit, function and address

    def begin_poll(self, faults: Iterable[Fault]) -> None:
        """Begin a poll; `faults`: one for each of its replies."""
        self.exchanges = []
        self._faults = iter(faults)

    def end_map(self, beyond: Fault | None) -> None:
        """Let the map of a serial Modbus slave end with the driver's registers; None: restore it.

        beyond : what happens to the reply where one register more is asked for.
        """
        self._beyond = beyond
        self._counts.clear()

    @property
    def blocks(self) -> int:
        """Blocks of registers requested since `end_map`."""
        return len(self._counts)

    def answer(self, request: bytes, received_s: float, timeout_s: float, pause_s: float = 0.0) -> Sequence[Piece]:
        """The pieces that come back when `request` has arrived at `received_s`; see `Exchange`."""
        reply = self._reply(request)
        self._sensors.stamp(received_s)
        pieces: Sequence[Piece] = []
        if reply:
            self.longest = max(self.longest, len(reply))
            beyond = self._beyond is not None and self._is_beyond(request)
            fault = self._beyond if beyond and self._beyond else next(self._faults, NONE)
            pieces = fault.act(reply, timeout_s)
        if request or reply:
            delivered = b"".join(piece.data for piece in pieces)
            self.exchanges.append(Exchange(request, received_s, reply, delivered, pause_s))
        return pieces

    def would_answer(self, requests: Iterable[bytes], values: Mapping[str, float]) -> tuple[bytes, ...]:
        """The device's replies to the same requests with `values` at its sensors. Passes on its exceptions."""
        present, self._sensors.values = self._sensors.values, dict(values)
        sensed_s = dict(self._sensors.sensed_s)
        try:
            return tuple(self._reply(request) for request in requests)
        finally:
            self._sensors.values = present
            self._sensors.stamp(math.nan)
            self._sensors.sensed_s = sensed_s

    def _reply(self, request: bytes) -> bytes:
        if request or isinstance(self._device, ModbusSlaves):
            return self._device.receive(request)
        return self._device.speak()

    def _is_beyond(self, request: bytes) -> bool:
        """Whether a request is for one register more than the driver needs."""
        block, count = request[:4], int.from_bytes(request[4:6], "big")
        fewest = self._counts[block] = min(self._counts.get(block, count), count)
        return count == fewest + 1
