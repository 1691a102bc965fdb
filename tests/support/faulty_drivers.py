r"""Drivers that are wrong in one way each, and the devices that they are for; `compd driver test` must find every one.

The devices are of four kinds: a comparator that answers ``?`` CR by ``+01.2345mm`` CR LF, the same behind an address,
with and without a checksum, two channels in one reply, and registers.
"""

from __future__ import annotations

import contextlib
import math
import re
import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from pydantic import Field

from compd.gauge import ByteLine, Channel, Gauge, GaugeOptions, LineFault, Quality, Reading, RegisterLine, bad, good
from compd.simulation.wires.device import Sense, SimulatedByteDevice, SimulatedRegisterDevice

LARGEST_MM = 99.9999


class AsciiDevice(SimulatedByteDevice):
    """Answers each `request`; what it shows is up to the derived class."""

    request = b"?\r"

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        self._heard = b""

    def hear(self, data: bytes) -> bytes:
        self._heard += data
        count = self._heard.count(self.request)
        self._heard = self._heard.rpartition(b"\r")[2]
        return b"".join(self.shown() for _ in range(count))

    def shown(self) -> bytes:
        raise NotImplementedError


class ComparatorDevice(AsciiDevice):
    """+01.2345mm CR LF; ER1 for a sensor that is off, ER2 beyond its range."""

    def shown(self) -> bytes:
        return self.number().encode() + b"\r\n"

    def number(self) -> str:
        value_mm = self.sense("value")
        if math.isnan(value_mm):
            return "ER1"
        return f"{value_mm:+08.4f}mm" if abs(value_mm) < LARGEST_MM + 5e-5 else "ER2"


class Comparator(Gauge[ByteLine]):
    """Right; the others differ from it in one way each."""

    device: ClassVar[type] = ComparatorDevice
    request = b"?\r"
    form = re.compile(rb"([+-]\d{2}\.\d{4})mm")
    limit = 16

    @property
    def channels(self) -> Sequence[Channel]:
        return [Channel("value")]

    def read(self, line: ByteLine) -> Sequence[Reading]:
        time_s, reply = self.ask(line)
        if reply == b"ER1":
            return [bad(time_s, Quality.SENSOR_FAULT)]
        if re.fullmatch(rb"ER\d", reply):
            return [bad(time_s, Quality.DEVICE_ERROR, reply.decode())]
        return [good(self.number(reply), time_s)]

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time_s = line.send(self.request)
        return time_s, line.receive_until(b"\r\n", self.limit).removesuffix(b"\r\n")

    def number(self, reply: bytes) -> float:
        match = self.form.fullmatch(reply)
        if match is None:
            raise LineFault(Quality.MISMATCH, repr(reply))
        return self.converted(float(match[1]))

    def converted(self, value: float) -> float:
        return value


# --- numbers -------------------------------------------------------------------------------------------------


class GainOfNegatives(Comparator):
    def converted(self, value: float) -> float:
        return value * 1.005 if value < 0 else value


class Gain(Comparator):
    def converted(self, value: float) -> float:
        return value * 1.015


class Offset(Comparator):
    def converted(self, value: float) -> float:
        return value + 0.01


class TruncatedToMicrometres(Comparator):
    def converted(self, value: float) -> float:
        return math.trunc(value * 1e3) / 1e3


class TruncatedToTensOfMicrometres(Comparator):
    def converted(self, value: float) -> float:
        return math.trunc(value * 1e2) / 1e2


class TruncatedInItsLastDigit(Comparator):
    """int(0.0003 * 10000) is 2."""

    def converted(self, value: float) -> float:
        return math.trunc(value * 1e4 * (1 - 1e-12)) / 1e4


class OffByADigitBelowZero(Comparator):
    """Complement of one taken for that of two."""

    def converted(self, value: float) -> float:
        return value - 1e-4 if value < 0 else value


class WrongBeyondFive(Comparator):
    def converted(self, value: float) -> float:
        return value if abs(value) <= 5 else value / 2


class SaturatedAtTen(Comparator):
    def converted(self, value: float) -> float:
        return min(10.0, max(-10.0, value))


class WrongAtItsEnd(Comparator):
    def converted(self, value: float) -> float:
        return 0.0 if value >= LARGEST_MM else value


class SignSwallowed(Comparator):
    sample_range = (0.1, 0.9)

    def converted(self, value: float) -> float:
        return abs(value)


