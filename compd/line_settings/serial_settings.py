"""Keys of a line on a serial port, whatever is spoken there."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from compd.documents import Section, Text, refusal
from compd.line_settings.line_settings import (
    BACK_OFF,
    ECHO,
    LOCAL_BACK_OFF_S,
    ROUND_TRIGGER,
    BackOff,
    NotNegative,
    PolledLineSettings,
)
from compd.line_settings.round_trigger import TriggerWrite

Format = Annotated[str, Field(pattern=r"^[78][NEO][12]$")]
_URL_HAS_NONE = "a device server has these lines only behind rfc2217://host:port, and switches RS-485 itself"


class Rs485(Section):
    """RTS as the direction of a two-wire RS-485 line, for adapters without automatic switching."""

    rts_when_sending: bool = Field(default=True, description="RTS is HIGH while a request is sent, else LOW; or not")
    delay_before_s: NotNegative = Field(default=0.0, description="from the switch of RTS to the request")
    delay_after_s: NotNegative = Field(default=0.0, description="from the request's end to the switch of RTS")


class SerialPortSettings(PolledLineSettings):
    """A line on a serial port, or behind a pyserial URL."""

    port: Text = Field(
        description="device (prefer /dev/serial/by-id/...) or a pyserial URL (socket://host:port, rfc2217://host:port)"
    )
    baud: Annotated[int, Field(ge=50, le=4_000_000)] = Field(description="bits per second")
    format: Format = Field(description="data bits, parity, stop bits: 8N1, 7E2, ...")
    back_off_s: BackOff = Field(default=LOCAL_BACK_OFF_S, description=BACK_OFF)
    low_latency: bool | None = Field(
        default=None,
        description="false: do not ask the adapter to hold no bytes back (FTDI: up to 16 ms); left out: ask",
    )
    echo: bool = Field(default=False, description=ECHO)
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
        url = self.port.partition("://")[0] if self.behind_url else ""
        if self.rs485 is not None and url:
            raise refusal("`rs485` needs a port of this computer", _URL_HAS_NONE, "remove `rs485`, set it there")
        if (self.dtr is not None or self.rts is not None) and url == "socket":
            raise refusal("`dtr` and `rts` need a serial port", _URL_HAS_NONE, "remove them, or write rfc2217://")
        return self

    @property
    def address(self) -> str:
        return self.port

    @property
    def behind_url(self) -> bool:
        """Whether the port is a pyserial URL, and none of this computer."""
        return "://" in self.port

    def powered(self, needs: dict[str, bool]) -> Self:
        if self.port.startswith("socket://"):
            return self
        return self.model_copy(update={name: high for name, high in needs.items() if getattr(self, name) is None})


class ModbusSerialSettings(SerialPortSettings):
    """A line on a serial port that carries Modbus registers."""

    ask_one_more: bool = Field(
        default=True,
        description="ask for a register more every second time, so that a late reply has another length; a slave that "
        "refuses it, or is silent, is not asked again: switch it off for one that does worse",
    )
    round_trigger: TriggerWrite | None = Field(default=None, description=ROUND_TRIGGER)
