"""Keys of a Modbus ASCII line."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from compd.line_settings import ModbusSerialSettings


class ModbusAsciiLine(ModbusSerialSettings):
    """Modbus ASCII on a serial port, or over TCP with port: socket://host:port."""

    kind: Literal["modbus_ascii"] = Field(description="Modbus ASCII registers")
