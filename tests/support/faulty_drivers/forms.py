"""Devices whose numbers have other forms: in inches, with one that means another thing, with exponents."""

from __future__ import annotations

import math
import re

from compd.gauge import LineFault, Quality
from tests.support.faulty_drivers.comparator import MAX_MM, AsciiDevice, Comparator, ComparatorDevice


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


class CodeDevice(ComparatorDevice):
    """+99.9999mm for all beyond +-50 mm."""

    def number(self) -> str:
        value_mm = self.sense("value")
        return "ER1" if math.isnan(value_mm) else f"{value_mm if abs(value_mm) < 50 else MAX_MM:+08.4f}mm"


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
    form = re.compile(rb"([+-](?:[1-9]\.\d{5}E[+-]\d{2}|0\.00000E\+00))mm")


class ExponentWithoutSign(Exponent):
    def number(self, reply: bytes) -> float:
        return super().number(reply.replace(b"E+", b"E-"))
