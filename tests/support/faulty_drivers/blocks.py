"""Several values in one reply: two channels of a text, and registers."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import ClassVar

from compd.gauge import ByteLine, Channel, Gauge, LineFault, Quality, Reading, RegisterLine, bad, good
from compd.twins import SimulatedRegisterDevice
from tests.support.faulty_drivers.comparator import MAX_MM, AsciiDevice


class PairDevice(AsciiDevice):
    """+01.2345,-02.3456 CR LF; a sensor that is off shows dashes."""

    def shown(self) -> bytes:
        values = [self.sense(name) for name in ("a", "b")]
        if any(abs(value) >= MAX_MM for value in values):
            return b"ER2\r\n"
        return ",".join("--------" if math.isnan(v) else f"{v:+08.4f}" for v in values).encode() + b"\r\n"


class Pair(Gauge[ByteLine]):
    """Right."""

    device: ClassVar[type] = PairDevice
    form = re.compile(rb"([+-]\d{2}\.\d{4}|-{8}),([+-]\d{2}\.\d{4}|-{8})")

    @property
    def channels(self) -> Sequence[Channel]:
        return [Channel("a"), Channel("b")]

    def read(self, line: ByteLine) -> Sequence[Reading]:
        time_s = line.send(b"?\r")
        reply = line.receive_until(b"\r\n", 24).removesuffix(b"\r\n")
        if re.fullmatch(rb"ER\d", reply):
            raise LineFault(Quality.DEVICE_ERROR, reply.decode())
        match = self.form.fullmatch(reply)
        if match is None:
            raise LineFault(Quality.MISMATCH, repr(reply))
        return self.readings(match.groups(), time_s)

    def readings(self, fields: Sequence[bytes], time_s: float) -> Sequence[Reading]:
        return [self.reading(field, time_s) for field in fields]

    def reading(self, field: bytes, time_s: float) -> Reading:
        return bad(time_s, Quality.SENSOR_FAULT) if field.startswith(b"--") else good(float(field), time_s)


class Swapped(Pair):
    def readings(self, fields: Sequence[bytes], time_s: float) -> Sequence[Reading]:
        return super().readings(fields[::-1], time_s)


class SignSwallowedInTheSecond(Pair):
    sample_range = (0.1, 0.9)

    def readings(self, fields: Sequence[bytes], time_s: float) -> Sequence[Reading]:
        first, second = super().readings(fields, time_s)
        return [first, second._replace(value=abs(second.value))]


class ValueOfTheOther(Pair):
    """Where one has none."""

    def readings(self, fields: Sequence[bytes], time_s: float) -> Sequence[Reading]:
        first, second = super().readings(fields, time_s)
        return [first, first if first.ok and not second.ok else second]


class OneChannelShort(Pair):
    def readings(self, fields: Sequence[bytes], time_s: float) -> Sequence[Reading]:
        return [reading for reading in super().readings(fields, time_s) if reading.ok]


class RegisterDevice(SimulatedRegisterDevice):
    """Input registers 0 and 1: a number of 32 bits in 0.1 um; 7FFFFFFF for a sensor that is off or beyond its scale."""

    unit = 1

    def registers(self, function: int, address: int, count: int) -> list[int] | None:
        value = self.sense("value")
        counts = 2**31 - 1 if math.isnan(value) or abs(value) > 2e5 else round(value * 1e4)
        words = [counts >> 16 & 0xFFFF, counts & 0xFFFF, 0, 0]
        return words[address : address + count] if function == 4 and address + count <= len(words) else None


class Registers(Gauge[RegisterLine]):
    """Right."""

    device: ClassVar[type] = RegisterDevice
    line_kind = "registers"

    @property
    def channels(self) -> Sequence[Channel]:
        return [Channel("value")]

    def read(self, line: RegisterLine) -> Sequence[Reading]:
        (high, low), time_s = line.read_registers(1, 4, 0, 2)
        if (high, low) == (0x7FFF, 0xFFFF):
            return [bad(time_s, Quality.SENSOR_FAULT)]
        return [good(self.counts(high, low) * 1e-4, time_s)]

    def counts(self, high: int, low: int) -> int:
        counts = high << 16 | low
        return counts - 2**32 if counts >= 2**31 else counts


class LowWordAlone(Registers):
    """Right within +-3.2 mm."""

    def counts(self, high: int, low: int) -> int:
        return low - 2**16 if low >= 2**15 else low


class WithoutSign(Registers):
    sample_range = (0.1, 0.9)

    def counts(self, high: int, low: int) -> int:
        return high << 16 | low


class ExceptionIsZero(Registers):
    """Only those that are not 1 to 4."""

    def read(self, line: RegisterLine) -> Sequence[Reading]:
        try:
            return super().read(line)
        except LineFault as fault:
            if fault.quality is not Quality.DEVICE_ERROR or re.search(r"exception [1-4],", fault.detail):
                raise
            return [good(0.0, 0.0)]


class OtherUnit(Registers):
    """Asks another slave, which is not there."""

    def read(self, line: RegisterLine) -> Sequence[Reading]:
        line.read_registers(2, 4, 0, 2)
        return super().read(line)
