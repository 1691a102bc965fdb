"""The keys of the messages that the daemon sends, with meaning and unit: one model per message.

The models are the reference of the protocol; nothing that is sent passes through them. SETPOINT and READINGS are
written once per cycle, and are made by `Setpoint.to_json` and `ReadingsMessage.line` directly; tests hold every message
to its model, so that no key is sent that is not described here. A key with a default is absent where it is not known.
What a client sends, and answers that belong to one request alone, are described in `client_requests` and
`local_requests`.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field

from compd.gauge import Quality
from compd.live.loop.states import Mode, State
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
    displacement_M_mm: Vector = Field(description="displacement of its origin since machine zero, in {M}, mm")
    rotation_M_rad: Vector = Field(description="its rotation since machine zero, as a rotation vector in {M}, rad")


class ShadowKeys(Keys):
    """What the shadow model asks for in this cycle. Nothing of it is applied."""

    model: str = Field(description="hash of its file")
    reason: str = Field(description='why it has no numbers; "" when it has')
    correction_mm: Links | None = Field(default=None, description="correction of each link before limits, mm")
    tip_M_mm: Vector | None = Field(default=None, description="the tip in {M}, mm")
    tip_P_mm: Vector | None = Field(default=None, description="tool on the plate: the touched place in {P}, mm")


class SetpointKeys(SentMessage):
    """The result of one cycle. Where `valid` is false, no key is there that holds a value a controller could use.

    In mode `cmm` the uncompensated command is what the scales show, and `correction_mm` is what would have to be added
    to bring the tip to where the scales alone believe it to be. While a correction is clamped or slews to that of a
    newly adopted model, the tip in mode `cmm` is the one that belongs to the correction which is applied.

    While setpoints are invalid the last correction is remembered, and the next valid one slews from it: hold your last
    command meanwhile.
    """

    wire_name = "SETPOINT"
    seq: int = Field(
        description="number of the cycle, which rises by one per period; a gap is a missed cycle, a lower rate or a "
        "dropped message"
    )
    time_s: float = Field(description="when the gauges were looked at, s on the daemon's monotonic clock")
    valid: bool = Field(description="false: use nothing of this message; from `tip_M_mm` on every key is absent")
    state: State = Field(description="how the setpoint came about")
    reason: str = Field(description='why the state is not `ok`, for a person; "" when it is')
    valid_until: float = Field(description="not to be used later than this, s; `time_s` itself when it is not valid")
    mode: Mode = Field(description="cmm: the scales say where the tip is; machine_tool: a `TARGET` does")
    model: str | None = Field(
        default=None, description="hash of the model file that is applied; absent without effects"
    )
    age_s: float | None = Field(default=None, description="age of the oldest reading used, s")
    skew_s: float | None = Field(
        default=None,
        description="how much later than the oldest the newest length that was used was measured, s; absent where none "
        "was. `loop.skew_s` limits it",
    )
    tip_M_mm: Vector | None = Field(
        default=None,
        description="the tip in {M}, the surface plate, mm; in mode cmm measured, in mode machine_tool the target, "
        "which is reached in state ok",
    )
    tip_B0_mm: Vector | None = Field(default=None, description="the tip in {B0}, the base platform at machine zero, mm")
    tip_P_mm: Vector | None = Field(default=None, description="tool on the plate: the touched place in {P}, mm")
    frame: FrameKeys | None = Field(default=None, description="where the base platform is, and how it has moved")
    link_length_mm: Links | None = Field(
        default=None, description="length of each link, mm: measured (cmm) or needed (machine_tool)"
    )
    scale_setpoint_mm: Links | None = Field(
        default=None, description="what each scale is to show, from machine zero, mm: command the drives with this"
    )
    correction_mm: Links | None = Field(
        default=None,
        description="what was added to each link's uncompensated command, within its limits, mm; "
        "`scale_setpoint_mm - correction_mm` is that command",
    )
    sources_mm: dict[str, Links] | None = Field(
        default=None,
        description="how much each cause asks for, for each link, mm: `joints`, `frame`, then by its id what each "
        "effect adds to those before it; their sum is the correction before its limits",
    )
    u_tip_um: Vector | None = Field(
        default=None,
        description="standard uncertainty of the tip in x, y, z of {M}, um, with the tool on the plate that of "
        "`tip_P_mm`: to first order, from the gauges' noise and the errors of the fitted parameters, computed anew "
        "once a second, and from the age of each length and how surely its motion is known, in every cycle; absent "
        "while any of them is not known",
    )
    shadow: ShadowKeys | None = Field(
        default=None, description="what the shadow model asks for in this cycle; absent without a shadow"
    )


class MotionKeys(Keys):
    """How what a length gauge measures moves, by its own last readings."""

    speed_mm_per_s: float = Field(description="at the time of the reading; 0 where it does not move, or not steadily")
    braking_mm_per_s2: float = Field(description="by how much the size of the speed falls; 0 where it does not brake")
    u_mm_per_s: float | None = Field(
        default=None, description="standard uncertainty of the speed; absent while it is not known"
    )
    horizon_s: float = Field(description="for so long after the reading the motion is taken to go on, s")


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


class ZeroStatusKeys(Keys):
    """Whether there is a machine zero."""

    taken: bool = Field(description="whether there is one that fits this configuration")
    taken_at: str | None = Field(default=None, description="when, UTC, ISO 8601")
    reason: str | None = Field(default=None, description="why there is none")


class LoopStatusKeys(Keys):
    """The loop's timing since its start."""

    rate_hz: float = Field(description="configured rate, Hz")
    cycles: int = Field(description="cycles that were computed")
    missed_cycles: int = Field(
        description="cycles that were skipped because one before them took too long, or because there was no loop"
    )
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

    granted: bool = Field(description="whether the daemon has it")
    detail: str = Field(description="what the system said")


