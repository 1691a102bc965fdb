"""The other end of an MSC7401: its telegram with two floats, by the manuals' appendix A 4.4.4."""

from __future__ import annotations

import math
import struct
from typing import Any

from compd.simulation.wires.device import Sense, SimulatedByteDevice
from compd_drivers.simulated.transducer import signal_for

REQUEST_LENGTH = 6
MASTER = 0x01
V_PER_MM = 1.0  # of a sensor that is not linearised; only shown as the unscaled value
MM_IN = {"mm": 1.0, "um": 1e-3}


class SimulatedMsc7(SimulatedByteDevice):
    """Shows its channel `position`; a sensor that is off makes the scaled value 0 and the signal no number."""

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        self._heard = b""

    def hear(self, data: bytes) -> bytes:
        self._heard += data
        asked = bytes((self.options.address, MASTER, 0x4C))
        request = b"\x10" + asked + bytes([sum(asked) % 256, 0x16])
        replies = b""
        while request in self._heard:
            _, _, self._heard = self._heard.partition(request)
            replies += self._telegram()
        self._heard = self._heard[-REQUEST_LENGTH:]
        return replies

    def _telegram(self) -> bytes:
        position_mm = self.sense("position")
        if self.options.linearisation is not None:
            signal_V = signal_for(self.options.linearisation, position_mm)
            scaled = signal_V
        else:
            signal_V = position_mm * V_PER_MM
            scaled = position_mm / MM_IN[self.options.unit]
        body = bytes((MASTER, self.options.address, 0x08))
        body += struct.pack("<ff", signal_V, scaled if math.isfinite(scaled) else 0.0)
        return b"\x68\x0b\x0b\x68" + body + bytes([sum(body) % 256, 0x16])
