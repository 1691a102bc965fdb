"""The other end of an OPTO-RS cable: sign, digits, point, digits, CR, and ERR0 to ERR3 (manual, page 12)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

from compd_drivers.simulated.commands import CommandDevice

DECIMALS = {"mm": 3, "inch": 5}  # of an instrument with a step of 1 um
MM_IN = {"mm": 1.0, "inch": 25.4}


class SimulatedOptoRs(CommandDevice):
    """Shows its channel `position`; a sensor that is off says ERR0, one beyond its range ERR3."""

    error_replies: ClassVar[Mapping[bytes, str]] = {
        b"ERR0\r": "sensor_fault",
        b"ERR1\r": "device_error",
        b"ERR2\r": "device_error",
        b"ERR3\r": "over_range",
    }

    def answer(self, command: str) -> str:
        if command != "?":
            return "ERR1\r"
        position_mm = self.sense("position")
        if not math.isfinite(position_mm):
            return "ERR0\r"
        if self.options.range_mm and not self.options.range_mm[0] <= position_mm <= self.options.range_mm[1]:
            return "ERR3\r"
        decimals = self.options.decimals or DECIMALS[self.options.unit]
        return f"{position_mm / MM_IN[self.options.unit]:+.{decimals}f}\r"
