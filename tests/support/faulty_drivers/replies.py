"""Drivers of the comparator that take damaged replies and errors for values."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from compd.gauge import ByteLine, LineFault, Quality, Reading, bad, good
from tests.support.faulty_drivers.comparator import Comparator


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
