"""Keys of a Modbus TCP line."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from compd.documents import Positive, Text
from compd.line_settings import HOST, ROUND_TRIGGER, NetworkPort, PolledLineSettings, TriggerWrite


class ModbusTcpLine(PolledLineSettings):
    """Modbus TCP."""

    kind: Literal["modbus_tcp"] = Field(description="Modbus TCP registers")
    host: Text = Field(description=HOST)
    port: NetworkPort = Field(default=502, description="TCP port of the device")
    gateway_wait_s: Positive | None = Field(
        default=None,
        description="how long a gateway waits for a unit on its serial bus before it serves the next request; left "
        "out: as long as `timeout_s`",
    )
    round_trigger: TriggerWrite | None = Field(default=None, description=ROUND_TRIGGER)
