"""The keys of STATUS: the loop, its processes, the clients, every line and every gauge."""

from __future__ import annotations

from typing import Literal

from compd.gauge import Quality
from compd.live.service.message_keys.message import Keys, ModelsKeys, VersionKeys, absent, present
from compd.setpoint_states import Mode


class ZeroStatusKeys(Keys):
    """Whether there is a machine zero."""

    taken: bool = present("whether there is one that fits this configuration")
    taken_at: str | None = absent("when, UTC, ISO 8601")
    reason: str | None = absent("why there is none")
    ports_changed: dict[str, str] | None = absent(
        "gauges whose port is another one than when it was taken, each with both"
    )


class LoopStatusKeys(Keys):
    """The loop's timing since its start."""

    rate_hz: float = present("configured rate, Hz")
    cycles: int = present("cycles that were computed")
    missed_cycles: int = present(
        "cycles that were skipped because one before them took too long, or because there was no loop"
    )
    period_mean_ms: float | None = absent("mean period, ms")
    period_deviation_ms: float | None = absent("standard deviation of the period, ms")
    lateness_median_us: float | None = absent("start of a cycle after its time, us")
    lateness_p99_us: float | None = absent("likewise, 99th percentile, us")
    lateness_largest_us: float | None = absent("likewise, largest, us")
    own_kinematics_median_us: float | None = absent(
        "`machine: external` with a class: time of one call of its methods, us; what takes longer than a period makes "
        "cycles late"
    )
    own_kinematics_p99_us: float | None = absent("likewise, 99th percentile, us")
    own_kinematics_largest_us: float | None = absent("likewise, largest, us")
    cycle_median_us: float | None = absent("duration of a cycle, us")
    cycle_p99_us: float | None = absent("likewise, 99th percentile, us")
    cycle_largest_us: float | None = absent("likewise, largest, us")


class PermissionKeys(Keys):
    """Whether the system granted a real-time property."""

    granted: bool = present("whether the daemon has it")
    detail: str = present("what the system said")


class ProcessStatusKeys(Keys):
    """One of the daemon's processes."""

    pid: int = present("its number; 0 while it is not there")
    starts: int = present("how often it was started; the loop also for every model that was adopted")
    last_end: str | None = absent("how the last one ended; absent where none has")


class ConnectedClientKeys(Keys):
    """One client."""

    name: str = present('"unix" and its user, or its address and port')
    user: int | None = absent("over the Unix socket, the number of its user")
    connected_s: float = present("since when, s on the daemon's monotonic clock")
    controller: bool = present("whether its `TARGET` counts")
    watches: Literal["setpoints", "readings"] | None = absent("absent where it watches none")


class PublisherStatusKeys(Keys):
    """The sockets."""

    clients: int = present("clients that are connected")
    connected: list[ConnectedClientKeys] = present("who they are, the longest connected first")
    dropped_clients: int = present("clients that were too far behind")
    dropped_setpoints: int = present("setpoints that the publisher was too late for")
    packets_sent: int | None = absent("where UDP is configured")
    packets_dropped: int | None = absent("packets that the system did not take at once")


class GaugePollsKeys(Keys):
    """One gauge on its line."""

    quality: Quality = present("of its last poll")
    polls: int = present("how often it was asked")
    ok: int = present("polls in which every channel had a value")
    faults: dict[str, int] = present("polls by quality, for every quality that occurred")
    detail: str | None = absent("what the device sent or the line saw")
    last_ok_s: float | None = absent("when every channel last had a value, s")


class LineStatusKeys(Keys):
    """One line."""

    state: Literal["opening", "open", "lost", "stopped"] = present("of its port")
    opened: int = present("how often it was opened")
    lost: int = present("how often it was lost")
    detail: str | None = absent("why it is lost")
    round_s: float | None = absent("duration of the last round of polls, s")
    unexpected_bytes: int | None = absent("bytes that came without a request")
    gauges: dict[str, GaugePollsKeys] = present("the gauges on it, by name")


class ChannelStatusKeys(Keys):
    """One channel of a gauge."""

    channel: str = present('"gauge.channel"')
    quality: Quality = present("`ok`, or why there is no value")
    measures: str | None = absent("what the wiring says that it measures")
    noise_um: float | None = absent("of a length: standard deviation of one reading, um; absent if not stated")
    noise_from: str | None = absent("who states it: `configuration`, or `driver` with the source in its data sheet")
    age_s: float | None = absent("age of its reading, s")
    value: float | None = absent("raw value, before sign and machine zero, in its unit")
    detail: str | None = absent("what the device sent or the line saw")
    scatter_um: float | None = absent(
        "of a length that is good: standard deviation of one reading at rest, as measured, um; absent while it is not "
        "known"
    )
    warning: str | None = absent("what is to be looked at, of a length that is believed all the same")
    needs_person: bool | None = absent(
        "true where a person has to accept it: now, or when it is back, because the machine has moved since its last "
        "reading; absent otherwise"
    )


class StatusKeys(VersionKeys):
    """Answers STATUS. It repeats the keys of VERSION."""

    wire_name = "STATUS"
    time_s: float = present("now, s on the daemon's monotonic clock")
    mode: Mode = present("cmm, or machine_tool while there is a controller")
    zero: ZeroStatusKeys = present("whether there is a machine zero")
    model: ModelsKeys = present("the models that it runs with, without the paths of their files")
    loop: LoopStatusKeys = present("how well the loop keeps time")
    realtime: dict[str, PermissionKeys] = present(
        "what the loop asked the system for, by name: `sched_fifo`, `locked_memory` ..."
    )
    processes: dict[str, ProcessStatusKeys] = present(
        "the daemon's processes: `supervisor`, `loop`, `acquisition`, `service`, and `line` with its name for each "
        "line of `acquisition.own_process`"
    )
    publisher: PublisherStatusKeys = present("the clients")
    skew_s: float | None = absent(
        "how much later than the oldest the newest length that is good now was measured, s; absent where none is"
    )
    lines: dict[str, LineStatusKeys] = present("every line, by name")
    gauges: list[ChannelStatusKeys] = present("every channel of every gauge")
    waits_for_person: str | None = absent(
        "for people: the gauges that are not believed, and what to do; absent where all are"
    )
