"""From a line's settings to an open line."""

from __future__ import annotations

from typing import Literal, Protocol

from compd.clock import Clock
from compd.lines.modbus_rtu import RtuMaster, gap_s
from compd.lines.modbus_tcp import ModbusTcp
from compd.lines.port import SerialPort, TcpPort
from compd.lines.stream import StreamLine

Line = StreamLine | RtuMaster | ModbusTcp

# Over TCP there are no character times; a second copy of a reply follows the first within this.
TCP_GAP_S = 1e-3
QUIET_CHARACTERS = 3.5  # before a request, on any serial line: as Modbus RTU asks
# USB adapters hand over what has come once a millisecond; a second copy of a reply must be seen to begin.
SERIAL_GAP_S = 2e-3


class SerialSettings(Protocol):
    """A serial port's keys in the configuration."""

    @property
    def kind(self) -> Literal["serial", "modbus_rtu"]: ...
    @property
    def port(self) -> str: ...
    @property
    def baud(self) -> int: ...
    @property
    def format(self) -> str: ...
    @property
    def low_latency(self) -> bool: ...
    @property
    def timeout_s(self) -> float: ...


class TcpSettings(Protocol):
    """A TCP connection's keys in the configuration."""

    @property
    def kind(self) -> Literal["tcp", "modbus_tcp"]: ...
    @property
    def host(self) -> str: ...
    @property
    def port(self) -> int: ...
    @property
    def timeout_s(self) -> float: ...


def open_line(settings: SerialSettings | TcpSettings, clock: Clock) -> Line:
    """An open line of the settings' kind; `close()` it after a fault LINE_LOST and open a new one.

    Raises LineFault(LINE_LOST, what the system said) when it cannot be opened.
    """
    if settings.kind == "modbus_tcp":
        return ModbusTcp(settings.host, settings.port, settings.timeout_s, clock)
    if settings.kind == "tcp":
        return StreamLine(
            TcpPort(settings.host, settings.port, settings.timeout_s), settings.timeout_s, TCP_GAP_S, clock
        )
    port = SerialPort(settings.port, settings.baud, settings.format, settings.low_latency, settings.timeout_s)
    quiet_s = max(QUIET_CHARACTERS * port.character_s, SERIAL_GAP_S)
    if settings.kind == "serial":
        return StreamLine(port, settings.timeout_s, quiet_s, clock)
    return RtuMaster(StreamLine(port, settings.timeout_s, max(quiet_s, gap_s(settings.baud)), clock))
