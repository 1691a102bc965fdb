"""The comparator where no bytes ask it: it sends unsolicited readings, or to a pulse of DTR."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from compd.gauge import ByteLine, LineFault, Quality, Reading
from tests.support.faulty_drivers.comparator import Comparator, ComparatorDevice

END = b"\r\n"
PULSE_S = 0.12


class SpeakingDevice(ComparatorDevice):
    """+01.2345mm CR LF, without bytes that ask for it."""

    def receive(self, data: bytes) -> bytes:
        return b""

    def speak(self) -> bytes:
        return self.shown()


# --- unsolicited ---------------------------------------------------------------------------------------------------


class Talker(Comparator):
    """Right."""

    device = SpeakingDevice

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        reply, time_s = line.next_line(END, self.limit)
        return time_s, reply


class KeepsTheLastLine(Talker):
    """When the device falls silent."""

    _last: tuple[float, bytes] | None = None

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        try:
            self._last = super().ask(line)
        except LineFault as fault:
            if fault.quality is not Quality.TIMEOUT or self._last is None:
                raise
        return self._last


class KeepsTheLastReading(Talker):
    """For the first polls of a silence, with its old time."""

    _last: Sequence[Reading] = ()
    _silent = 0

    def read(self, line: ByteLine) -> Sequence[Reading]:
        try:
            self._last, self._silent = super().read(line), 0
        except LineFault as fault:
            self._silent += 1
            if fault.quality is not Quality.TIMEOUT or self._silent > 3 or not self._last:
                raise
        return self._last


class HalfALine(Talker):
    """What is left of a line under way is taken as one, whatever its width."""

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time_s = line.listen()
        return time_s, line.receive_until(END, self.limit).removesuffix(END)

    def number(self, reply: bytes) -> float:
        try:
            return float(reply.removesuffix(b"mm"))
        except ValueError as error:
            raise LineFault(Quality.MISMATCH, repr(reply)) from error


class OldestLine(Talker):
    """Where lines wait already, the first of them."""

    _time_s = 0.0

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        try:
            return self._time_s, line.receive_until(END, self.limit, timeout_s=0.0).removesuffix(END)
        except LineFault as fault:
            if fault.quality is not Quality.TIMEOUT:
                raise
        self._time_s, reply = super().ask(line)
        return self._time_s, reply


class StampOfTheReceipt(Talker):
    """Later than the device can have sampled."""

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        _, reply = super().ask(line)
        return line.listen() + 1e-6, reply


# --- by DTR ----------------------------------------------------------------------------------------------------


class Pulsed(Comparator):
    """Right."""

    device = SpeakingDevice

    @property
    def serial_signals(self) -> Sequence[Literal["DTR", "break"]]:
        return ("DTR",)

    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time_s = line.pulse_dtr(PULSE_S)
        return time_s, line.receive_until(END, self.limit).removesuffix(END)


class StampBehindThePulse(Pulsed):
    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        time_s, reply = super().ask(line)
        return time_s + PULSE_S, reply


class PulsesAgain(Pulsed):
    def ask(self, line: ByteLine) -> tuple[float, bytes]:
        try:
            return super().ask(line)
        except LineFault:
            return super().ask(line)
