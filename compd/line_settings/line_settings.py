"""Keys of a line in the configuration, as lines of every kind have them: those that are polled, those that push."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self, TypeVar

from pydantic import Field, model_validator

from compd.documents import AbsolutePath, Positive, Section, Text, refusal
from compd.gauge import Gauge
from compd.line_settings.round_trigger import TriggerBytes, TriggerWrite

NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
NetworkPort = Annotated[int, Field(ge=1, le=65535)]
BackOff = tuple[Positive, Positive]
SettingsT = TypeVar("SettingsT", bound="LineSettings")

# Waits (s) after a lost line: first and longest. A port of this computer is back as soon as it is there.
NETWORK_BACK_OFF_S, LOCAL_BACK_OFF_S = (0.5, 10.0), (0.1, 0.5)
# Descriptions of keys that several kinds have.
BACK_OFF = "wait after a lost line: first and longest, doubling between"
ECHO = "the adapter repeats every request (two-wire RS-485): take that out"
HOST = "name or address of the device or of the serial device server"
ROUND_TRIGGER = "latches all gauges of the line before each round: their readings have its time; left out: none does"


class LineSettings(Section):
    """Keys of a line. Each kind declares `kind`, a Literal, by which the configuration chooses it."""

    if TYPE_CHECKING:  # declared by each kind, in the order in which its keys are shown

        @property
        def kind(self) -> str: ...
        @property
        def timeout_s(self) -> float: ...
        @property
        def back_off_s(self) -> BackOff: ...
        @property
        def round_trigger(self) -> TriggerBytes | TriggerWrite | None: ...

    @property
    def address(self) -> str:
        """Port, address or endpoint of the other end, as a person names it."""
        keys: Any = self
        return f"{keys.host}:{keys.port}"

    def powered(self, needs: dict[str, bool]) -> Self:
        """With DTR and RTS (name -> HIGH) as gauges need them, where the line has them and its own keys say nothing."""
        return self


class PolledLineSettings(LineSettings):
    """Keys of a line whose gauges are polled."""

    timeout_s: Positive = Field(description="wait for the first byte of a reply")
    back_off_s: BackOff = Field(default=NETWORK_BACK_OFF_S, description=BACK_OFF)
    poll_every_s: NotNegative = Field(
        default=0.0, description="time from one round to the next; 0 = as fast as the line goes"
    )
    pause_s: NotNegative = Field(
        default=0.0, description="from a reply to the next request, for devices that are deaf after a reply"
    )


class PushedLineSettings(LineSettings):
    """Keys of a line on which the devices speak by themselves."""

    # Devices that push their values cannot be told to latch.
    round_trigger: ClassVar[None] = None
    # The key of the line, or else of the gauge, that says how often a new value comes.
    period_key: ClassVar[str] = "period_s"

    timeout_s: Positive = Field(description="how long the other end may take to accept a connection, or to answer")
    back_off_s: BackOff = Field(default=NETWORK_BACK_OFF_S, description=BACK_OFF)
    user: Text | None = Field(default=None, description="name for the login; omitted for none")
    password_file: AbsolutePath | None = Field(default=None, description="file with the password of `user`, one line")

    @model_validator(mode="after")
    def _password_of_a_user(self) -> Self:
        if self.password_file is not None and self.user is None:
            raise refusal("`password_file` without a `user`", "both, or none", "write `user:`")
        return self

    @property
    def longest_period_s(self) -> float | None:
        """The longest time from one value to the next, s, where the line decides it; None where the gauges do."""
        return None


def powered(line: SettingsT, gauges: Iterable[Gauge[Any]]) -> SettingsT:
    """The line with DTR and RTS as its gauges need them, unless set by its own keys."""
    return line.powered({name: high for gauge in gauges for name, high in gauge.line_needs.items()})