class SignSwallowedBelowOne(Comparator):
    """int("-00") is 0: the sign goes with it."""

    sample_range = (-9.0, -2.0)

    def converted(self, value: float) -> float:
        whole = math.trunc(value)
        part = abs(value - whole)
        return whole - part if whole < 0 else whole + part


class CarryLost(Comparator):
    """Wrong from 0.1 mm to 0.1001 mm alone."""

    def converted(self, value: float) -> float:
        return value - 0.1 if round(abs(value) * 1e4) == 1000 else value


class WrongEveryThousandth(Comparator):
    def __init__(self, options: Any) -> None:
        super().__init__(options)
        self._polls = 0

    def converted(self, value: float) -> float:
        self._polls += 1
        return value + 0.5 if self._polls % 1000 == 0 else value


class Deadband(Comparator):
    _last = math.nan

    def converted(self, value: float) -> float:
        if not abs(value - self._last) < 1e-3:
            self._last = value
        return self._last


class Smoothed(Comparator):
    _last = 0.0

    def converted(self, value: float) -> float:
        self._last += 0.999 * (value - self._last)
        return self._last


class FirstReplyForEver(Comparator):
    _first: bytes | None = None

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time_s, reply = super().ask(line)
        self._first = self._first or reply
        return time_s, self._first


class OneMemoryForAll(Comparator):
    """Two gauges of it share what they remember."""

    last: ClassVar[list[float]] = [0.0, 0.0]

    def read(self, line: ByteLine) -> Sequence[Reading]:
        readings = super().read(line)
        if readings[0].ok:
            self.last.append(readings[0].value)
            if len(self.last) % 7 == 0 and id(self) != OneMemoryForAll.owner:
                readings = [readings[0]._replace(value=self.last[-2])]
            OneMemoryForAll.owner = id(self)
        return readings

    owner: ClassVar[int] = 0


# --- requests, time, waiting ---------------------------------------------------------------------------------


class AsksEverySecondTime(Comparator):
    _left: Sequence[Reading] | None = None

    def read(self, line: ByteLine) -> Sequence[Reading]:
        if self._left is not None:
            left, self._left = self._left, None
            return left
        self._left = super().read(line)
        return self._left


class StampOfTheLastRequest(Comparator):
    _asked_s = 0.0

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time_s, reply = super().ask(line)
        last_s, self._asked_s = self._asked_s or time_s, time_s
        return last_s, reply


class StampBeforeTheRequest(Comparator):
    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time_s, reply = super().ask(line)
        return time_s - 1e-3, reply


class StampOfTheReply(Comparator):
    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time_s, reply = super().ask(line)
        return time_s + 1e-3, reply


class StampOfTheComputer(Comparator):
    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        _, reply = super().ask(line)
        return time.monotonic(), reply


class Sleeps(Comparator):
    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time.sleep(0.2)
        return super().ask(line)


class SleepsAfterAFault(Comparator):
    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        try:
            return super().ask(line)
        except LineFault:
            time.sleep(0.05)
            raise


class DrainsEveryTime(Comparator):
    """Reads on behind the reply's end until nothing comes."""

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time_s, reply = super().ask(line)
        line.drain()
        return time_s, reply


class WaitsByTheComputersClock(Comparator):
    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time_s = line.send(self.request)
        until_s = time.monotonic() + 0.1
        while time.monotonic() < until_s:
            with contextlib.suppress(LineFault):
                return time_s, line.receive_until(b"\r\n", self.limit).removesuffix(b"\r\n")
        raise LineFault(Quality.TIMEOUT)


class SleepsEveryHundredthPoll(Comparator):
    _polls = 0

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        self._polls += 1
        if self._polls % 100 == 0:
            time.sleep(1e-3)
        return super().ask(line)


class WaitsForAnEvent(Comparator):
    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        threading.Event().wait(1e-3)
        return super().ask(line)


class AsksAgain(Comparator):
    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        try:
            return super().ask(line)
        except LineFault:
            return super().ask(line)


# --- damaged replies, and errors -----------------------------------------------------------------------------


class SearchesANumber(Comparator):
    """Anywhere in the reply, with a sign or without."""

    def number(self, reply: bytes) -> float:
        match = re.search(rb"[+-]?\d+\.\d+", reply)
        if match is None:
            raise LineFault(Quality.MISMATCH, repr(reply))
        return float(match[0])


