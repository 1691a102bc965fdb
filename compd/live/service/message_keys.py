"""The keys of the messages that the daemon sends, with meaning and unit: one model per message.

The models are the reference of the protocol; nothing that is sent passes through them. SETPOINT and READINGS are
written once per cycle, and are made by `Setpoint.to_json` and `ReadingsMessage.line` directly; tests hold every message
to its model, so that no key is sent that is not described here. A key with a default is absent where it is not known.
What a client sends, and answers that belong to one request alone, are described in `compd.live.service.requests`.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field

from compd.gauge import Quality
from compd.live.loop.setpoint import Mode
from compd.live.loop.states import State
from compd.live.service.messages import ErrorCode

Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Links = Annotated[list[float], Field(min_length=3, max_length=6)]


class Keys(BaseModel):
    """Base of every part of a message."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class SentMessage(Keys):
    """Base of all messages that the daemon sends. wire_name : the message's "class"."""

    wire_name: ClassVar[str]


class VersionKeys(SentMessage):
    """Greets every client, and answers VERSION."""

    wire_name = "VERSION"
    protocol: int = Field(description="version of this protocol; a client ignores keys that it does not know")
    release: str = Field(description="version of compd")
    machine: str = Field(description="the machine's name in the configuration")
    config_hash: str = Field(description="hash of the whole configuration, hexadecimal")
    links: int = Field(description="number of links: 3 or 6")


class ErrorKeys(SentMessage):
    """A request that could not be followed; the connection stays open, except after too_many_clients."""

    wire_name = "ERROR"
    code: ErrorCode = Field(description="what was wrong, for a program")
    text: str = Field(description="what was wrong, for a person")


class ModelSummaryKeys(Keys):
    """One model."""

    effects: list[str] = Field(description="ids of the effects that are computed")
    not_live: list[str] | None = Field(default=None, description="ids of effects at the reference, not computed")
    model: str | None = Field(default=None, description="hash of its file; absent without effects")
    file: str | None = Field(default=None, description="path of its file; absent without effects, and from STATUS")


class ModelsKeys(Keys):
    """The models that the daemon runs with."""

    applied: ModelSummaryKeys | None = Field(default=None, description="the model whose correction is applied")
    shadow: ModelSummaryKeys | None = Field(default=None, description="a model that is computed and not applied")


class FrameKeys(Keys):
    """The frame of the base platform, {B}."""

    origin_M_mm: Vector = Field(description="its origin in {M}, mm")
    displacement_M_mm: Vector = Field(description="displacement of its origin since machine zero, mm")
    rotation_M_rad: Vector = Field(description="rotation vector since machine zero, rad")


class ShadowKeys(Keys):
    """What the shadow model asks for in this cycle. Nothing of it is applied."""

    model: str = Field(description="hash of its file")
    reason: str = Field(description='why it has no numbers; "" when it has')
    correction_mm: Links | None = Field(default=None, description="correction of each link before limits, mm")
    tip_M_mm: Vector | None = Field(default=None, description="the tip in {M}, mm")
    tip_P_mm: Vector | None = Field(default=None, description="tool on the plate: the touched place in {P}, mm")


class SetpointKeys(SentMessage):
    """The result of one cycle. All keys below `age_s` are absent unless `valid` is true."""

    wire_name = "SETPOINT"
    seq: int = Field(description="number of the cycle; a gap is a missed cycle, a lower rate or a dropped message")
    time_s: float = Field(description="when the gauges were looked at, s on the daemon's monotonic clock")
    valid: bool = Field(description="false: use nothing of this message")
    state: State = Field(description="how the setpoint came about")
    reason: str = Field(description='why the state is not ok; "" when it is')
    valid_until: float = Field(description="not to be used later than this, s; time_s itself when it is not valid")
    mode: Mode = Field(description="cmm: the scales give the tip; machine_tool: a TARGET does")
    model: str | None = Field(
        default=None, description="hash of the model file that is applied; absent without effects"
    )
    age_s: float | None = Field(default=None, description="age of the oldest reading used, s")
    tip_M_mm: Vector | None = Field(default=None, description="the tip in {M}, the surface plate, mm")
    tip_B0_mm: Vector | None = Field(default=None, description="the tip in {B0}, the base platform at machine zero, mm")
    tip_P_mm: Vector | None = Field(default=None, description="tool on the plate: the touched place in {P}, mm")
    frame: FrameKeys | None = None
    link_length_mm: Links | None = Field(
        default=None, description="of each link, measured or (machine_tool) needed, mm"
    )
    scale_setpoint_mm: Links | None = Field(
        default=None, description="what each scale is to show, from machine zero, mm: command the drives with this"
    )
    correction_mm: Links | None = Field(
        default=None, description="what was added to each link's uncompensated command, within its limits, mm"
    )
    sources_mm: dict[str, Links] | None = Field(
        default=None, description="what joints, frame and each effect ask for, before limits, for each link, mm"
    )
    u_tip_um: Vector | None = Field(
        default=None, description="standard uncertainty of the tip in {M} (tool on the plate: in {P}), um"
    )
    shadow: ShadowKeys | None = None


class ReadingKeys(Keys):
    """One channel: its raw value, or why there is none."""

    value: float | None = Field(default=None, description="before sign and machine zero, in the channel's unit")
    time_s: float = Field(description="when the gauge was asked, s on the daemon's monotonic clock")
    quality: Quality | None = Field(default=None, description="why there is no value; absent where there is one")
    detail: str | None = Field(default=None, description="what the device sent or the line saw")


