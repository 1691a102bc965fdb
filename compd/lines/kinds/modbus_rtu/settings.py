"""Keys of a Modbus RTU line."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from compd.gauge import MAX_SKIPPED_BYTES
from compd.line_settings import ModbusSerialSettings


class ModbusRtuLine(ModbusSerialSettings):
    """Modbus RTU on a serial port, or over TCP with port: socket://host:port."""

    kind: Literal["modbus_rtu"] = Field(description="Modbus RTU registers")
    skip_bytes: Annotated[int, Field(ge=0, le=MAX_SKIPPED_BYTES)] = Field(
        default=0,
        description="most bytes before a reply from a transceiver that changes its direction: they are "
        "skipped where the checksum of the rest fits; left out: such a reply counts as damaged",
    )
