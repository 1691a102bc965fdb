"""What the kinds of line on a serial port have in common."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

from compd.clock import Clock
from compd.line_settings import LATENCY_TIMER_S, QUIET_CHARACTERS, Pace, serial_pace
from compd.lines.line_definition import PolledDefinition
from compd.lines.port_arguments import PortArguments

if TYPE_CHECKING:
    from compd.line_settings import SerialPortSettings
    from compd.lines.ports import Ports
    from compd.lines.stream import StreamLine
    from compd.probes import Computer, Finding

# Silence before a request, by which a late or repeated reply is noticed before the next one is asked for: at least
# this, s, since a USB adapter hands over what has come once a millisecond.
MIN_SERIAL_GAP_S = 2e-3


class SerialDefinition(PolledDefinition):
    """A kind of line on a serial port."""

    over_network = False
    example_port = "/dev/ttyUSB0"
    example_key = "echo=true"
    rtu: ClassVar[bool] = False  #: whether it keeps the silences of Modbus RTU

    def stream(self, settings: SerialPortSettings, clock: Clock, ports: Ports) -> StreamLine:
        from compd.lines.control_lines import ControlLines
        from compd.lines.stream import StreamLine

        port = ports.serial(
            settings.port,
            settings.baud,
            settings.format,
            settings.low_latency is not False,
            settings.timeout_s,
            ControlLines(settings.dtr, settings.rts, settings.rs485),
        )
        quiet_s = max(QUIET_CHARACTERS * port.character_s, self.min_gap_s(settings), settings.pause_s)
        return StreamLine(ports.of_stream(port), settings.timeout_s, quiet_s, clock, settings.echo)

    def min_gap_s(self, settings: SerialPortSettings) -> float:
        """Shortest silence before a request, s, whatever the time of a character is."""
        return MIN_SERIAL_GAP_S

    def pace(self, settings: SerialPortSettings, turnaround_s: float | None = None) -> Pace:
        """Behind socket:// the device server's baud rate counts: it is the configured one."""
        serial = serial_pace(settings.baud, settings.format, self.rtu, turnaround_s)
        return replace(serial, quiet_s=max(serial.quiet_s, settings.pause_s))

    def held_back_s(self, settings: SerialPortSettings) -> float:
        return LATENCY_TIMER_S if settings.low_latency is False and not settings.behind_url else 0.0

    def probe(
        self, computer: Computer, subject: str, settings: SerialPortSettings, daemon_runs: bool
    ) -> Iterator[Finding]:
        from compd.probes import serial_findings

        return serial_findings(computer, subject, settings.port, settings.low_latency is not False)

    def port_keys(self, port: PortArguments) -> dict[str, Any]:
        return port.serial_keys()

    def device(self, line: Any) -> str:
        return line.port or ""

    def without_signals(self, line: Any) -> str:
        return "a TCP connection" if str(line.port).startswith("socket://") else ""
