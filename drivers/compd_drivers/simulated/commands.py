"""What the simulated text instruments share: they hear commands that end somehow, and answer each."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, ClassVar

from compd.simulation.wires.device import Sense, SimulatedByteDevice


class CommandDevice(SimulatedByteDevice):
    """One answer for every command that is complete."""

    terminator: ClassVar[bytes] = b"\r"

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        self._heard = b""

    def hear(self, data: bytes) -> bytes:
        *commands, self._heard = (self._heard + data).split(self.terminator)
        return b"".join(self.answer(command.decode("ascii", "replace")).encode("ascii") for command in commands)

    @abstractmethod
    def answer(self, command: str) -> str:
        """The whole reply to one command, without its terminator; "" for silence."""
