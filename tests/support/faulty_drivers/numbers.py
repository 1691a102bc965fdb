"""Drivers of the comparator that make wrong numbers of right replies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

from compd.gauge import ByteLine, Reading
from tests.support.faulty_drivers.comparator import MAX_MM, Comparator


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
        return 0.0 if value >= MAX_MM else value


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
