"""Drivers of the comparator that ask, stamp or wait wrongly."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Sequence

from compd.gauge import ByteLine, LineFault, Quality, Reading
from tests.support.faulty_drivers.comparator import Comparator


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
