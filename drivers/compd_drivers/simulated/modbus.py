"""A Modbus module's registers, filled from its sensors."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any

from compd.twins import Sense, SimulatedRegisterDevice
from compd_drivers.simulated.shared import signal_for

FLOATS = {"float32": "f", "float64": "d"}
ROW = 8  # modules have their channels in rows of eight; the rest of a row reads 0
BITS = (1, 2)  # functions for reading bits


class SimulatedRegisters(SimulatedRegisterDevice):
    """One slave with the registers of its map. A sensor that is off shows its `invalid` value, its status, NaN
    in a float, or else the most negative count.

    It knows the registers of the description's `identity`, and takes what the description writes.
    """

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        self.written: list[tuple[int, int, tuple[int, ...]]] = []  # function, address, values
        self._writes = [*options.write_first, *options.write_before_poll]
        self._ends: dict[int, int] = {}
        for channel in options.channels:
            self._reach(channel.function, channel.address + registers_of(channel))
            if channel.status:
                self._reach(channel.status.function or channel.function, channel.status.address + 1)
        if options.identity:
            self._reach(options.identity.function, options.identity.address + len(options.identity.equals))

    def _reach(self, function: int, end: int) -> None:
        """Extend the map of a function to the end of the row before `end`."""
        self._ends[function] = max(self._ends.get(function, 0), -(-end // ROW) * ROW)

    @property
    def unit(self) -> int:
        return int(self.options.unit)

    def registers(self, function: int, address: int, count: int) -> list[int] | None:
        """`count` registers; None beyond the map's last row or by a function that the module does not have."""
        end = self._ends.get(function)
        if end is None or count < 1 or address + count > end:
            return None
        bank = [0] * end
        if self.options.identity and self.options.identity.function == function:
            first = self.options.identity.address
            bank[first : first + len(self.options.identity.equals)] = self.options.identity.equals
        for channel in self.options.channels:
            self._fill(bank, channel, function)
        return bank[address : address + count]

    def bits(self, function: int, address: int, count: int) -> list[bool] | None:
        values = self.registers(function, address, count)
        return None if values is None else [bool(value) for value in values]

    def write(self, function: int, address: int, values: Sequence[int]) -> bool:
        described = any((w.function, w.address, w.values) == (function, address, tuple(values)) for w in self._writes)
        if described:
            self.written.append((function, address, tuple(values)))
        return described

    def _fill(self, bank: list[int], channel: Any, function: int) -> None:
        value = self.sense(channel.name)
        if channel.linearisation is not None:
            value = signal_for(channel.linearisation, value)
        if channel.function == function:
            self._store(bank, channel, value)
        if channel.status and (channel.status.function or channel.function) == function:
            bank[channel.status.address] |= (
                channel.status.ok[0] if math.isfinite(value) else broken(channel.status, function)
            )

    def _store(self, bank: list[int], channel: Any, value: float) -> None:
        if channel.type == "bit":
            bank[channel.address] = int(math.isfinite(value) and round(_raw(channel, value)) != 0)
            return
        before = bytes(channel.at_byte)
        data = before + _stored(channel, value)
        data += bytes(len(data) % 2)
        words = struct.unpack(f">{len(data) // 2}H", data)
        if channel.byte_order == "little":
            words = tuple((word & 0xFF) << 8 | word >> 8 for word in words)
        if channel.word_order == "low_first":
            words = tuple(reversed(words))
        for index, word in enumerate(words, start=channel.address):
            bank[index] |= word  # other bits may belong to other numbers


def registers_of(channel: Any) -> int:
    """Registers, or bits, of a channel's number."""
    if channel.type == "bit":
        return 1
    return -(-(int(channel.at_byte) + bits_of(channel.type) // 8) // 2)


def bits_of(kind: str) -> int:
    return int("".join(letter for letter in kind if letter.isdigit()))


def broken(status: Any, function: int) -> int:
    """A status other than good."""
    mask = status.mask or 0xFFFF
    values = [1] if function in BITS else [1 << k for k in range(16) if mask >> k & 1]
    return next(value for value in [*values, 0] if value not in status.ok)


def _raw(channel: Any, value: float) -> float:
    return float((value - channel.offset) / channel.scale)


def _stored(channel: Any, value: float) -> bytes:
    """The number in the module's form, high byte first."""
    if channel.type in FLOATS:
        gone = channel.invalid[0] if channel.invalid else math.nan
        return struct.pack(f">{FLOATS[channel.type]}", _raw(channel, value) if math.isfinite(value) else gone)
    size = bits_of(channel.type)
    width = (channel.mask >> channel.shift).bit_length() if channel.mask else size
    if channel.type.startswith("bcd"):
        largest, smallest = 10 ** (width // 4) - 1, 0
    elif channel.type.startswith("int"):
        largest, smallest = 2 ** (width - 1) - 1, -(2 ** (width - 1))
    else:
        largest, smallest = 2 ** (width - (channel.minus is not None and not channel.mask)) - 1, 0
    if channel.minus is not None:
        smallest = -largest
    if math.isfinite(value):
        count = min(largest, max(smallest, round(_raw(channel, value))))
    else:
        count = int(channel.invalid[0]) if channel.invalid else smallest
    size_of_it = abs(count) if channel.minus is not None else count % 2**width
    bits = int(str(size_of_it), 16) if channel.type.startswith("bcd") else size_of_it
    bits <<= channel.shift
    if channel.minus is not None and count < 0:
        bits |= channel.minus
    return int(bits).to_bytes(size // 8, "big")
