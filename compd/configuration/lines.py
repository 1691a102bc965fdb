"""Lines: the wires of the gauges."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import Field, model_validator

from compd.configuration.pushed_lines import MqttLine, OpcUaLine, PushedLineSettings
from compd.configuration.round_trigger import TriggerBytes, TriggerWrite
from compd.configuration.section import Positive, Section, Text, refusal
from compd.gauge import MOST_SKIPPED_BYTES, Gauge, LineKind

AnyLine = TypeVar("AnyLine", bound="_LineSettings | PushedLineSettings")
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Format = Annotated[str, Field(pattern=r"^[78][NEO][12]$")]


class _LineSettings(Section):
    timeout_s: Positive = Field(description="wait for the first byte of a reply")
    back_off_s: tuple[Positive, Positive] = Field(
        default=(0.5, 10.0), description="wait after a lost line: first and longest, doubling between"
    )
    poll_every_s: NotNegative = Field(default=0.0, description="period of rounds; 0 = as fast as the line allows")
    pause_s: NotNegative = Field(
        default=0.0, description="from a reply to the next request, for devices that are deaf after a reply"
    )


_TRIGGER = "latches all gauges of the line before each round: their readings have its time; left out: none does"


class Rs485(Section):
    """RTS as the direction of a two-wire RS-485 line, for adapters without automatic switching."""

    rts_when_sending: bool = Field(default=True, description="RTS is HIGH while a request is sent, else LOW; or not")
    delay_before_s: NotNegative = Field(default=0.0, description="from the switch of RTS to the request")
    delay_after_s: NotNegative = Field(default=0.0, description="from the request's end to the switch of RTS")


_ECHO = "the adapter repeats every request (two-wire RS-485): take that out"
_URL_HAS_NONE = "a device server has these lines only behind rfc2217://host:port, and switches RS-485 itself"


class SerialPortSettings(_LineSettings):
    """A line on a serial port, or behind a pyserial URL."""

    port: Text = Field(
        description="device (prefer /dev/serial/by-id/...) or a pyserial URL (socket://host:port, rfc2217://host:port)"
    )
    baud: Annotated[int, Field(ge=50, le=4_000_000)] = Field(description="bits per second")
    format: Format = Field(description="data bits, parity, stop bits: 8N1, 7E2, ...")
    low_latency: bool | None = Field(
        default=None,
        description="false: do not ask the adapter to hold no bytes back (FTDI: up to 16 ms); left out: ask",
    )
    echo: bool = Field(default=False, description=_ECHO)
    dtr: bool | None = Field(
        default=None, description="DTR while the line is open: true is HIGH; left out: what its gauges need, else HIGH"
    )
    rts: bool | None = Field(
        default=None, description="RTS while the line is open: true is HIGH; left out: what its gauges need, else HIGH"
    )
    rs485: Rs485 | None = Field(
        default=None, description="RTS switches the direction of a two-wire line; left out: the adapter does it itself"
    )

    @model_validator(mode="after")
    def _has_these_lines(self) -> Self:
        if self.rs485 is not None and self.rts is not None:
            raise refusal("`rts` and `rs485` contradict each other", "one of them", "remove `rts`")
        url = self.port.partition("://")[0] if "://" in self.port else ""
        if self.rs485 is not None and url:
            raise refusal("`rs485` needs a port of this computer", _URL_HAS_NONE, "remove `rs485`, set it there")
        if (self.dtr is not None or self.rts is not None) and url == "socket":
            raise refusal("`dtr` and `rts` need a serial port", _URL_HAS_NONE, "remove them, or write rfc2217://")
        return self


_HOST = "name or address of the device or of the serial device server"


class SerialLine(SerialPortSettings):
    """RS-232 or RS-485: a serial port, or a pyserial URL."""

    kind: Literal["serial"] = Field(description="bytes over a serial port")
    round_trigger: TriggerBytes | None = Field(default=None, description=_TRIGGER)


class TcpLine(_LineSettings):
    """A stream of bytes over TCP."""

    kind: Literal["tcp"] = Field(description="bytes over TCP")
    host: Text = Field(description=_HOST)
    port: Annotated[int, Field(ge=1, le=65535)] = Field(description="TCP port of the device")
    echo: bool = Field(default=False, description=_ECHO)
    round_trigger: TriggerBytes | None = Field(default=None, description=_TRIGGER)


class _ModbusSerialSettings(SerialPortSettings):
    ask_one_more: bool = Field(
        default=True,
        description="ask for a register more every second time, so that a late reply has another length; a slave that "
        "refuses it, or is silent, is not asked again: switch it off for one that does worse",
    )
    round_trigger: TriggerWrite | None = Field(default=None, description=_TRIGGER)


class ModbusRtuLine(_ModbusSerialSettings):
    """Modbus RTU on a serial port, or over TCP with port: socket://host:port."""

    kind: Literal["modbus_rtu"] = Field(description="Modbus RTU registers")
    skip_bytes: Annotated[int, Field(ge=0, le=MOST_SKIPPED_BYTES)] = Field(
        default=0,
        description="most bytes before a reply from a transceiver that changes its direction: they are "
        "skipped where the checksum of the rest fits; left out: such a reply counts as damaged",
    )


class ModbusAsciiLine(_ModbusSerialSettings):
    """Modbus ASCII on a serial port, or over TCP with port: socket://host:port."""

    kind: Literal["modbus_ascii"] = Field(description="Modbus ASCII registers")


class ModbusTcpLine(_LineSettings):
    """Modbus TCP."""

    kind: Literal["modbus_tcp"] = Field(description="Modbus TCP registers")
    host: Text = Field(description=_HOST)
    port: Annotated[int, Field(ge=1, le=65535)] = Field(default=502, description="TCP port of the device")
    gateway_wait_s: Positive | None = Field(
        default=None,
        description="how long a gateway waits for a unit on its serial bus before it serves the next request; left "
        "out: as long as `timeout_s`",
    )
    round_trigger: TriggerWrite | None = Field(default=None, description=_TRIGGER)


def powered(line: AnyLine, gauges: Iterable[Gauge[Any]]) -> AnyLine:
    """The line with DTR and RTS as its gauges need them, unless set by its own keys."""
    if not isinstance(line, SerialPortSettings) or line.port.startswith("socket://"):
        return line
    needs: dict[str, bool] = {
        name: high for gauge in gauges for name, high in gauge.line_needs.items() if getattr(line, name) is None
    }
    return line.model_copy(update=needs)


PolledLine = SerialLine | TcpLine | ModbusRtuLine | ModbusAsciiLine | ModbusTcpLine
LineSettings = Annotated[PolledLine | OpcUaLine | MqttLine, Field(discriminator="kind")]
# Payload of each kind of line, as in `Gauge.line_kind`.
CARRIES: Mapping[str, LineKind] = {
    "serial": "bytes",
    "tcp": "bytes",
    "modbus_rtu": "registers",
    "modbus_ascii": "registers",
    "modbus_tcp": "registers",
    "opc_ua": "nodes",
    "mqtt": "topics",
}
