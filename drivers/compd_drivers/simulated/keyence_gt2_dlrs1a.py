"""The other end of a DL-RS1A with its comparator heads: M0, MS, and ER for what it does not know."""

from __future__ import annotations

import math
from typing import Any

from compd.simulation.wires.device import Sense, SimulatedByteDevice

LARGEST_MM = 199.9990  # what a head shows that has no value
COMMAND_ERROR = "ER,{},00"
GO, ALARM = "02", "16"  # judgement of a head: inside its limits, or no value


class SimulatedDlRs1a(SimulatedByteDevice):
    """Shows its channels `1`, `2` ...; a sensor that is off shows the number that means `no value`."""

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        self._heard = b""

    def hear(self, data: bytes) -> bytes:
        """One reply for every command that is complete."""
        *commands, self._heard = (self._heard + data).split(b"\r\n")
        return b"".join(f"{self._answer(command)}\r\n".encode("ascii") for command in commands)

    def _answer(self, command: bytes) -> str:
        text = command.decode("ascii", "ignore")
        heads = [self.sense(str(head + 1)) for head in range(self.options.heads)]
        match text:
            case "M0":
                return ",".join(["M0", *map(_shown, heads)])
            case "MS":
                return ",".join(["MS", *(f"{GO if math.isfinite(mm) else ALARM},{_shown(mm)}" for mm in heads)])
        return COMMAND_ERROR.format(text.split(",")[0][:2])


def _shown(value_mm: float) -> str:
    if not math.isfinite(value_mm):
        return f"{-LARGEST_MM:+09.4f}"
    return f"{min(LARGEST_MM, max(-LARGEST_MM, value_mm)):+09.4f}"
