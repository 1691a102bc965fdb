"""The far end of the wire under test: a simulated device whose sensors have known values, and faults in its replies."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from compd.commissioning.conformance.faults import NONE, Fault, Piece
from compd.gauge import Channel
from compd.simulation.wires.device import SimulatedByteDevice, SimulatedRegisterDevice
from compd.simulation.wires.modbus_slaves import ModbusSlaves

# Where a gauge does not say what it can show, by unit.
RANGES = {"mm": (-0.9, 0.9), "degC": (5.0, 45.0), "N": (-50.0, 50.0), "hPa": (950.0, 1050.0), "pct": (10.0, 90.0)}
OTHER_RANGE = (-0.9, 0.9)
GOLDEN = (math.sqrt(5) - 1) / 2  # its multiples modulo 1 spread evenly: neighbours in time are far apart


class SensorValues:
    """The sensors' values by channel: new ones for every poll, so that an old reply is a wrong one."""

    def __init__(self, channels: Sequence[Channel], extent: tuple[float, float] | None) -> None:
        self.values: dict[str, float] = {}
        self.sensed_s = math.nan  # when the device last looked at its sensors
        self._extents = {c.name: extent or RANGES.get(c.unit, OTHER_RANGE) for c in channels}
        self._step = 0

    def advance(self) -> None:
        """New values: lowest + fraction (step x golden ratio + an offset per channel) x (highest - lowest)."""
        self._step += 1
        for place, (name, (lowest, highest)) in enumerate(self._extents.items()):
            share = (self._step * GOLDEN + place * 0.0719) % 1.0
            self.values[name] = lowest + share * (highest - lowest)

    def set_to_end(self, end: int) -> None:
        """Every channel to its lowest (0) or highest (1) value."""
        self.values = {name: extent[end] for name, extent in self._extents.items()}

    def sense(self, channel: str) -> float:
        return self.values[channel]


class Peer:
    """The simulated device behind a wire that damages replies: each reply takes the next of the faults that were set.

    replies : how many the device has given; longest : bytes of the longest of them.
    """

    def __init__(self, simulator: Callable[..., Any], options: Any, sensors: SensorValues, over_tcp: bool) -> None:
        device = simulator(options, sensors.sense)
        registers = isinstance(device, SimulatedRegisterDevice)
        self._device: ModbusSlaves | SimulatedByteDevice = ModbusSlaves([device], over_tcp) if registers else device
        self.replies = 0
        self.longest = 0
        self._sensors = sensors
        self._faults: Iterator[Fault] = iter(())
        self._beyond: Fault | None = None
        self._counts: dict[bytes, int] = {}  # of registers, by unit, function and address: the fewest asked for

    def set_faults(self, faults: Iterable[Fault]) -> None:
        """Set the faults of the next replies, one each."""
        self._faults = iter(faults)

    def end_map(self, beyond: Fault | None) -> None:
        """Let the map of a Modbus slave on a serial line end with what the driver reads; None: as it was.

        beyond : what happens to the reply where one register more is asked for.
        """
        self._beyond = beyond
        self._counts.clear()

    @property
    def blocks(self) -> int:
        """Blocks of registers that were asked for since `end_map`."""
        return len(self._counts)

    def answer(self, request: bytes, heard_s: float, timeout_s: float) -> Sequence[Piece]:
        """The pieces that come back when `request` has arrived at `heard_s`."""
        reply = self._device.hear(request)
        if not reply:
            return []
        self._sensors.sensed_s = heard_s
        self.replies += 1
        self.longest = max(self.longest, len(reply))
        if self._beyond is not None and self._is_beyond(request):
            return self._beyond.act(reply, timeout_s)
        return next(self._faults, NONE).act(reply, timeout_s)

    def _is_beyond(self, request: bytes) -> bool:
        """Whether a request asks for one register more than the driver needs."""
        block, count = request[:4], int.from_bytes(request[4:6], "big")
        fewest = self._counts[block] = min(self._counts.get(block, count), count)
        return count == fewest + 1