class ZeroFileKeys(Keys):
    """The machine zero of a cycle."""

    zero_hash: str = Field(description="hash of the geometry, gauges and wiring that it belongs to")
    taken_at: str = Field(description="when, UTC, ISO 8601")
    readings_mm: dict[str, float] = Field(description="mean raw reading of every length gauge, by channel, mm")


class NoZeroKeys(Keys):
    """Why there is no machine zero."""

    where: str
    what: str
    next_step: str


class RecordedTargetKeys(Keys):
    """The controller's target."""

    tip_mm: Vector = Field(description="the tip in {B0}, with the tool on the plate in {P}, mm")
    rotation_B0_rad: Vector | None = Field(default=None, description="rotation vector of {P} in {B0}, rad")


class ReadingsKeys(SentMessage):
    """All that one cycle computed from, with its setpoint. Numbers are not rounded; each message stands on its own."""

    wire_name = "READINGS"
    seq: int = Field(description="number of the cycle")
    time_s: float = Field(description="when the gauges were looked at, s on the daemon's monotonic clock")
    readings: dict[str, ReadingKeys] = Field(description="by channel")
    approach: list[Literal[-1, 0, 1]] | None = Field(
        default=None, description="direction in which each link last moved; 0 until it has"
    )
    zero: ZeroFileKeys | None = None
    no_zero: NoZeroKeys | None = Field(default=None, description="instead of `zero` where there is none")
    target: RecordedTargetKeys | None = Field(default=None, description="in mode machine_tool")
    model: str | None = Field(default=None, description="hash of the model file that was applied")
    shadow: str | None = Field(default=None, description="hash of the model file that ran as a shadow")
    model_files: dict[str, str] | None = Field(default=None, description="paths of these files, by hash")
    carried: dict[str, Any] = Field(description="the state from the cycle before, for replay; arrays in base64")
    setpoint: dict[str, Any] = Field(description="the SETPOINT message of this cycle")


class ZeroStatusKeys(Keys):
    """Whether there is a machine zero."""

    taken: bool
    taken_at: str | None = Field(default=None, description="when, UTC, ISO 8601")
    reason: str | None = Field(default=None, description="why there is none")


class LoopStatusKeys(Keys):
    """The loop's timing since its start."""

    rate_hz: float = Field(description="configured rate, Hz")
    cycles: int
    missed_cycles: int = Field(description="cycles that were skipped because one before them took too long")
    period_mean_ms: float | None = Field(default=None, description="mean period, ms")
    period_deviation_ms: float | None = Field(default=None, description="standard deviation of the period, ms")
    lateness_median_us: float | None = Field(default=None, description="start of a cycle after its time, us")
    lateness_p99_us: float | None = Field(default=None, description="likewise, 99th percentile, us")
    lateness_largest_us: float | None = Field(default=None, description="likewise, largest, us")
    cycle_median_us: float | None = Field(default=None, description="duration of a cycle, us")
    cycle_p99_us: float | None = Field(default=None, description="likewise, 99th percentile, us")
    cycle_largest_us: float | None = Field(default=None, description="likewise, largest, us")


class PermissionKeys(Keys):
    """Whether the system granted a real-time property."""

    granted: bool
    detail: str = Field(description="what the system said")


class PublisherStatusKeys(Keys):
    """The sockets."""

    clients: int
    dropped_clients: int = Field(description="clients that were too far behind")
    dropped_setpoints: int = Field(description="setpoints that the publisher was too late for")
    packets_sent: int | None = Field(default=None, description="where UDP is configured")
    packets_dropped: int | None = Field(default=None, description="packets that the system did not take at once")


class GaugePollsKeys(Keys):
    """One gauge on its line."""

    quality: Quality = Field(description="of its last poll")
    polls: int
    ok: int = Field(description="polls in which every channel had a value")
    faults: dict[str, int] = Field(description="polls by quality, for every quality that occurred")
    detail: str | None = Field(default=None, description="what the device sent or the line saw")
    last_ok_s: float | None = Field(default=None, description="when every channel last had a value, s")


class LineStatusKeys(Keys):
    """One line."""

    state: Literal["opening", "open", "lost", "stopped"]
    opened: int = Field(description="how often it was opened")
    lost: int = Field(description="how often it was lost")
    detail: str | None = Field(default=None, description="why it is lost")
    round_s: float | None = Field(default=None, description="duration of the last round of polls, s")
    unexpected_bytes: int | None = Field(default=None, description="bytes that came without a request")
    gauges: dict[str, GaugePollsKeys] = Field(description="by name")


class ChannelStatusKeys(Keys):
    """One channel of a gauge."""

    channel: str = Field(description='"gauge.channel"')
    quality: Quality
    measures: str | None = Field(default=None, description="what the wiring says that it measures")
    age_s: float | None = Field(default=None, description="age of its reading, s")
    value: float | None = Field(default=None, description="raw value, before sign and machine zero, in its unit")
    detail: str | None = Field(default=None, description="what the device sent or the line saw")


class StatusKeys(VersionKeys):
    """Answers STATUS. It repeats the keys of VERSION."""

    wire_name = "STATUS"
    time_s: float = Field(description="now, s on the daemon's monotonic clock")
    mode: Mode = Field(description="cmm, or machine_tool while there is a controller")
    zero: ZeroStatusKeys
    model: ModelsKeys
    loop: LoopStatusKeys
    realtime: dict[str, PermissionKeys] = Field(description="by name: sched_fifo, locked_memory ...")
    publisher: PublisherStatusKeys
    lines: dict[str, LineStatusKeys] = Field(description="by name")
    gauges: list[ChannelStatusKeys] = Field(description="every channel of every gauge")
