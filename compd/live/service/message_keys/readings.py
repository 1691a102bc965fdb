"""The keys of READINGS: all that one cycle computed from."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from compd.gauge import Quality
from compd.live.service.message_keys.message import Keys, SentMessage, Vector


class MotionKeys(Keys):
    """How what a length gauge measures moves, by its own last readings."""

    speed_mm_per_s: float = Field(description="at the time of the reading; 0 where it does not move, or not steadily")
    braking_mm_per_s2: float = Field(description="by how much the size of the speed falls; 0 where it does not brake")
    u_mm_per_s: float | None = Field(
        default=None, description="standard uncertainty of the speed; absent while it is not known"
    )
    horizon_s: float = Field(description="time after the reading for which the motion is assumed to go on, s")
    mean_mm_per_s: float | None = Field(default=None, description="mean speed over the last `window_s`")
    window_s: float | None = Field(default=None, description="how long before the reading that window begins, s")
    due_s: float | None = Field(default=None, description="latest time of the next reading after this one, s")
    scatter_mm: float | None = Field(
        default=None,
        description="standard deviation of one reading at rest, as the last ones show it; absent while it is not known",
    )
    rest_s: float | None = Field(default=None, description="time without motion in the readings, s, up to some seconds")
    late_s: float | None = Field(
        default=None, description="by how much later than the reading's time the device may have sampled, s"
    )


class ReadingKeys(Keys):
    """One channel: its raw value, or why there is none."""

    value: float | None = Field(default=None, description="before sign and machine zero, in the channel's unit")
    time_s: float = Field(description="when the gauge was asked, s on the daemon's monotonic clock")
    quality: Quality | None = Field(default=None, description="why there is no value; absent where there is one")
    detail: str | None = Field(default=None, description="what the device sent or the line saw")
    motion: MotionKeys | None = Field(
        default=None, description="of a length that is good: by it `loop.extrapolate` carries the value on"
    )


class ZeroFileKeys(Keys):
    """The machine zero of a cycle."""

    zero_hash: str = Field(description="hash of the geometry, gauges and wiring that it belongs to")
    taken_at: str = Field(description="when, UTC, ISO 8601")
    readings_mm: dict[str, float] = Field(description="mean raw reading of every length gauge, by channel, mm")
    quantities: dict[str, float] | None = Field(
        default=None, description="mean of every other quantity that could be read, by name: from these effects count"
    )


class NoZeroKeys(Keys):
    """Why there is no machine zero."""

    where: str = Field(description="the file in which it was looked for")
    what: str = Field(description="what is wrong")
    next_step: str = Field(description="what a person is to do")


class RecordedTargetKeys(Keys):
    """The controller's target."""

    tip_mm: Vector = Field(description="the tip in {B0}, with the tool on the plate in {P}, mm")
    rotation_B0_rad: Vector | None = Field(default=None, description="rotation vector of {P} in {B0}, rad")
    valid_until_s: float | None = Field(
        default=None, description="after this it is too old, s on the daemon's monotonic clock; absent: never"
    )
    time_s: float | None = Field(
        default=None, description="when it was made or came, s on the daemon's monotonic clock"
    )
    id: int | None = Field(default=None, description="as in `TARGET`")


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
    zero: ZeroFileKeys | None = Field(default=None, description="the machine zero that was subtracted")
    no_zero: NoZeroKeys | None = Field(default=None, description="instead of `zero` where there is none")
    target: RecordedTargetKeys | None = Field(default=None, description="in mode machine_tool")
    ending: str | None = Field(default=None, description="why the correction was held, before the daemon ended")
    model: str | None = Field(default=None, description="hash of the model file that was applied")
    shadow: str | None = Field(default=None, description="hash of the model file that ran as a shadow")
    model_files: dict[str, str] | None = Field(default=None, description="paths of these files, by hash")
    carried: dict[str, Any] = Field(
        description="what the cycle had from the one before it, for replay: where Newton's method starts, the "
        "correction that stood, the last good comparators, what effects remember; arrays in base64"
    )
    setpoint: dict[str, Any] = Field(description="the SETPOINT message of this cycle")