class ProcessStatusKeys(Keys):
    """One of the daemon's processes."""

    pid: int = Field(description="its number; 0 while it is not there")
    starts: int = Field(description="how often it was started; the loop also for every model that was adopted")
    last_end: str | None = Field(default=None, description="how the last one ended; absent where none has")


class ConnectedClientKeys(Keys):
    """One client."""

    name: str = Field(description='"unix", or its address and port')
    user: int | None = Field(default=None, description="over the Unix socket, the number of its user")
    connected_s: float = Field(description="since when, s on the daemon's monotonic clock")
    controller: bool = Field(description="whether its `TARGET` counts")
    watches: Literal["setpoints", "readings"] | None = Field(default=None, description="absent where it watches none")


class PublisherStatusKeys(Keys):
    """The sockets."""

    clients: int = Field(description="clients that are connected")
    connected: list[ConnectedClientKeys] = Field(description="who they are, the longest connected first")
    dropped_clients: int = Field(description="clients that were too far behind")
    dropped_setpoints: int = Field(description="setpoints that the publisher was too late for")
    packets_sent: int | None = Field(default=None, description="where UDP is configured")
    packets_dropped: int | None = Field(default=None, description="packets that the system did not take at once")


class GaugePollsKeys(Keys):
    """One gauge on its line."""

    quality: Quality = Field(description="of its last poll")
    polls: int = Field(description="how often it was asked")
    ok: int = Field(description="polls in which every channel had a value")
    faults: dict[str, int] = Field(description="polls by quality, for every quality that occurred")
    detail: str | None = Field(default=None, description="what the device sent or the line saw")
    last_ok_s: float | None = Field(default=None, description="when every channel last had a value, s")


class LineStatusKeys(Keys):
    """One line."""

    state: Literal["opening", "open", "lost", "stopped"] = Field(description="of its port")
    opened: int = Field(description="how often it was opened")
    lost: int = Field(description="how often it was lost")
    detail: str | None = Field(default=None, description="why it is lost")
    round_s: float | None = Field(default=None, description="duration of the last round of polls, s")
    unexpected_bytes: int | None = Field(default=None, description="bytes that came without a request")
    gauges: dict[str, GaugePollsKeys] = Field(description="the gauges on it, by name")


class ChannelStatusKeys(Keys):
    """One channel of a gauge."""

    channel: str = Field(description='"gauge.channel"')
    quality: Quality = Field(description="`ok`, or why there is no value")
    measures: str | None = Field(default=None, description="what the wiring says that it measures")
    age_s: float | None = Field(default=None, description="age of its reading, s")
    value: float | None = Field(default=None, description="raw value, before sign and machine zero, in its unit")
    detail: str | None = Field(default=None, description="what the device sent or the line saw")


class WiredChannelKeys(Keys):
    """What one channel measures."""

    kind: Literal["scale", "joint", "frame", "quantity"] = Field(description="of what is measured")
    channel: str = Field(description='"gauge.channel", as in READINGS and STATUS')
    sign: Literal[1, -1] = Field(description="-1 where the display falls as the length grows")
    stale_after_s: float = Field(description="a reading older than this is stale, s")
    link: int | None = Field(default=None, description="of a scale or a joint: the link, counted from 1")
    role: Literal["S", "Ra", "Rb", "B"] | None = Field(default=None, description="of a joint, as in the configuration")
    distance: str | None = Field(default=None, description="of the frame: t1 to t3, u1 to u6")
    name: str | None = Field(default=None, description="of a quantity, with its unit")


