"""The keys of READINGS: all that one cycle computed from."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from compd.gauge import Quality, ReadingMotion
from compd.live.loop import Target
from compd.live.machine import MachineZero
from compd.live.service.message_keys.message import Keys, SentMessage, absent, keys_of, present

_MotionKeys = keys_of(ReadingMotion)


class ReadingKeys(Keys):
    """One channel: its raw value, or why there is none."""

    value: float | None = absent("before sign and machine zero, in the channel's unit")
    time_s: float = present("when the gauge was asked, s on the daemon's monotonic clock")
    quality: Quality | None = absent("why there is no value; absent where there is one")
    detail: str | None = absent("what the device sent or the line saw")
    motion: _MotionKeys | None = Field(  # type: ignore[valid-type]
        default=None, description="of a length that is good: by it `loop.extrapolate` carries the value on"
    )


class NoZeroKeys(Keys):
    """Why there is no machine zero."""

    where: str = present("the file in which it was looked for")
    what: str = present("what is wrong")
    next_step: str = present("what a person is to do")


class ReadingsKeys(SentMessage):
    """All that one cycle computed from, with its setpoint. Numbers are not rounded; each message stands on its own."""

    wire_name = "READINGS"
    seq: int = present("number of the cycle")
    time_s: float = present("when the gauges were looked at, s on the daemon's monotonic clock")
    readings: dict[str, ReadingKeys] = present("the reading of each channel, by its name")
    approach: list[Literal[-1, 0, 1]] | None = absent(
        "direction in which each link last moved, by the scales of every cycle: 1, -1, or 0 until it has; the columns "
        "approach_1 ... of a recording"
    )
    zero: MachineZero | None = absent("the machine zero that was subtracted")
    no_zero: NoZeroKeys | None = absent("instead of `zero` where there is none")
    target: Target | None = absent("in mode machine_tool")
    ending: str | None = absent("why the correction was held, before the daemon ended")
    model: str | None = absent("hash of the model file that was applied")
    shadow: str | None = absent("hash of the model file that ran as a shadow")
    model_files: dict[str, str] | None = absent("paths of these files, by hash")
    carried: dict[str, Any] = present(
        "what the cycle had from the one before it, for replay: where Newton's method starts, the correction that "
        "stood, the last good comparators, what effects remember; arrays in base64"
    )
    setpoint: dict[str, Any] = present("the SETPOINT message of this cycle")
