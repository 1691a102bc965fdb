"""Opening a line: from its settings in the configuration to a `ByteLine` or `RegisterLine`."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias

from compd.clock import Clock
from compd.gauge import LineFault, Quality
from compd.lines.control_lines import ControlLines, Rs485Settings
from compd.lines.modbus_ascii import AsciiMaster
from compd.lines.modbus_rtu import RtuMaster, gap_s
from compd.lines.modbus_tcp import ModbusTcp
from compd.lines.port import Port, SerialPort, TcpPort
from compd.lines.stream import StreamLine

if TYPE_CHECKING:  # their libraries need not be installed
    from compd.lines.mqtt import MqttSettings, MqttSubscriber
    from compd.lines.opc_ua import OpcUaSubscriber
    from compd.lines.opc_ua_login import OpcUaSettings

PolledLine = StreamLine | RtuMaster | AsciiMaster | ModbusTcp
Line: TypeAlias = "PolledLine | MqttSubscriber | OpcUaSubscriber"
WrapPort = Callable[[Port], Port]

# Silence before a request, by which a late or repeated reply is noticed before the next one is asked for.
# TCP has no character times: a second copy of a reply follows the first within this, s.
TCP_GAP_S = 1e-3
# On any serial line, as Modbus RTU asks: in characters,
QUIET_CHARACTERS = 3.5
# and at least this, s: a USB adapter hands over what has come once a millisecond.
SERIAL_GAP_S = 2e-3


def _unchanged(port: Port) -> Port:
    return port


class _Pause(Protocol):
    @property
    def timeout_s(self) -> float: ...
    @property
    def pause_s(self) -> float: ...


class _Serial(_Pause, Protocol):
    @property
    def port(self) -> str: ...
    @property
    def baud(self) -> int: ...
    @property
    def format(self) -> str: ...
    @property
    def low_latency(self) -> bool | None: ...
    @property
    def echo(self) -> bool: ...
    @property
    def dtr(self) -> bool | None: ...
    @property
    def rts(self) -> bool | None: ...
    @property
    def rs485(self) -> Rs485Settings | None: ...


class SerialSettings(_Serial, Protocol):
    """The keys of a serial line in the configuration that are needed to open it."""

    @property
    def kind(self) -> Literal["serial"]: ...


class ModbusRtuSettings(_Serial, Protocol):
    """The keys of a Modbus RTU line in the configuration that are needed to open it."""

    @property
    def kind(self) -> Literal["modbus_rtu"]: ...
    @property
    def ask_one_more(self) -> bool: ...
    @property
    def skip_bytes(self) -> int: ...


class ModbusAsciiSettings(_Serial, Protocol):
    """The keys of a Modbus ASCII line in the configuration that are needed to open it."""

    @property
    def kind(self) -> Literal["modbus_ascii"]: ...
    @property
    def ask_one_more(self) -> bool: ...


class _Address(_Pause, Protocol):
    @property
    def host(self) -> str: ...
    @property
    def port(self) -> int: ...


class TcpSettings(_Address, Protocol):
    """The keys of a stream over TCP in the configuration that are needed to open it."""

    @property
    def kind(self) -> Literal["tcp"]: ...
    @property
    def echo(self) -> bool: ...


class ModbusTcpSettings(_Address, Protocol):
    """The keys of a Modbus TCP line in the configuration that are needed to open it."""

    @property
    def kind(self) -> Literal["modbus_tcp"]: ...
    @property
    def gateway_wait_s(self) -> float | None: ...


StreamSettings = SerialSettings | ModbusRtuSettings | ModbusAsciiSettings | TcpSettings


def open_line(
    settings: StreamSettings | ModbusTcpSettings | OpcUaSettings | MqttSettings,
    clock: Clock,
    wrap_port: WrapPort = _unchanged,
) -> Line:
    """Open a line of the settings' kind. After a LineFault with LINE_LOST, `close()` it and open a new one.

    wrap_port : as in `open_stream`; the ports of Modbus TCP, OPC UA and MQTT are within their libraries and stay as
        they are.
    Raises LineFault (LINE_LOST, with what the system said) when it cannot be opened.
    """
    match settings.kind:
        case "modbus_tcp":
            return ModbusTcp(
                settings.host, settings.port, settings.timeout_s, clock, settings.pause_s, settings.gateway_wait_s
            )
        case "opc_ua" | "mqtt":
            return _open_pushed_line(settings, clock)
    stream = open_stream(settings, clock, wrap_port)
    match settings.kind:
        case "modbus_rtu":
            return RtuMaster(stream, settings.ask_one_more, settings.skip_bytes)
        case "modbus_ascii":
            return AsciiMaster(stream, settings.ask_one_more)
    return stream


def _open_pushed_line(settings: OpcUaSettings | MqttSettings, clock: Clock) -> MqttSubscriber | OpcUaSubscriber:
    try:
        if settings.kind == "opc_ua":
            from compd.lines.opc_ua import OpcUaSubscriber

            return OpcUaSubscriber(settings, clock)
        from compd.lines.mqtt import MqttSubscriber

        return MqttSubscriber(settings, clock)
    except ImportError as error:
        extra = settings.kind.replace("_", "")
        text = f"{error.name} is not installed: pip install 'compd[{extra}]'"
        raise LineFault(Quality.LINE_LOST, text) from error


def open_stream(settings: StreamSettings, clock: Clock, wrap_port: WrapPort = _unchanged) -> StreamLine:
    """Open the stream of bytes of a line, whatever protocol is spoken over it.

    wrap_port : puts another port around the line's own, for instance one that shows every byte.
    Raises LineFault (LINE_LOST, with what the system said) when it cannot be opened.
    """
    if settings.kind == "tcp":
        port: Port = TcpPort(settings.host, settings.port, settings.timeout_s)
        quiet_s = TCP_GAP_S
    else:
        control = ControlLines(settings.dtr, settings.rts, settings.rs485)
        port = SerialPort(
            settings.port,
            settings.baud,
            settings.format,
            settings.low_latency is not False,
            settings.timeout_s,
            control,
        )
        quiet_s = max(QUIET_CHARACTERS * port.character_s, SERIAL_GAP_S)
    if settings.kind == "modbus_rtu":
        quiet_s = max(quiet_s, gap_s(settings.baud))
    return StreamLine(wrap_port(port), settings.timeout_s, max(quiet_s, settings.pause_s), clock, settings.echo)