class MachineLoopKeys(Keys):
    """The loop, as in the section `loop` of the configuration."""

    rate_hz: float = Field(description="cycles per second")
    stale_after_s: float = Field(description="a reading older than this is stale, unless its gauge says otherwise, s")
    on_stale: Literal["hold", "fade", "degrade", "stop"] = Field(description="what happens without a comparator")
    hold_s: float = Field(description="for how long at most, s")


class MachineLimitKeys(Keys):
    """Of the correction of each link, as in the section `limits` of the configuration."""

    correction_mm: float = Field(description="largest, to either side, mm")
    slew_mm_per_s: float = Field(description="fastest change, mm/s")
    on_limit: Literal["clamp", "refuse"] = Field(description="what happens beyond them")


class MachineKeys(SentMessage):
    """Answers MACHINE: what a client needs to draw the machine and to know its limits."""

    wire_name = "MACHINE"
    machine: str = Field(description="the machine's name in the configuration")
    config_hash: str = Field(description="hash of the whole configuration, hexadecimal; another one: ask again")
    geometry: dict[str, Any] = Field(description="the section `geometry` of the configuration, with the same keys")
    limits: MachineLimitKeys = Field(description="what a correction may be")
    loop: MachineLoopKeys = Field(description="how the loop runs")
    wiring: list[WiredChannelKeys] = Field(description="what each channel measures: scales, joints, frame, quantities")


class PlatformKeys(Keys):
    """The moving platform."""

    origin_M_mm: Vector = Field(description="origin of {P} in {M}, mm")
    rotation_M_rad: Vector = Field(description="rotation vector of {P} in {M}, rad")
    joints_M_mm: list[Vector] = Field(description="the platform joint of each link, in {M}, mm")


class BudgetKeys(SentMessage):
    """Answers BUDGET. Where `valid` is false there is no number."""

    wire_name = "BUDGET"
    valid: bool = Field(description="whether the newest setpoint is")
    reason: str = Field(description='why its state is not `ok`; "" when it is')
    seq: int | None = Field(default=None, description="number of the cycle; absent before the first")
    time_s: float | None = Field(default=None, description="of the setpoint, s on the daemon's monotonic clock")
    state: State | None = Field(default=None, description="of the setpoint")
    tip_um: dict[str, Vector] | None = Field(
        default=None,
        description="how far each cause has moved the tip, in x, y, z of {M}, um: `joints`, `frame`, then each effect "
        "by its id; to first order, before the limits. With the tool on the plate: the touched place, in {P}",
    )
    shadow_tip_um: Vector | None = Field(
        default=None,
        description="how far the shadow model has all causes together move the tip, um: beside the sum of `tip_um`; "
        "absent without a shadow, and while it has no numbers",
    )
    supports_M_mm: list[Vector] | None = Field(default=None, description="b1, b2, b3 of the base platform, in {M}, mm")
    supports_moved_um: list[Vector] | None = Field(default=None, description="how far since machine zero, um")
    base_joints_M_mm: list[Vector] | None = Field(default=None, description="the base joint of each link, in {M}, mm")
    platform: PlatformKeys | None = Field(default=None, description="where the moving platform is")


class StatusKeys(VersionKeys):
    """Answers STATUS. It repeats the keys of VERSION."""

    wire_name = "STATUS"
    time_s: float = Field(description="now, s on the daemon's monotonic clock")
    mode: Mode = Field(description="cmm, or machine_tool while there is a controller")
    zero: ZeroStatusKeys = Field(description="whether there is a machine zero")
    model: ModelsKeys = Field(description="the models that it runs with, without the paths of their files")
    loop: LoopStatusKeys = Field(description="how well the loop keeps time")
    realtime: dict[str, PermissionKeys] = Field(
        description="what the loop asked the system for, by name: `sched_fifo`, `locked_memory` ..."
    )
    processes: dict[str, ProcessStatusKeys] = Field(
        description="the daemon's processes: `supervisor`, `loop`, `acquisition`, `service`, and `line` with its name "
        "for each line of `acquisition.own_process`"
    )
    publisher: PublisherStatusKeys = Field(description="the clients")
    skew_s: float | None = Field(
        default=None,
        description="how much later than the oldest the newest length that is good now was measured, s; absent where "
        "none is",
    )
    lines: dict[str, LineStatusKeys] = Field(description="every line, by name")
    gauges: list[ChannelStatusKeys] = Field(description="every channel of every gauge")
