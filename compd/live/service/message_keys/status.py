"""The keys of STATUS: the loop, its processes, the clients, every line and every gauge."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from compd.gauge import Quality
from compd.live.service.message_keys.message import Keys, ModelsKeys, VersionKeys
from compd.setpoint_states import Mode


class ZeroStatusKeys(Keys):
    """Whether there is a machine zero."""

    taken: bool = Field(description="whether there is one that fits this configuration")
    taken_at: str | None = Field(default=None, description="when, UTC, ISO 8601")
    reason: str | None = Field(default=None, description="why there is none")
    ports_changed: dict[str, str] | None = Field(
        default=None, description="gauges whose port is another one than when it was taken, each with both"
    )


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
    own_kinematics_median_us: float | None = Field(
        default=None,
        description="`machine: external` with a class: time of one call of its methods, us; what takes longer than a "
        "period makes cycles late",
    )
    own_kinematics_p99_us: float | None = Field(default=None, description="likewise, 99th percentile, us")
    own_kinematics_largest_us: float | None = Field(default=None, description="likewise, largest, us")
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

    name: str = Field(description='"unix" and its user, or its address and port')
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
    noise_um: float | None = Field(
        default=None, description="of a length: standard deviation of one reading, um; absent if not stated"
    )
    noise_from: str | None = Field(
        default=None, description="who states it: `configuration`, or `driver` with the source in its data sheet"
    )
    age_s: float | None = Field(default=None, description="age of its reading, s")
    value: float | None = Field(default=None, description="raw value, before sign and machine zero, in its unit")
    detail: str | None = Field(default=None, description="what the device sent or the line saw")
    scatter_um: float | None = Field(
        default=None,
        description="of a length that is good: standard deviation of one reading at rest, as measured, um; absent "
        "while it is not known",
    )
    warning: str | None = Field(
        default=None, description="what is to be looked at, of a length that is believed all the same"
    )
    needs_person: bool | None = Field(
        default=None,
        description="true where a person has to accept it: now, or when it is back, because the machine has moved "
        "since its last reading; absent otherwise",
    )


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
    waits_for_person: str | None = Field(
        default=None, description="for people: the gauges that are not believed, and what to do; absent where all are"
    )
