"""The other end of a Millimar C1202: three features by the manual's page 82; silent while `in_menu`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

from compd.twins import Sense
from compd_drivers.simulated.shared import UNITS, CommandDevice

FEATURES = (1, 2, 3)


class SimulatedC1202(CommandDevice):
    """Shows its channels `1`, `2`, `3`; a feature that is not configured, or whose sensor is off, is ERR6."""

    error_replies: ClassVar[Mapping[bytes, str]] = {b"1 ERR6;2 ERR6;3 ERR6\r": "device_error"}

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        self.in_menu = False

    def answer(self, command: str) -> str:
        if self.in_menu:
            return ""
        if command == "?":
            return ";".join(map(self._shown, FEATURES)) + "\r"
        if command in {"M1?", "M2?", "M3?"}:
            return self._shown(int(command[1])) + "\r"
        return "ERR1\r"

    def _shown(self, feature: int) -> str:
        value_mm = self.sense(str(feature)) if feature in self.options.features else math.nan
        if not math.isfinite(value_mm):
            return f"{feature} ERR6"
        width = 2 + self.options.digits + self.options.decimals
        value = f"{value_mm / UNITS[self.options.unit]:+0{width}.{self.options.decimals}f}"
        return f"{feature} {value} {self.options.unit}"
