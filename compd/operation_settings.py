"""Sections on how the daemon runs: wiring, loop, acquisition, limits, sockets, state."""

from __future__ import annotations

import ipaddress
import math
from typing import Annotated, Literal, Self, get_args

from pydantic import Field, field_validator, model_validator

from compd.documents import AbsolutePath, Finite, Positive, Section, Text, refusal

# The nine distances of the frame's octahedron: t_k between the base platform's supports, u_k from them to the plate.
FrameDistance = Literal["t1", "t2", "t3", "u1", "u2", "u3", "u4", "u5", "u6"]
FRAME_DISTANCES: tuple[FrameDistance, ...] = get_args(FrameDistance)
# How many of them a machine measures: all, u1 to u6, or none.
FRAME_COUNTS = (9, 6, 0)
GaugeChannel = Annotated[str, Field(pattern=r"^[A-Za-z0-9_]+(\.[A-Za-z0-9_]+)?$")]
LinkNumber = Annotated[int, Field(ge=1, le=6)]
Sign = Literal[1, -1]
_GAUGE = "the gauge's name under `gauges:`; where it has several channels, `gauge.channel`"


class ScaleWire(Section):
    """Assignment of a gauge to the linear scale of a link."""

    link: LinkNumber = Field(description="the link, counted from 1")
    gauge: GaugeChannel = Field(description=_GAUGE)
    sign: Sign = Field(default=1, description="-1 where the display counts down as the link grows")


class JointWire(Section):
    """Assignment of a gauge to a joint comparator; the order numbers them 1, 2, 3 ..."""

    link: LinkNumber = Field(description="the link, counted from 1, at whose joint it is")
    role: Literal["S", "Ra", "Rb", "B"] = Field(
        description="S: spherical joint, counts once; Ra, Rb: the ball shanks of a revolute joint, half each; "
        "B: one comparator at the other joint, counts once"
    )
    gauge: GaugeChannel = Field(description=_GAUGE)
    sign: Sign = Field(
        default=1,
        description="-1 where the display counts down as the joint makes its link shorter",
    )


class FrameWire(Section):
    """Assignment of a gauge to one of the nine frame distances."""

    distance: FrameDistance = Field(
        description="t1 = b1 b2, t2 = b2 b3, t3 = b3 b1, between the supports of the base platform; u1 = b1 m1, "
        "u2 = b1 m3, u3 = b2 m1, u4 = b2 m2, u5 = b3 m2, u6 = b3 m3, from them to the plate points"
    )
    gauge: GaugeChannel = Field(description=_GAUGE)
    sign: Sign = Field(default=1, description="-1 where the display counts down as the distance grows")


