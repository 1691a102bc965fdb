"""Lines: the wires that gauges hang on."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from compd.configuration.section import Positive, Section, Text

Format = Annotated[str, Field(pattern=r"^[78][NEO][12]$")]


class _LineSettings(Section):
    timeout_s: Positive = Field(description="how long to wait for the first byte of a reply")
    back_off_s: tuple[Positive, Positive] = Field(
        default=(0.5, 10.0), description="wait after a lost line: first and longest, doubling between"
    )
    poll_every_s: Annotated[float, Field(ge=0, allow_inf_nan=False)] = Field(
        default=0.0, description="time from one round to the next; 0 = as fast as the line goes"
    )


class _SerialSettings(_LineSettings):
    port: Text = Field(
        description="device (prefer /dev/serial/by-id/...) or a pyserial URL (socket://host:port, rfc2217://host:port)"
    )
    baud: Annotated[int, Field(ge=50, le=4_000_000)] = Field(description="bits per second")
    format: Format = Field(description="data bits, parity, stop bits: 8N1, 7E2, ...")
    low_latency: bool = Field(default=False, description="ask the adapter not to batch bytes (FTDI batches for 16 ms)")


_HOST = "name or address of the device or of the serial device server"


class SerialLine(_SerialSettings):
    """RS-232 or RS-485: a serial port, or a pyserial URL."""

    kind: Literal["serial"] = Field(description="bytes over a serial port")


class TcpLine(_LineSettings):
    """A stream of bytes over TCP."""

    kind: Literal["tcp"] = Field(description="bytes over TCP")
    host: Text = Field(description=_HOST)
    port: Annotated[int, Field(ge=1, le=65535)] = Field(description="TCP port of the device")


class ModbusRtuLine(_SerialSettings):
    """Modbus RTU on a serial port, or over TCP with port: socket://host:port."""

    kind: Literal["modbus_rtu"] = Field(description="Modbus RTU registers")


class ModbusTcpLine(_LineSettings):
    """Modbus TCP."""

    kind: Literal["modbus_tcp"] = Field(description="Modbus TCP registers")
    host: Text = Field(description=_HOST)
    port: Annotated[int, Field(ge=1, le=65535)] = Field(default=502, description="TCP port of the device")


LineSettings = Annotated[SerialLine | TcpLine | ModbusRtuLine | ModbusTcpLine, Field(discriminator="kind")]
