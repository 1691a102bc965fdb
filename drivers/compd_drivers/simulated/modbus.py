"""A Modbus module's registers, filled from what its sensors see."""

from __future__ import annotations

import math
import struct
from typing import Any

from compd.simulation.wires.device import Sense, SimulatedRegisterDevice
from compd_drivers.simulated.shared import signal_for

# type -> struct code, smallest and largest count
INTEGERS = {
    "int16": ("h", -(2**15), 2**15 - 1),
    "uint16": ("H", 0, 2**16 - 1),
    "int32": ("i", -(2**31), 2**31 - 1),
    "uint32": ("I", 0, 2**32 - 1),
}
ROW = 8  # modules have their channels in rows of eight; the rest of a row reads 0
BROKEN_STATUS = 1


class SimulatedRegisters(SimulatedRegisterDevice):
    """One slave with the registers of its map. A sensor that is off shows its `invalid` value, its status, NaN
    in a float, or else the most negative count."""

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        self._ends: dict[int, int] = {}
        for channel in options.channels:
            last = channel.address + (2 if channel.type.endswith("32") else 1)
            if channel.status:
                last = max(last, channel.status.address + 1)
            self._ends[channel.function] = max(self._ends.get(channel.function, 0), -(-last // ROW) * ROW)

    @property
    def unit(self) -> int:
        return int(self.options.unit)

    def registers(self, function: int, address: int, count: int) -> list[int] | None:
        """`count` registers; None beyond the map's last row or by a function that the module does not have."""
        end = self._ends.get(function)
        if end is None or count < 1 or address + count > end:
            return None
        bank = [0] * end
        for channel in self.options.channels:
            if channel.function == function:
                self._fill(bank, channel)
        return bank[address : address + count]

    def _fill(self, bank: list[int], channel: Any) -> None:
        value = self.sense(channel.name)
        if channel.linearisation is not None:
            value = signal_for(channel.linearisation, value)
        data = _stored(channel, value)
        words = struct.unpack(f">{len(data) // 2}H", data)
        if channel.byte_order == "little":
            words = tuple((word & 0xFF) << 8 | word >> 8 for word in words)
        if channel.word_order == "low_first":
            words = tuple(reversed(words))
        bank[channel.address : channel.address + len(words)] = words
        if channel.status:
            bank[channel.status.address] = channel.status.ok[0] if math.isfinite(value) else BROKEN_STATUS


def _stored(channel: Any, value: float) -> bytes:
    """The number as the module keeps it, high byte first."""
    if channel.type == "float32":
        broken = channel.invalid[0] if channel.invalid else math.nan
        return struct.pack(">f", (value - channel.offset) / channel.scale if math.isfinite(value) else broken)
    code, smallest, largest = INTEGERS[channel.type]
    if math.isfinite(value):
        count = min(largest, max(smallest, round((value - channel.offset) / channel.scale)))
    else:
        count = int(channel.invalid[0]) if channel.invalid else smallest
    return struct.pack(f">{code}", count)