class QuantityWire(Section):
    """Anything else measured: a temperature, a force, a pressure."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*_(degC|N|hPa|pct|mm|1)$")] = Field(
        description="name with its unit, as a recording's column: temperature_link_1_degC"
    )
    gauge: GaugeChannel = Field(description=_GAUGE)
    noise: Positive | None = Field(default=None, description="standard deviation of one reading, in the name's unit")
    plausible: tuple[Finite, Finite] | None = Field(
        default=None,
        description="lowest and highest plausible value: a reading beyond is not believed; left out: by the name, "
        "a room 0 to 50 degC, a part of the machine -20 to 150 degC, air 500 to 1100 hPa",
    )
    fastest_change: Positive | None = Field(
        default=None,
        description="fastest change per second, in the name's unit: a reading that jumped further is not believed; "
        "left out: by the unit, 0.2 degC, 0.1 hPa, 3 pct; else no limit",
    )
    apart: Positive | None = Field(
        default=None,
        description="largest difference from the other quantities of this unit: a reading that is further from most of "
        "them, and from two at least, is not believed; left out: 15 degC; else no limit",
    )

    @model_validator(mode="after")
    def _is_range(self) -> Self:
        if self.plausible is not None and not self.plausible[0] < self.plausible[1]:
            raise refusal("plausible is an empty range", "[lowest, highest], lowest < highest", "exchange the two")
        return self


def measured_distances(count: int) -> tuple[FrameDistance, ...]:
    """The frame distances that `count` comparators measure, one of FRAME_COUNTS: without t1 to t3, the last six."""
    return FRAME_DISTANCES[len(FRAME_DISTANCES) - count :]


# Kinds of wires, as keys of `wiring`.
WIRES = ("scale", "joint", "frame", "quantities")


class Wiring(Section):
    """Assignment of gauges to the quantities of the machine."""

    scale: tuple[ScaleWire, ...] = Field(default=(), description="one entry for the linear scale of every link")
    joint: tuple[JointWire, ...] = Field(default=(), description="one entry for every joint comparator")
    frame: tuple[FrameWire, ...] = Field(
        default=(),
        description="one entry for each of the nine frame comparators, or for u1 to u6, which leaves t1 to t3 as at "
        "machine zero; none: the frame is taken to stand still",
    )
    frame_drift_um: Annotated[float, Field(ge=0, allow_inf_nan=False)] | None = Field(
        default=None,
        description="without all nine frame comparators: standard uncertainty of the tip along each axis, um, "
        "from what the frame moves unmeasured between two machine zeros; left out: unknown, and with it the tip's",
    )
    quantities: tuple[QuantityWire, ...] = Field(
        default=(), description="whatever else is measured: temperatures, forces, air pressure"
    )

    @property
    def unmeasured_frame_um(self) -> float:
        """`frame_drift_um`, nan where nobody states it; 0 where all nine distances are measured."""
        if len(self.frame) == len(FRAME_DISTANCES):
            return 0.0
        return math.nan if self.frame_drift_um is None else self.frame_drift_um


class LoopBasics(Section):
    """What clients are told of the compute loop."""

    rate_hz: Annotated[float, Field(gt=0, le=5000, allow_inf_nan=False)] = Field(description="cycles per second")
    stale_after_s: Positive = Field(description="a reading older than this is stale (a gauge may set its own)")
    on_stale: Literal["hold", "fade", "degrade", "stop"] = Field(
        description="hold: compute with the last good comparators for hold_s, then stop; fade: let them count less and "
        "less over hold_s, then stop; degrade: let joints, frame or effects alone fade, then go on without them; stop: "
        "invalid at once"
    )
    hold_s: Positive = Field(description="duration of hold or fade before the setpoint becomes invalid")


class LoopSettings(LoopBasics):
    """The compute loop."""

    extrapolate: bool = Field(
        default=True,
        description="carry every length on to the time of the cycle, by the speed that its own last readings show, "
        "where that is more than they scatter; false: use each as it was read",
    )
    skew_s: Positive | None = Field(
        default=None,
        description="how far apart in time the lengths of one setpoint may be measured: beyond it the setpoint is "
        "`refused`; left out: as far as `stale_after_s` allows",
    )
    priority: Annotated[int, Field(ge=1, le=98)] = Field(
        default=40, description="real-time priority of the loop (SCHED_FIFO), where permitted"
    )
    lock_memory: bool = Field(default=True, description="keep the daemon in memory (mlockall), where permitted")
    wake_latency_us: Annotated[int, Field(ge=0, le=2_000_000)] | None = Field(
        default=None,
        description="how long a processor may take to wake from its sleep, us, where permitted "
        "(/dev/cpu_dma_latency); 0: none sleeps, which takes more power; left out: 0 from 500 Hz on, below no limit",
    )


class AcquisitionSettings(Section):
    """The processes in which the gauges are polled; the section may be left out."""

    own_process: tuple[str, ...] = Field(
        default=(),
        description="names of lines that are each polled in a process of their own, so that what a driver there does "
        "to the interpreter or to memory hits nothing else; all other lines share one process",
    )
    memory_mb: Annotated[int, Field(ge=32)] = Field(
        default=512,
        description="each of these processes may grow by this much (MB) before it is ended and started anew",
    )


class LimitSettings(Section):
    """Limits of the correction per link, and of the tip's error."""

    correction_mm: Positive = Field(description="largest correction of one link, to either side")
    slew_mm_per_s: Positive = Field(description="fastest change of a correction")
    on_limit: Literal["clamp", "refuse"] = Field(
        description="clamp: apply the limit and say so; refuse: the setpoint becomes invalid and says so"
    )
    tip_correction_mm: Positive | None = Field(
        default=None,
        description="machines without scales: largest correction of the tip along each axis, to either side; left out: "
        "`correction_mm`",
    )
    rotation_correction_rad: Positive | None = Field(
        default=None,
        description="machines without scales: largest correction of the attitude about each axis, to either side; left "
        "out: as much as moves a point at a distance of 100 mm by the largest correction of the tip",
    )
    tip_error_um: Positive | None = Field(
        default=None,
        description="largest bound of the tip's error (`u_tip_um`, 95 %) with which a setpoint is valid, um; beyond it "
        "and where the bound is not known, the setpoint is `refused`; left out: it is told and not limited",
    )


class FrameVote(Section):
    """Frame comparators against a thermometer of the frame."""

    temperature: str = Field(description="name of the quantity, under `wiring: quantities:`")
    expansion_ppm_per_K: Annotated[float, Field(gt=-50, lt=50, allow_inf_nan=False)] = Field(
        description="growth of the frame against the comparators' rods, 1e-6 per kelvin: steel on Super-Invar 11"
    )
    tolerance_um: Positive = Field(description="how far a distance may be from what the temperature says, um")


