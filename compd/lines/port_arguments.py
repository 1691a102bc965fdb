"""A port as it is given on the command line, and what follows from it for the keys of a line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from compd.errors import ConfigurationError


@dataclass(frozen=True)
class PortArguments:
    """A port as it is given on the command line; `baud` and `format` (8N1 ...) are None over TCP.

    keys : other keys of the line, as KEY=VALUE (VALUE in YAML).
    """

    port: str
    baud: int | None
    format: str | None
    timeout_s: float
    keys: Sequence[str] = ()

    @property
    def host_and_port(self) -> tuple[str, int] | None:
        """Of host:port; None for any other port."""
        host, colon, number = self.port.rpartition(":")
        return (host, int(number)) if colon and number.isdigit() and "/" not in self.port else None

    def network_keys(self, what: str, example: str) -> dict[str, Any]:
        """`host` and `port` of a line. Raises ConfigurationError for another port: what it is not, and an example."""
        address = self.host_and_port
        if address is None:
            raise ConfigurationError.of("--port", what, value=self.port, allowed=f"host:port, such as {example}")
        return {"host": address[0], "port": address[1]}

    def serial_keys(self) -> dict[str, Any]:
        """`port`, `baud` and `format` of a line. Raises ConfigurationError where one is missing."""
        if self.baud is None or self.format is None:
            raise ConfigurationError.of(
                "--baud, --format",
                "a serial port needs both",
                value=self.port,
                allowed="--baud 9600 --format 7E2",
                next_step="look them up in the device's manual; they differ from device to device",
            )
        return {"port": self.port, "baud": self.baud, "format": self.format}
