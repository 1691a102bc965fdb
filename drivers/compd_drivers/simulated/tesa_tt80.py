"""The other end of a TT80 or TT90: the displayed value by the forms of the manual's page 94, ERRnn otherwise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

from compd_drivers.simulated.commands import CommandDevice

MM_IN = {"um": 1e-3, "mm": 1.0, "inch": 25.4, "mil": 0.0254}
UNKNOWN_COMMAND = "ERR10\r\n"  # the manual shows ERRnn; this number is made up
NO_VALUE = "ERR20\r\n"  # likewise


class SimulatedTt80(CommandDevice):
    """Shows its channel `position`."""

    error_replies: ClassVar[Mapping[bytes, str]] = {b"ERR23\r\n": "device_error"}

    def answer(self, command: str) -> str:
        if command != "?":
            return UNKNOWN_COMMAND
        shown = self.sense("position") / MM_IN[self.options.unit]
        if not math.isfinite(shown):
            return NO_VALUE
        match self.options.model, self.options.unit:
            case "TT80", "inch":
                text = f"{shown:+.6f}".replace("0.", ".", 1)
            case "TT80", _:
                text = f"{shown:+08.2f}"
            case _, "mil":
                text = f"{shown:+.4f}"
            case _:
                text = f"{shown:+08.3f}"
        return f"{text}\r\n"