class VoteSettings(Section):
    """Cross-checks between gauges; the section may be left out.

    A gauge that others contradict is distrusted until a person accepts it.
    """

    repeated_digits: bool = Field(
        default=True,
        description="a length gauge that repeats the very same digits while others scatter is stuck; for gauges whose "
        "`noise_um` is larger than their resolution",
    )
    standing_temperature_K: Positive | None = Field(
        default=2.0,
        description="a thermometer that repeats the very same digits while all others have changed by this much, the "
        "same way, is stuck; null: not looked at",
    )
    standing_scale_mm: Positive | None = Field(
        default=2.0,
        description="a scale that stands while all others depart from rest by this much is stuck; null: not looked at",
    )
    signal_periods: bool = Field(
        default=True,
        description="a scale that steps alone at rest, by `geometry.scale_signal_period_mm` or more in all, twice or "
        "more within an hour (in machine-tool mode: once, while its setpoint stands), has lost signal periods; needs "
        "that period",
    )
    following_mm: Positive | None = Field(
        default=None,
        description="machine-tool mode: a scale that is further from the setpoint for 1 s does not follow; left out: "
        "not looked at",
    )
    joint_pair_um: Positive | None = Field(
        default=None,
        description="the two ball shanks of one revolute joint (Ra, Rb) differ by no more, um; left out: not looked at",
    )
    tip_mm_per_s: Positive | None = Field(
        default=None, description="CMM mode: the tip never moves faster; left out: not looked at"
    )
    frame: FrameVote | None = Field(default=None, description="frame comparators against a thermometer")


class TcpSocket(Section):
    """Clients over TCP."""

    host: str = Field(
        default="127.0.0.1",
        description="address to listen on; any other than loopback needs `allow` and `token_file`",
    )
    port: Annotated[int, Field(ge=0, le=65535)] = Field(
        default=7750, description="TCP port to listen on; 0: any free port"
    )
    allow: tuple[str, ...] = Field(
        default=(),
        description="addresses and networks (10.1.2.0/24) from which clients may connect; left out: every address that "
        "reaches the port",
    )
    token_file: AbsolutePath | None = Field(
        default=None,
        description="absolute path of a file, of mode 600, with a secret of 16 characters or more that every TCP "
        "client sends in its first line, `AUTH`; left out: none",
    )

    @field_validator("host")
    @classmethod
    def _is_address(cls, host: str) -> str:
        if host != "localhost":
            ipaddress.ip_address(host)
        return host

    @field_validator("allow")
    @classmethod
    def _are_networks(cls, allow: tuple[str, ...]) -> tuple[str, ...]:
        for text in allow:
            ipaddress.ip_network(text)
        return allow

    @model_validator(mode="after")
    def _is_guarded(self) -> Self:
        missing = [name for name in ("allow", "token_file") if not getattr(self, name)]
        if self.is_open and missing:
            raise refusal(
                f"host {self.host} can be reached from other computers, and {' and '.join(missing)} "
                f"{'is' if len(missing) == 1 else 'are'} missing",
                "`allow` and `token_file` under `tcp:`, or host 127.0.0.1",
                "read docs/how-to/connect-a-controller.md, From another computer",
            )
        return self

    @property
    def is_open(self) -> bool:
        """Whether other computers can reach it."""
        return self.host != "localhost" and not ipaddress.ip_address(self.host).is_loopback


class UnixSocket(Section):
    """Clients on this computer; machine zero is only taken here."""

    path: AbsolutePath = Field(max_length=100, description="absolute path of the Unix socket")


class UdpTarget(Section):
    """Destination of the binary SETPOINT, one packet per cycle."""

    host: Text = Field(description="name or address of the controller")
    port: Annotated[int, Field(ge=1, le=65535)] = Field(description="UDP port of the controller")


class TargetSettings(Section):
    """Validity of a controller's `TARGET`; the section may be left out."""

    valid_for_s: Positive = Field(
        default=5.0,
        description="lifetime of a target: a controller that sends none for this time gets `stop`, until it "
        "sends one again or its role ends",
    )
    unix_only: bool = Field(default=False, description="true: only clients of the Unix socket may send one")


class SocketSettings(Section):
    """Addresses for clients."""

    tcp: TcpSocket | None = Field(default=None, description="clients over TCP; left out: none")
    unix: UnixSocket = Field(description="clients on this computer; machine zero and models are asked for here only")
    udp: UdpTarget | None = Field(
        default=None, description="where every setpoint goes as a packet of fixed size; left out: none is sent"
    )
    target: TargetSettings = Field(default=TargetSettings(), description="what a controller may do")
    valid_for_s: Positive = Field(description="lifetime of a setpoint: valid_until = time + this")


class StateSettings(Section):
    """State that the daemon keeps across restarts, and its model at the start."""

    directory: AbsolutePath = Field(description="absolute path of the directory in which machine zero is kept")
    model_file: AbsolutePath | None = Field(
        default=None, description="absolute path of the model file to start with; without: no effects"
    )
