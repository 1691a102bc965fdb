"""Keys of a line of bytes over TCP."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from compd.documents import Text
from compd.line_settings import ECHO, HOST, ROUND_TRIGGER, NetworkPort, PolledLineSettings, TriggerBytes


class TcpLine(PolledLineSettings):
    """A stream of bytes over TCP."""

    kind: Literal["tcp"] = Field(description="bytes over TCP")
    host: Text = Field(description=HOST)
    port: NetworkPort = Field(description="TCP port of the device")
    echo: bool = Field(default=False, description=ECHO)
    round_trigger: TriggerBytes | None = Field(default=None, description=ROUND_TRIGGER)
