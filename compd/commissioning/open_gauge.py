"""Which gauge a command means, and its line with every byte seen."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import ValidationError

from compd.clock import Clock
from compd.configuration import load as load_configuration
from compd.configuration.lines import LineSettings, ModbusRtuLine, ModbusTcpLine, SerialLine, TcpLine
from compd.errors import ConfigurationError, Problem
from compd.gauge import Gauge, LineFault, Quality, Reading, bad
from compd.lines import Line, open_line
from compd.lines.modbus_rtu import RtuMaster, gap_s
from compd.lines.open import QUIET_CHARACTERS, TCP_GAP_S
from compd.lines.port import Port, SerialPort, TcpPort
from compd.lines.stream import StreamLine
from compd.plugins import GAUGES, load

SettingsT = TypeVar("SettingsT", SerialLine, TcpLine, ModbusRtuLine, ModbusTcpLine)


@dataclass(frozen=True)
class TappedWire:
    """A port as it is given on the command line."""

    port: str
    baud: int | None
    format: str | None
    timeout_s: float


@dataclass(frozen=True)
class GaugeTarget:
    """One gauge and the line that it hangs on."""

    name: str
    gauge: Gauge[Any]
    line: LineSettings


def configured(path: Path, name: str | None) -> GaugeTarget:
    """A gauge of a configuration; ConfigurationError when it has none of that name."""
    configuration = load_configuration(path)
    if name is None or name not in configuration.gauges:
        raise ConfigurationError(
            Problem(
                where=f"{path} gauges",
                what="no such gauge" if name else "name one of its gauges",
                value=name or "",
                allowed=", ".join(configuration.gauges),
            )
        )
    options = configuration.gauges[name]
    return GaugeTarget(name, configuration.drivers[name](options), configuration.lines[options.line])


def by_driver(driver: str, wire: TappedWire, assignments: Sequence[str]) -> GaugeTarget:
    """A gauge without a configuration: its driver's name, a port, and options as KEY=VALUE (YAML)."""
    kind = load(GAUGES, driver, f"driver {driver}")
    options: dict[str, Any] = {"driver": driver, "line": "command_line"}
    for assignment in assignments:
        key, equals, value = assignment.partition("=")
        if not equals:
            raise ConfigurationError(
                Problem(where="--set", what="is not KEY=VALUE", value=assignment, allowed="--set heads=9")
            )
        options[key] = yaml.safe_load(value)
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
                for detail in error.errors(include_url=False)
            ]
        ) from error
    return GaugeTarget(driver, gauge, settings_of(wire, kind.line_kind == "registers"))


def settings_of(wire: TappedWire, registers: bool) -> LineSettings:
    """host:port is TCP, everything else a serial port or pyserial URL, with baud rate and format."""
    if not registers:
        return byte_settings_of(wire)
    if address := _address(wire.port):
        return _checked(ModbusTcpLine, kind="modbus_tcp", host=address[0], port=address[1], timeout_s=wire.timeout_s)
    return _checked(ModbusRtuLine, kind="modbus_rtu", **_serial(wire))


def byte_settings_of(wire: TappedWire) -> SerialLine | TcpLine:
    """A line of bytes."""
    if address := _address(wire.port):
        return _checked(TcpLine, kind="tcp", host=address[0], port=address[1], timeout_s=wire.timeout_s)
    return _checked(SerialLine, kind="serial", **_serial(wire))


def _address(port: str) -> tuple[str, int] | None:
    host, colon, number = port.rpartition(":")
    return (host, int(number)) if colon and number.isdigit() and "/" not in port else None


def _serial(wire: TappedWire) -> dict[str, Any]:
    if wire.baud is None or wire.format is None:
        raise ConfigurationError(
            Problem(
                where="--baud, --format",
                what="a serial port needs both",
                value=wire.port,
                allowed="--baud 9600 --format 7E2",
                next_step="look them up in the device's manual; they differ from device to device",
            )
        )
    return {"port": wire.port, "baud": wire.baud, "format": wire.format, "timeout_s": wire.timeout_s}


def _checked(settings: type[SettingsT], **data: Any) -> SettingsT:
    try:
        return settings.model_validate(data)
    except ValidationError as error:
        raise ConfigurationError(
            [
                Problem(where=f"--{detail['loc'][-1]}", what=detail["msg"], value=str(detail["input"]))
                for detail in error.errors()
            ]
        ) from error


Seen = Callable[[str, bytes], None]


class TappedPort:
    """A port whose bytes are shown: `seen(">", sent)`, `seen("<", received)`."""

    def __init__(self, port: Port, seen: Seen) -> None:
        self.character_s = port.character_s
        self._port = port
        self._seen = seen

    def read(self, timeout_s: float) -> bytes:
        data = self._port.read(timeout_s)
        if data:
            self._seen("<", data)
        return data

    def write(self, data: bytes) -> None:
        self._seen(">", data)
        self._port.write(data)

    def close(self) -> None:
        self._port.close()


def open_seen(settings: LineSettings, clock: Clock, seen: Seen) -> Line:
    """The line as the daemon opens it, with its bytes shown (Modbus TCP's are pymodbus's own: not shown)."""
    if not isinstance(settings, SerialLine | ModbusRtuLine | TcpLine):
        return open_line(settings, clock)
    stream = open_stream(settings, clock, seen)
    return RtuMaster(stream) if isinstance(settings, ModbusRtuLine) else stream


def open_stream(settings: SerialLine | ModbusRtuLine | TcpLine, clock: Clock, seen: Seen) -> StreamLine:
    """The bytes of a line, whatever speaks over them."""
    if isinstance(settings, TcpLine):
        port = TappedPort(TcpPort(settings.host, settings.port, settings.timeout_s), seen)
        return StreamLine(port, settings.timeout_s, TCP_GAP_S, clock)
    serial = SerialPort(settings.port, settings.baud, settings.format, settings.low_latency, settings.timeout_s)
    quiet_s = max(QUIET_CHARACTERS * serial.character_s, TCP_GAP_S)
    if isinstance(settings, ModbusRtuLine):
        quiet_s = max(quiet_s, gap_s(settings.baud))
    return StreamLine(TappedPort(serial, seen), settings.timeout_s, quiet_s, clock)


def polled(target: GaugeTarget, clock: Clock, polls: int | None) -> Iterator[Sequence[Reading]]:
    """Poll after poll as a line's thread does it: drained after a fault, opened anew when lost."""
    line: Line | None = None
    never = threading.Event()
    count = 0
    try:
        while polls is None or count < polls:
            count += 1
            try:
                if line is None:
                    line = open_line(target.line, clock)
                yield target.gauge.read(line)
            except LineFault as fault:
                yield [bad(clock.monotonic(), fault.quality, fault.detail)] * len(target.gauge.channels)
                line = _after(line, fault)
                if line is None:
                    clock.wait(never, target.line.back_off_s[0])
    finally:
        if line is not None:
            line.close()


def _after(line: Line | None, fault: LineFault) -> Line | None:
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
