"""The other end of a DL-EN1 with its comparator heads: MS, M0 and ER, integers with a sign and nine digits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

from compd_drivers.simulated.commands import CommandDevice

INVALID = -99_999_998
OVER, UNDER = 99_999_999, -99_999_999
GO, ERROR = "04", "03"
FORMAT_ERROR = "255"


class SimulatedDlEn1(CommandDevice):
    """Shows its channels `1`, `2` ...; a sensor that is off is invalid."""

    error_replies: ClassVar[Mapping[bytes, str]] = {
        b"ER,MS,031\r\n": "device_error",
        b"ER,MS,254\r\n": "device_error",
        b"ER,MS,255\r\n": "device_error",
    }

    terminator = b"\r\n"

    def answer(self, command: str) -> str:
        heads = [self.sense(str(head + 1)) for head in range(self.options.heads)]
        match command:
            case "MS":
                fields = [f"{GO if math.isfinite(mm) else ERROR},{self._shown(mm)}" for mm in heads]
            case "M0":
                fields = [self._shown(mm) for mm in heads]
            case _:
                return f"ER,{command[:2]},{FORMAT_ERROR}\r\n"
        return ",".join([command, *fields]) + "\r\n"

    def _shown(self, value_mm: float) -> str:
        if not math.isfinite(value_mm):
            return f"{INVALID:+010d}"
        return f"{min(OVER, max(UNDER, round(value_mm * 10**self.options.decimals))):+010d}"
