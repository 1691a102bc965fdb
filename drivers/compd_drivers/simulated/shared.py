"""Common parts of the simulated devices: commands with an end, transducers at an input, units on the wire."""

from __future__ import annotations

import math
from abc import abstractmethod
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from compd.twins import Sense, SimulatedByteDevice

BEYOND = 0.01  # share of the range by which a transducer exceeds its calibrated ends before it saturates
# Size of the wire's units in the channel's unit (mm, N, hPa).
UNITS = {"mm": 1.0, "um": 1e-3, "nm": 1e-6, "inch": 25.4, "mil": 0.0254, "kN": 1e3, "kPa": 10.0, "Pa": 1e-2}


class CommandDevice(SimulatedByteDevice):
    """A text instrument: one answer for every complete command."""

    terminator: ClassVar[bytes] = b"\r"

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        self._received = b""

    def receive(self, data: bytes) -> bytes:
        *commands, self._received = (self._received + data).split(self.terminator)
        return b"".join(self.answer(command.decode("ascii", "ignore")).encode("ascii") for command in commands)

    @abstractmethod
    def answer(self, command: str) -> str:
        """The whole reply to one command, with its end; "" for silence."""


def signal_for(linearisation: Any, value: float) -> float:
    """The transducer's signal (V, mA) at which its calibration curve has `value`, which is in the channel's unit.

    Beyond the curve's ends it saturates a little beyond them; nan for nan.
    """
    if not math.isfinite(value):
        return math.nan
    signals, values = _curve(linearisation)
    beyond = BEYOND * (signals[-1] - signals[0])
    return float(np.interp(value, values, signals, left=signals[0] - beyond, right=signals[-1] + beyond))


@lru_cache
def _curve(linearisation: Any) -> tuple[np.ndarray, np.ndarray]:
    """Signals, and the values at them in rising order."""
    if linearisation.table is not None:
        signals, values = np.array(linearisation.table).T
    else:
        signals = np.linspace(linearisation.valid[0], linearisation.valid[1], 4001)
        values = np.polynomial.Polynomial(linearisation.polynomial)(signals)
    return (signals[::-1], values[::-1]) if values[0] > values[-1] else (signals, values)


def number_for(channel: Any, value: float) -> float:
    """The number that the device sends for `value`, before the described `scale`: in the channel's unit on the wire."""
    if channel.linearisation is not None:
        return signal_for(channel.linearisation, value)
    match channel.unit:
        case "degF":
            return value * 9 / 5 + 32
        case "K":
            return value + 273.15
    return value / UNITS.get(channel.unit, 1.0)
