"""A comparator that answers ``?`` CR by ``+01.2345mm`` CR LF, and a driver for it that is right."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any, ClassVar

from compd.gauge import ByteLine, Channel, Gauge, LineFault, Quality, Reading, bad, good
from compd.twins import Sense, SimulatedByteDevice

MAX_MM = 99.9999


class AsciiDevice(SimulatedByteDevice):
    """Answers each `request`; what it shows is up to the derived class."""

    request = b"?\r"

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        self._received = b""

    def receive(self, data: bytes) -> bytes:
        self._received += data
        count = self._received.count(self.request)
        self._received = self._received.rpartition(b"\r")[2]
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
        return f"{value_mm:+08.4f}mm" if abs(value_mm) < MAX_MM + 5e-5 else "ER2"


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
