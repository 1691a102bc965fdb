"""The other end of a gauge's wire: what a simulated device answers.

A driver package offers one class per driver name in the entry-point group `compd.simulated_gauges`.
It is written from the device's manual, not from the driver: the two ends share no code.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

# What the device's sensor sees now, by channel name, in the channel's unit; nan = the sensor is off.
Sense = Callable[[str], float]


class SimulatedByteDevice(ABC):
    """A device on a byte line; several may share one line, each hears every byte."""

    def __init__(self, options: Any, sense: Sense) -> None:
        """`options`: the gauge's own validated options, from the same configuration."""
        self.options = options
        self.sense = sense

    @abstractmethod
    def hear(self, data: bytes) -> bytes:
        """Bytes as they arrive, in any pieces; the reply to what is complete, or b""."""


class SimulatedRegisterDevice(ABC):
    """A Modbus slave's registers; the line does the framing."""

    def __init__(self, options: Any, sense: Sense) -> None:
        """`options`: the gauge's own validated options, from the same configuration."""
        self.options = options
        self.sense = sense

    @property
    @abstractmethod
    def unit(self) -> int:
        """Slave address."""

    @abstractmethod
    def registers(self, function: int, address: int, count: int) -> list[int] | None:
        """Unsigned 16-bit values, or None for an illegal address or function."""
