"""The other end of MyGauge's wire, from the manual and not from the driver: the two share no code."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from compd.twins import Sense, SimulatedByteDevice

LARGEST = 99.9999
MM_IN_AN_INCH = 25.4


class SimulatedMyGauge(SimulatedByteDevice):
    """Shows its channel `value`; a sensor that is off gives `ER01`."""

    # whole error replies of the device, and their qualities
    error_replies: ClassVar[Mapping[bytes, str]] = {
        b"ER01\r\n": "sensor_fault",
        b"ER02\r\n": "over_range",
        b"ER03\r\n": "under_range",
        b"ER77\r\n": "device_error",
    }

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        self._received = b""

    def receive(self, data: bytes) -> bytes:
        """One reply for every complete request; bytes may come in any pieces."""
        *requests, self._received = (self._received + data).split(b"\r")
        return b"".join(self._shown() for request in requests if request.endswith(b"?"))

    def _shown(self) -> bytes:
        value = self.sense("value")
        if self.options.unit == "in":
            value /= MM_IN_AN_INCH
        if math.isnan(value):
            return b"ER01\r\n"
        if abs(value) > LARGEST:
            return b"ER02\r\n" if value > 0 else b"ER03\r\n"
        return f"{value:+08.4f}{self.options.unit}\r\n".encode()
