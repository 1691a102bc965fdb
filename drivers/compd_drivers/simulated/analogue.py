"""The other ends of the analogue modules: M-7017C, ADAM-4017+, ioLogik E1240; and of the thermometer R4DCB08."""

from __future__ import annotations

import math
import struct
from abc import abstractmethod
from typing import ClassVar

from compd.simulation.wires.device import SimulatedRegisterDevice
from compd_drivers.simulated.transducer import signal_for

# the ends of an input's range, V or mA
ENDS = {
    "+-10V": (-10, 10),
    "+-5V": (-5, 5),
    "+-1V": (-1, 1),
    "+-500mV": (-0.5, 0.5),
    "+-150mV": (-0.15, 0.15),
    "0-10V": (0, 10),
    "+-20mA": (-20, 20),
    "0-20mA": (0, 20),
    "4-20mA": (4, 20),
}


class RegisterBank(SimulatedRegisterDevice):
    """A slave that has registers by one function only, some of them at least 0."""

    function: ClassVar[int]
    held: ClassVar[tuple[range, ...]]  # addresses that it has

    @property
    def unit(self) -> int:
        return int(self.options.unit)

    def registers(self, function: int, address: int, count: int) -> list[int] | None:
        wanted = range(address, address + count)
        if function != self.function or not any(wanted[0] in held and wanted[-1] in held for held in self.held):
            return None
        bank = self.bank()
        return [bank.get(place, 0) for place in wanted]

    @abstractmethod
    def bank(self) -> dict[int, int]:
        """The registers that are not 0."""


class SimulatedM7017c(RegisterBank):
    """Hexadecimal data: 7FFF and 8000, or FFFF and 0000, at the ends; an open input reads the lower one."""

    function = 4
    held = (range(8),)

    def bank(self) -> dict[int, int]:
        return {
            one.input: self._count(one.range, signal_for(one.linearisation, self.sense(one.name)))
            for one in self.options.channels
        }

    @staticmethod
    def _count(name: str, signal: float) -> int:
        low, high = ENDS[name]
        if low < 0:
            count = round(signal / high * 32768) if math.isfinite(signal) else -32768
            return min(32767, max(-32768, count)) & 0xFFFF
        count = round((signal - low) / (high - low) * 65535) if math.isfinite(signal) else 0
        return min(65535, max(0, count))


class SimulatedAdam4017p(RegisterBank):
    """0000 to FFFF over the whole range; an open input reads FFFF."""

    function = 3
    held = (range(8), range(200, 216))

    def bank(self) -> dict[int, int]:
        found = {}
        for one in self.options.channels:
            low, high = ENDS[one.range]
            signal = signal_for(one.linearisation, self.sense(one.name))
            part = (signal - low) / (high - low) if math.isfinite(signal) else 1.0
            found[one.input] = min(65535, max(0, round(part * 65535)))
        return found


class SimulatedE1240(RegisterBank):
    """Raw values at 0, scaled float32 at 8, status at 60."""

    function = 4
    held = (range(40), range(60, 68))
    BURN_OUT: ClassVar[int] = 1

    def bank(self) -> dict[int, int]:
        found = {}
        for one in self.options.channels:
            signal = signal_for(one.linearisation, self.sense(one.name))
            if math.isfinite(signal):
                high, low = struct.unpack(">HH", struct.pack(">f", signal))
                found[8 + 2 * one.input], found[9 + 2 * one.input] = high, low
            else:
                found[60 + one.input] = self.BURN_OUT
        return found


class SimulatedR4dcb08(RegisterBank):
    """int16 in 0.1 degC; 8000 without a sensor."""

    function = 3
    held = (range(16),)

    def bank(self) -> dict[int, int]:
        found = dict.fromkeys(range(8), 0x8000)
        for sensor in self.options.sensors:
            value_degC = self.sense(str(sensor))
            if math.isfinite(value_degC):
                found[sensor - 1] = round(10 * value_degC) & 0xFFFF
        return found
