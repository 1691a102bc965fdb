"""How lines get their ports: those of this computer, those of a test, or those behind which every byte is shown."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from compd.lines.control_lines import ControlLines
    from compd.lines.port import NetworkPort, Port


class Ports:
    """The ports of this computer."""

    def serial(
        self, port: str, baud: int, form: str, low_latency: bool, write_timeout_s: float, control: ControlLines
    ) -> Port:
        """Open a serial port; see `SerialPort`. Raises LineFault (LINE_LOST) when it cannot be opened."""
        from compd.lines.port import SerialPort

        return SerialPort(port, baud, form, low_latency, write_timeout_s, control)

    def tcp(self, host: str, port: int, timeout_s: float) -> NetworkPort:
        """Connect within `timeout_s`. Raises LineFault (LINE_LOST) when the device cannot be reached."""
        from compd.lines.port import TcpPort

        return TcpPort(host, port, timeout_s)

    def of_stream(self, port: Port) -> Port:
        """The port that a stream of bytes uses, instead of the line's own."""
        return port


class WrappedPorts(Ports):
    """Those of this computer, with another port around each that carries a stream of bytes."""

    def __init__(self, wrap: Callable[[Port], Port]) -> None:
        self._wrap = wrap

    def of_stream(self, port: Port) -> Port:
        return self._wrap(port)


PORTS = Ports()