class SignOptional(Comparator):
    form = re.compile(rb"([+-]?\d{2}\.\d{4})mm")


class AnyWidth(Comparator):
    form = re.compile(rb"([+-]\d+\.\d+)mm")


class UnitNotLookedAt(Comparator):
    form = re.compile(rb"([+-]\d{2}\.\d{4})(?:mm|um|in)")


class LettersNotLookedAt(Comparator):
    form = re.compile(rb"([+-]\d{2}\.\d{4})..")


class UnknownErrorIsZero(Comparator):
    def number(self, reply: bytes) -> float:
        try:
            return super().number(reply)
        except LineFault:
            return 0.0


class ErrorTextIsZero(Comparator):
    """Only what begins with E, and is not ER1."""

    def read(self, line: ByteLine) -> Sequence[Reading]:
        time_s, reply = self.ask(line)
        if reply == b"ER1":
            return [bad(time_s, Quality.SENSOR_FAULT)]
        return [good(0.0 if reply.startswith(b"E") else self.number(reply), time_s)]


class BlankFieldIsZero(Comparator):
    form = re.compile(rb"([+-]\d{2}\.\d{4}|[ *-]{8})mm")

    def number(self, reply: bytes) -> float:
        return 0.0 if re.fullmatch(rb"[ *-]{8}mm", reply) else super().number(reply)


class HoldsTheLastValue(Comparator):
    """When a reply is damaged."""

    _last: float | None = None

    def number(self, reply: bytes) -> float:
        try:
            self._last = super().number(reply)
        except LineFault:
            if self._last is None:
                raise
        return self._last


class NotFinite(Comparator):
    """An error becomes infinite, and a number."""

    def read(self, line: ByteLine) -> Sequence[Reading]:
        (reading,) = super().read(line)
        return [reading if reading.ok else Reading(math.inf, reading.time_s, Quality.OK)]


class RaisesWhatItMeets(Comparator):
    def number(self, reply: bytes) -> float:
        return float(reply.removesuffix(b"mm"))


class LastValueAfterThreeFaults(Comparator):
    """In a row."""

    _last: Sequence[Reading] = ()
    _faults = 0

    def read(self, line: ByteLine) -> Sequence[Reading]:
        try:
            self._last = super().read(line)
            self._faults = 0
        except LineFault:
            self._faults += 1
            if self._faults < 4 or not self._last:
                raise
        return self._last


class FalseIdentity(Comparator):
    """What it says its replies begin with is not compared with any."""

    form = re.compile(rb".(\d{2}\.\d{4})mm")
    sample_range = (0.1, 0.9)

    @property
    def reply_identity(self) -> str:
        return "+"


# --- a display in inches -------------------------------------------------------------------------------------


class InchDevice(AsciiDevice):
    """+0.12345in CR LF."""

    def shown(self) -> bytes:
        value = self.sense("value") / 25.4
        return b"ER1\r\n" if math.isnan(value) else f"{value:+.5f}in\r\n".encode()


class Inch(Comparator):
    device = InchDevice
    form = re.compile(rb"([+-](?:0|[1-9]\d*)\.\d{5})in")

    def converted(self, value: float) -> float:
        return value * 25.4


class Inch25(Inch):
    def converted(self, value: float) -> float:
        return value * 25.0


# --- a device with a number that means another thing, and one with exponents -----------------------------------


class CodeDevice(ComparatorDevice):
    """+99.9999mm for all beyond +-50 mm."""

    def number(self) -> str:
        value_mm = self.sense("value")
        return "ER1" if math.isnan(value_mm) else f"{value_mm if abs(value_mm) < 50 else LARGEST_MM:+08.4f}mm"


class Code(Comparator):
    device = CodeDevice

    def number(self, reply: bytes) -> float:
        if reply == b"+99.9999mm":
            raise LineFault(Quality.DEVICE_ERROR, "beyond its range")
        value = super().number(reply)
        if abs(value) > 50:
            raise LineFault(Quality.MISMATCH, "beyond its range")
        return value


class CodeIsANumber(Comparator):
    device = CodeDevice


class ExponentDevice(AsciiDevice):
    """+1.23456E-03mm CR LF."""

    def shown(self) -> bytes:
        value = self.sense("value")
        return b"ER1\r\n" if math.isnan(value) else f"{value:+.5E}mm\r\n".encode()


