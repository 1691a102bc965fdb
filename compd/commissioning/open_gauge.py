"""The gauge that a driver's name means, its line with every byte shown, and polling it as the daemon does."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from compd.clock import Clock
from compd.configuration.lines import (
    LineSettings,
    ModbusAsciiLine,
    ModbusRtuLine,
    ModbusTcpLine,
    SerialLine,
    TcpLine,
    powered,
)
from compd.configuration.pushed_lines import MqttLine, OpcUaLine, PushedLineSettings
from compd.documents.section import separate_errors
from compd.documents.yaml_reader import parse_yaml
from compd.errors import ConfigurationError, Problem
from compd.gauge import Gauge, LineFault, LineKind, Quality, Reading, bad
from compd.lines import Line, open_line, open_stream
from compd.lines.echo import explained
from compd.lines.port import Port
from compd.lines.stream import StreamLine
from compd.live.acquisition.round_trigger import read_latched
from compd.plugins import GAUGES, load
from compd.pushed_gauge import Message, PushedLine

SettingsT = TypeVar(
    "SettingsT", SerialLine, TcpLine, ModbusRtuLine, ModbusAsciiLine, ModbusTcpLine, OpcUaLine, MqttLine
)


# Where nothing says how old a reading may be: one that is older is no measurement of now.
STALE_AFTER_S = 10.0


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


@dataclass(frozen=True)
class GaugeTarget:
    """One gauge and the line that it hangs on. stale_after_s : age from which its readings are not used, s."""

    name: str
    gauge: Gauge[Any]
    line: LineSettings
    stale_after_s: float = STALE_AFTER_S


def gauge_of_driver(driver: str, port: PortArguments, assignments: Sequence[str]) -> GaugeTarget:
    """A gauge without a configuration: its driver's name, a port, and options as KEY=VALUE (VALUE in YAML).

    Raises ConfigurationError for an assignment that is none, and for options that the driver refuses.
    """
    kind = load(GAUGES, driver, f"driver {driver}")
    options = {"driver": driver, "line": "command_line", **_assigned("--set", assignments, "heads=9")}
    try:
        gauge = kind(kind.Options.model_validate(options))
    except ValidationError as error:
        raise ConfigurationError(
            [
                Problem(
                    where=f"--set {'.'.join(map(str, detail['loc']))}",
                    what=detail["msg"],
                    next_step="`--set KEY=VALUE` for each option that the driver needs",
                )
                for detail in separate_errors(error)
            ]
        ) from error
    if kind.line_kind in ("nodes", "topics"):
        line: LineSettings = pushed_line_settings(port, kind.line_kind)
    else:
        line = powered(line_settings(port, kind.line_kind == "registers"), [gauge])
    return GaugeTarget(driver, gauge, line, gauge.options.stale_after_s or STALE_AFTER_S)


def line_settings(port: PortArguments, registers: bool) -> LineSettings:
    """Settings of a Modbus line (`registers`) or of a line of bytes.

    host:port is TCP, everything else a serial port or pyserial URL, with baud rate and format. Raises
    ConfigurationError where one of them is missing or not allowed.
    """
    if not registers:
        return byte_line_settings(port)
    if address := _tcp_address(port.port):
        return _validated(ModbusTcpLine, kind="modbus_tcp", **_tcp_settings(address, port))
    keys = _serial_settings(port)
    if keys.get("kind") == "modbus_ascii":
        return _validated(ModbusAsciiLine, **keys)
    return _validated(ModbusRtuLine, **{"kind": "modbus_rtu", **keys})


def byte_line_settings(port: PortArguments) -> SerialLine | TcpLine:
    """Settings of a line of bytes, as `line_settings` makes them."""
    if address := _tcp_address(port.port):
        return _validated(TcpLine, kind="tcp", **_tcp_settings(address, port))
    return _validated(SerialLine, **{"kind": "serial", **_serial_settings(port)})


def pushed_line_settings(port: PortArguments, line_kind: LineKind) -> OpcUaLine | MqttLine:
    """Settings of a line to an OPC UA server, opc.tcp://host:port/path, or to an MQTT broker, host:port.

    Raises ConfigurationError for another port.
    """
    keys = {"timeout_s": port.timeout_s, **_assigned("--line", port.keys, "user=compd")}
    if line_kind == "nodes":
        return _validated(OpcUaLine, kind="opc_ua", endpoint=port.port, **keys)
    address = _tcp_address(port.port)
    if address is None:
        raise ConfigurationError(
            Problem(where="--port", what="is no broker", value=port.port, allowed="host:port, such as 192.168.1.9:1883")
        )
    return _validated(MqttLine, kind="mqtt", host=address[0], port=address[1], **keys)


def _assigned(option: str, assignments: Sequence[str], example: str) -> dict[str, Any]:
    """The data of KEY=VALUE. ConfigurationError for an assignment that is none."""
    data = {}
    for assignment in assignments:
        key, equals, value = assignment.partition("=")
        if not equals:
            raise ConfigurationError(
                Problem(where=option, what="is not KEY=VALUE", value=assignment, allowed=f"{option} {example}")
            )
        data[key], _ = parse_yaml(value, Path(f"{option} {key}"))
    return data


def _tcp_settings(address: tuple[str, int], port: PortArguments) -> dict[str, Any]:
    keys = _assigned("--line", port.keys, "pause_s=0.02")
    return {"host": address[0], "port": address[1], "timeout_s": port.timeout_s, **keys}


def _tcp_address(port: str) -> tuple[str, int] | None:
    host, colon, number = port.rpartition(":")
    return (host, int(number)) if colon and number.isdigit() and "/" not in port else None


def _serial_settings(port: PortArguments) -> dict[str, Any]:
    if port.baud is None or port.format is None:
        raise ConfigurationError(
            Problem(
                where="--baud, --format",
                what="a serial port needs both",
                value=port.port,
                allowed="--baud 9600 --format 7E2",
                next_step="look them up in the device's manual; they differ from device to device",
            )
        )
    keys = _assigned("--line", port.keys, "echo=true")
    return {"port": port.port, "baud": port.baud, "format": port.format, "timeout_s": port.timeout_s, **keys}


def _validated(settings: type[SettingsT], **data: Any) -> SettingsT:
    try:
        return settings.model_validate(data)
    except ValidationError as error:
        raise ConfigurationError(
            [
                Problem(
                    where=f"--{'.'.join(map(str, detail['loc'])) or 'line'}",
                    what=detail["msg"],
                    value=str(detail["input"]) if detail["loc"] else "",
                )
                for detail in separate_errors(error)
            ]
        ) from error


# Called with ">" and the bytes that were sent, "<" and the bytes that were received.
ByteListener = Callable[[str, bytes], None]


class TappedPort:
    """A port that shows every byte to a listener."""

    def __init__(self, port: Port, listener: ByteListener) -> None:
        self.character_s = port.character_s
        self._port = port
        self._listener = listener

    def read(self, timeout_s: float) -> bytes:
        data = self._port.read(timeout_s)
        if data:
            self._listener("<", data)
        return data

    def write(self, data: bytes) -> None:
        self._listener(">", data)
        self._port.write(data)

    def set_dtr(self, high: bool) -> None:
        self._port.set_dtr(high)

    def set_break(self, on: bool) -> None:
        self._port.set_break(on)

    def close(self) -> None:
        self._port.close()


class TappedPushedLine:
    """A line that speaks by itself, of which every message is shown to a listener."""

    def __init__(self, line: PushedLine, listener: ByteListener) -> None:
        self._line = line
        self._listener = listener

    def subscribe(self, addresses: Sequence[str]) -> None:
        self._line.subscribe(addresses)

    def messages(self, timeout_s: float | None = None) -> Sequence[Message]:
        messages = self._line.messages(timeout_s)
        for message in messages:
            sent = message.payload if isinstance(message.payload, bytes) else str(message.payload).encode()
            self._listener("<", message.address.encode() + b" " + sent)
        return messages


def open_tapped_line(settings: LineSettings, clock: Clock, listener: ByteListener) -> Line:
    """The line as the daemon opens it, with its bytes shown (but for Modbus TCP, OPC UA and MQTT)."""
    return open_line(settings, clock, lambda port: TappedPort(port, listener))


def open_tapped_stream(
    settings: SerialLine | ModbusRtuLine | TcpLine, clock: Clock, listener: ByteListener
) -> StreamLine:
    """The byte stream of a line, with its bytes shown, whatever protocol runs over it."""
    return open_stream(settings, clock, lambda port: TappedPort(port, listener))


def read_gauge(target: GaugeTarget, clock: Clock, listener: ByteListener) -> Sequence[Reading]:
    """One poll on a line that is opened for it and closed again, with its bytes shown. Raises LineFault."""
    line: Any = open_tapped_line(target.line, clock, listener)
    try:
        if isinstance(target.line, PushedLineSettings):
            return target.gauge.read(TappedPushedLine(line, listener))
        return read_latched(target.gauge, line, target.line.round_trigger)
    except LineFault as fault:
        raise explained(fault, line) from fault
    finally:
        line.close()


def aged(reading: Reading, now_s: float, stale_after_s: float) -> Reading:
    """The reading, or that it is stale, as the daemon has it at the monotonic time `now_s` (s)."""
    age_s = now_s - reading.time_s
    if not reading.ok or age_s <= stale_after_s:
        return reading
    detail = f"{reading.value:.6f} was measured {_age_text(age_s)} ago; a reading counts for {stale_after_s:g} s"
    return bad(reading.time_s, Quality.STALE, detail)


def _age_text(age_s: float) -> str:
    for unit, seconds in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if age_s >= 2 * seconds:
            return f"{age_s / seconds:.3g} {unit}"
    return f"{age_s:.3g} s"


def poll_gauge(target: GaugeTarget, clock: Clock, polls: int | None) -> Iterator[Sequence[Reading]]:
    """The readings of poll after poll (`polls` of them, or for ever), as a line's thread of the daemon polls.

    After a fault the line is drained, after a loss it is opened anew; every channel then has the fault's quality.
    """
    line: Line | None = None
    never = threading.Event()
    count = 0
    try:
        while polls is None or count < polls:
            count += 1
            try:
                if line is None:
                    line = open_line(target.line, clock)
                yield read_latched(target.gauge, line, target.line.round_trigger)
            except LineFault as raised:
                fault = raised if line is None else explained(raised, line)
                yield [bad(clock.monotonic(), fault.quality, fault.detail)] * len(target.gauge.channels)
                line = _line_after_fault(line, fault)
                if line is None:
                    clock.wait(never, target.line.back_off_s[0])
    finally:
        if line is not None:
            line.close()


def _line_after_fault(line: Line | None, fault: LineFault) -> Line | None:
    """The line, drained; None when it is lost."""
    if line is None:
        return None
    if fault.quality is not Quality.LINE_LOST:
        try:
            line.drain()
        except LineFault:
            pass  # lost meanwhile
        else:
            return line
    line.close()
    return None
