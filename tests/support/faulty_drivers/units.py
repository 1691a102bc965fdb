"""The comparator behind an address, without and with a checksum."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, ClassVar

from pydantic import Field

from compd.gauge import ByteLine, GaugeOptions, LineFault, Quality
from compd.twins import Sense
from tests.support.faulty_drivers.comparator import Comparator, ComparatorDevice


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
