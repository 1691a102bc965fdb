"""The keys of READINGS: all that one cycle computed from."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from compd.gauge import Quality, ReadingMotion
from compd.live.loop import Target
from compd.live.machine import MachineZero
from compd.live.service.message_keys.message import Keys, SentMessage, keys_of

_MotionKeys = keys_of(ReadingMotion)


class ReadingKeys(Keys):
    """One channel: its raw value, or why there is none."""

    value: float | None = Field(default=None, description="before sign and machine zero, in the channel's unit")
    time_s: float = Field(description="when the gauge was asked, s on the daemon's monotonic clock")
    quality: Quality | None = Field(default=None, description="why there is no value; absent where there is one")
    detail: str | None = Field(default=None, description="what the device sent or the line saw")
    motion: _MotionKeys | None = Field(  # type: ignore[valid-type]
        default=None, description="of a length that is good: by it `loop.extrapolate` carries the value on"
    )


class NoZeroKeys(Keys):
    """Why there is no machine zero."""

    where: str = Field(description="the file in which it was looked for")
    what: str = Field(description="what is wrong")
    next_step: str = Field(description="what a person is to do")


class ReadingsKeys(SentMessage):
    """All that one cycle computed from, with its setpoint. Numbers are not rounded; each message stands on its own."""

    wire_name = "READINGS"
    seq: int = Field(description="number of the cycle")
    time_s: float = Field(description="when the gauges were looked at, s on the daemon's monotonic clock")
    readings: dict[str, ReadingKeys] = Field(description="the reading of each channel, by its name")
    approach: list[Literal[-1, 0, 1]] | None = Field(
        default=None,
        description="direction in which each link last moved, by the scales of every cycle: 1, -1, or 0 until "
        "it has; the columns approach_1 ... of a recording",
    )
    zero: MachineZero | None = Field(default=None, description="the machine zero that was subtracted")
    no_zero: NoZeroKeys | None = Field(default=None, description="instead of `zero` where there is none")
    target: Target | None = Field(default=None, description="in mode machine_tool")
    ending: str | None = Field(default=None, description="why the correction was held, before the daemon ended")
    model: str | None = Field(default=None, description="hash of the model file that was applied")
    shadow: str | None = Field(default=None, description="hash of the model file that ran as a shadow")
    model_files: dict[str, str] | None = Field(default=None, description="paths of these files, by hash")
    carried: dict[str, Any] = Field(
        description="what the cycle had from the one before it, for replay: where Newton's method starts, the "
        "correction that stood, the last good comparators, what effects remember; arrays in base64"
    )
    setpoint: dict[str, Any] = Field(description="the SETPOINT message of this cycle")
