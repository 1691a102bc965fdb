"""Keys of a line of bytes on a serial port."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from compd.line_settings import ROUND_TRIGGER, SerialPortSettings, TriggerBytes


class SerialLine(SerialPortSettings):
    """RS-232 or RS-485: a serial port, or a pyserial URL."""

    kind: Literal["serial"] = Field(description="bytes over a serial port")
    round_trigger: TriggerBytes | None = Field(default=None, description=ROUND_TRIGGER)