class Exponent(Comparator):
    device = ExponentDevice
    form = re.compile(rb"([+-]\d\.\d{5}E[+-]\d{2})mm")


class ExponentWithoutSign(Exponent):
    def number(self, reply: bytes) -> float:
        return super().number(reply.replace(b"E+", b"E-"))


# --- an address, a checksum ----------------------------------------------------------------------------------


class UnitOptions(GaugeOptions):
    address: int = Field(default=1, ge=1, le=99, description="of the unit")


class AddressedDevice(ComparatorDevice):
    """#01 CR is answered by >01+01.2345mm CR LF."""

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        self.address = getattr(options, "address", 1)
        self.request = b"#%02d\r" % self.address

    def shown(self) -> bytes:
        return b">%02d%s\r\n" % (self.address, self.number().encode())


class CheckedDevice(AddressedDevice):
    """The same with the sum of all characters, as two hexadecimal digits before CR LF."""

    def shown(self) -> bytes:
        text = super().shown().removesuffix(b"\r\n")
        return b"%s%02X\r\n" % (text, sum(text) % 256)


class Addressed(Comparator):
    device = AddressedDevice
    Options = UnitOptions
    sample_options: ClassVar[Mapping[str, Any]] = {"address": 1}
    limit = 24

    def __init__(self, options: Any) -> None:
        super().__init__(options)
        self.address = b"%02d" % options.address
        self.request = b"#" + self.address + b"\r"

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time_s, reply = super().ask(line)
        if not self.mine(reply):
            raise LineFault(Quality.MISMATCH, f"another unit's: {reply!r}")
        return time_s, reply[3:]

    def mine(self, reply: bytes) -> bool:
        return reply[:3] == b">" + self.address


class AnyAddress(Addressed):
    def mine(self, reply: bytes) -> bool:
        return re.match(rb">\d\d", reply) is not None


class AnyAddressWritten(Comparator):
    """The same where the address is no option."""

    device = AddressedDevice
    request = b"#01\r"
    limit = 24

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time_s, reply = super().ask(line)
        if not re.match(rb">\d\d", reply):
            raise LineFault(Quality.MISMATCH, repr(reply))
        return time_s, reply[3:]


class Checked(Addressed):
    device = CheckedDevice
    integrity = "checksum"

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time_s = line.send(self.request)
        reply = line.receive_until(b"\r\n", self.limit).removesuffix(b"\r\n")
        text, digits = reply[:-2], reply[-2:]
        if not self.whole(text, digits):
            raise LineFault(Quality.CRC, repr(reply))
        if not self.mine(text):
            raise LineFault(Quality.MISMATCH, f"another unit's: {reply!r}")
        return time_s, text[3:]

    def whole(self, text: bytes, digits: bytes) -> bool:
        return digits == b"%02X" % (sum(text) % 256)


class CheckedAnyAddress(Checked):
    def mine(self, reply: bytes) -> bool:
        return re.match(rb">\d\d", reply) is not None


class CheckedAnyAddressWritten(CheckedAnyAddress):
    """The same where the address is no option."""

    Options = GaugeOptions
    sample_options: ClassVar[Mapping[str, Any]] = {}

    def __init__(self, options: Any) -> None:
        Comparator.__init__(self, options)
        self.request = b"#01\r"


class ChecksumNotLookedAt(Checked):
    integrity = "format"

    def whole(self, text: bytes, digits: bytes) -> bool:
        return True


class ChecksumHalfLookedAt(Checked):
    integrity = "format"

    def whole(self, text: bytes, digits: bytes) -> bool:
        return digits[1:] == (b"%02X" % (sum(text) % 256))[1:]


class CheckedUnitNotLookedAt(Checked):
    form = re.compile(rb"([+-]\d{2}\.\d{4})[a-z]{2}")


class CheckedErrorIsZero(Checked):
    def number(self, reply: bytes) -> float:
        try:
            return super().number(reply)
        except LineFault:
            return 0.0


# --- two channels --------------------------------------------------------------------------------------------


class PairDevice(AsciiDevice):
    """+01.2345,-02.3456 CR LF; a sensor that is off shows dashes."""

    def shown(self) -> bytes:
        values = [self.sense(name) for name in ("a", "b")]
        if any(abs(value) >= LARGEST_MM for value in values):
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


# --- registers -----------------------------------------------------------------------------------------------


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
