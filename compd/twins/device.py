"""Simulated devices: the far end of a gauge's wire, which answers requests as the device would.

A driver package offers one class per driver name in the entry-point group `compd.simulated_gauges`.
It is written from the device's manual, not from the driver; the two share no code.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

# Present value at the device's sensor by channel name, in the channel's unit; nan: the sensor is off.
Sense = Callable[[str], float]


class Listener(Protocol):
    """Receives a line's bytes and returns replies."""

    def receive(self, data: bytes) -> bytes: ...


class SimulatedByteDevice(ABC):
    """A device on a line of bytes. Several may share a line; each receives every byte."""

    def __init__(self, options: Any, sense: Sense) -> None:
        """options : the gauge's validated options from the configuration. sense : see `Sense`."""
        self.options = options
        self.sense = sense

    @abstractmethod
    def receive(self, data: bytes) -> bytes:
        """Receive bytes, in pieces of any size; returns the reply to complete requests, or b""."""

    def speak(self) -> bytes:
        """What it says where no bytes ask it: unasked, time after time, or to a pulse of DTR; b"" where it does not.

        `compd gauge test-driver` plays both. On the ptys and ports of a simulated machine it is not heard.
        """
        return b""


class SimulatedRegisterDevice(ABC):
    """Registers of a Modbus slave; the line does the framing."""

    def __init__(self, options: Any, sense: Sense) -> None:
        """options : the gauge's validated options from the configuration. sense : see `Sense`."""
        self.options = options
        self.sense = sense

    @property
    @abstractmethod
    def unit(self) -> int:
        """Slave address."""

    @abstractmethod
    def registers(self, function: int, address: int, count: int) -> list[int] | None:
        """Unsigned 16-bit values, or None for an illegal address or function."""

    def bits(self, function: int, address: int, count: int) -> list[bool] | None:
        """Coils (function 1) or discrete inputs (2), or None for an illegal address."""
        return None

    def write(self, function: int, address: int, values: Sequence[int]) -> bool:
        """Take what is written by function 5 (0 or 1), 6 or 16; False for an illegal address."""
        return False


class SimulatedPushedDevice(ABC):
    """A device that speaks by itself; its line sends what it says.

    period_s : how often it has something to say, s; None: as the line does.
    """

    period_s: float | None = None

    def __init__(self, options: Any, sense: Sense) -> None:
        """options : the gauge's validated options from the configuration. sense : see `Sense`."""
        self.options = options
        self.sense = sense

    @abstractmethod
    def say(self, utc_s: float) -> Mapping[str, Any]:
        """Its values now, by topic or node: the payload (bytes); a number, nan for a sensor that is off, or a list.

        utc_s : calendar time, s since 1970.
        """
