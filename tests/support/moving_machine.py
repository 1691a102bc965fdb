"""A configured machine on the move, on an injected clock: its gauges are polled, its setpoints compared with the truth.

The simulated machine stands, drives to another place and stands again. What its gauges would show and where its tip is
are kept on a fine grid; polls take samples of it when a line would, with noise and the last digit of its gauges.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from compd.configuration import Configuration, load
from compd.gauge import Quality, Reading, bad, good
from compd.live.acquisition.motion_estimate import MotionEstimate
from compd.live.acquisition.possible_motion import WINDOW_S, GaugeSample
from compd.live.loop import CycleInputs, CycleState, build_pipeline, step
from compd.live.machine import MachineZero
from compd.live.memory import Readings, Snapshot
from compd.setpoint_states import State
from compd.simulation import World
from compd.simulation.truth.motion import Move
from compd.simulation.truth.strengths import FULLY_MEASURED_WITHOUT_NOISE
from compd.stated_noise import tolerance_mm
from tests.support.paths import CONFIG

GRID_S = 1e-3
PERIOD_S = 0.01
BEGIN_S, DEPARTS_S, END_S = 0.7, 1.5, 4.6  # of the run, and when the machine departs; it has arrived after 2.1 s
# Where a way is computed, from 0 to 1: Chebyshev's nodes.
_NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(9) / 8)
# Where the links drive, mm since machine zero: the tip goes at up to 130 mm/s.
PLACES_MM = {3: (20.0, -14.0, 6.0), 6: (14.0, -11.0, 6.0, 15.0, -7.0, 4.0)}
NOISE_MM, DIGIT_MM = {"scale": 5e-6, "joint": 2e-5, "frame": 2e-5}, {"scale": 1e-4, "joint": 1e-4, "frame": 1e-5}
ROOM_DEGC = 20.0
TIMEOUT_S = 0.15  # of the scales' lines


class Track(NamedTuple):
    """The simulated machine on a grid of GRID_S: lengths (N, n + k + 9), mm, and tip (N, 3), mm."""

    lengths_mm: np.ndarray
    tip_M_mm: np.ndarray

    def at(self, time_s: float) -> np.ndarray:
        """What the lengths are, (n + k + 9), mm."""
        place = min(max(time_s / GRID_S, 0.0), len(self.lengths_mm) - 1.001)
        k, share = int(place), place % 1.0
        return (1 - share) * self.lengths_mm[k] + share * self.lengths_mm[k + 1]

    def speed_mm_per_s(self) -> float:
        """The tip's largest speed."""
        return float(np.linalg.norm(np.diff(self.tip_M_mm, axis=0), axis=1).max() / GRID_S)


class Told(NamedTuple):
    """One setpoint beside the truth."""

    time_s: float
    valid: bool
    state: State
    reason: str
    bound_um: float
    error_um: float


class Fault(NamedTuple):
    """What happens to the acquisition, by the time of a poll.

    stalled : no process runs from the first to the second time, s.
    lost : the first poll of this name's line that begins after the time gets no reply.
    killed : as stalled, and what it knew of motion is gone.
    """

    stalled: tuple[float, float] | None = None
    lost: tuple[str, float] | None = None
    killed: bool = False


NONE = Fault()


class Line(NamedTuple):
    """Gauges that are read in one poll: every `round_s`, of which a reply takes `reply_s`; begins at `first_s`."""

    names: tuple[str, ...]
    round_s: float
    reply_s: float
    first_s: float


def names_of(configuration: Configuration) -> tuple[str, ...]:
    """Of all lengths, by the simulated machine."""
    wiring = configuration.wiring
    return (
        *(f"scale_{k + 1}" for k in range(len(wiring.scale))),
        *(f"joint_{k + 1}" for k in range(len(wiring.joint))),
        *(f"frame_{distance}" for distance in ("t1", "t2", "t3", "u1", "u2", "u3", "u4", "u5", "u6")),
    )


@cache
def track(name: str) -> Track:
    """Stand, drive, stand. All links arrive at once, the one with the longest way at the simulation's usual speed."""
    configuration = load(CONFIG / name)
    world = World(configuration.geometry, configuration.wiring, 3, strengths=FULLY_MEASURED_WITHOUT_NOISE)
    names, states = names_of(configuration), []
    way_mm = np.array(PLACES_MM[len(configuration.wiring.scale)])
    for share in _NODES:
        world.advance_to(share * way_mm, world.posture, 1e-3, 1e-3)
        states.append([*(world.sense(gauge) for gauge in names), *world.tip_M_mm()])
    by_share = [np.polynomial.Polynomial.fit(_NODES, column, len(_NODES) - 1) for column in np.array(states).T]
    longest_mm = float(np.abs(way_mm).max())
    driven = Move(np.zeros(1), np.array([longest_mm]))
    times_s = np.arange(0.0, END_S + 2 * GRID_S, GRID_S) - DEPARTS_S
    shares = np.array([float(driven.position_mm(max(time_s, 0.0))[0]) for time_s in times_s]) / longest_mm
    rows = np.array([column(shares) for column in by_share]).T
    return Track(rows[:, : len(names)], rows[:, len(names) :])


def lines_of(names: tuple[str, ...]) -> list[Line]:
    """As of the shipped configurations, with rounds as they are on RS-232."""
    scales = [name for name in names if name.startswith("scale")]
    rest = [tuple(name for name in names if name.startswith(kind)) for kind in ("joint", "frame_u", "frame_t")]
    return [
        *(Line((name,), 0.020 + 0.001 * k, 0.017, BEGIN_S + 0.004 * k) for k, name in enumerate(scales)),
        Line(rest[0], 0.040, 0.035, BEGIN_S + 0.003),
        Line(rest[1], 0.015, 0.010, BEGIN_S + 0.005),
        Line(rest[2], 0.025, 0.005, BEGIN_S + 0.007),
    ]


def configured(name: str, tip_error_um: float | str | None = "shipped") -> Configuration:
    """A shipped machine; its limit of the tip's error may be another one, or none."""
    configuration = load(CONFIG / name)
    limits = configuration.limits
    if tip_error_um != "shipped":
        limits = limits.model_copy(update={"tip_error_um": tip_error_um})
    loop = configuration.loop.model_copy(update={"rate_hz": 1 / PERIOD_S})
    return replace(configuration, limits=limits, loop=loop)


class _Lines:
    """Polls the track, and has the readings as they are at a time."""

    def __init__(self, configuration: Configuration, pipeline, zero_at_s: float, fault: Fault) -> None:
        self._track, self._fault = track(configuration.path.name), fault
        self._random = np.random.default_rng(1)
        self._names = names_of(configuration)
        channels = dict(zip(self._names, pipeline.wires.length_channels, strict=True))
        self._slots = {name: pipeline.latest.index[channel] for name, channel in channels.items()}
        noise_um = {name: configuration.noise_of(channel).um for name, channel in channels.items()}
        self._motions = {
            name: MotionEstimate(tolerance_mm(um if np.isfinite(um) else None)) for name, um in noise_um.items()
        }
        self._histories = {name: deque[GaugeSample](maxlen=32) for name in self._names}
        self.readings: list[Reading] = [bad(0.0, Quality.NEVER_READ)] * len(pipeline.latest.channels)
        self.zero_mm = {
            channels[n]: float(self._sample(zero_at_s + 0.05 * k, [n])[0]) for k, n in enumerate(self._names)
        }
        self._next = [(line.first_s, line) for line in lines_of(self._names)]
        self._coming: list[tuple[float, float, Line, list[float]]] = []

    def _sample(self, time_s: float, names) -> list[float]:
        kinds = [name.split("_")[0] for name in names]
        truth = self._track.at(time_s)[[self._names.index(name) for name in names]]
        noisy = truth + self._random.normal(size=len(kinds)) * [NOISE_MM[kind] for kind in kinds]
        digits = np.array([DIGIT_MM[kind] for kind in kinds])
        return list(np.round(noisy / digits) * digits)

    def go_on(self, now_s: float) -> None:
        """Everything until `now_s`."""
        stalled = self._fault.stalled or (np.inf, np.inf)
        if self._fault.killed and stalled[0] <= now_s < stalled[1]:
            for history in self._histories.values():
                history.clear()
            self._coming.clear()
        if stalled[0] <= now_s < stalled[1]:
            return
        begun = []
        for start_s, line in self._next:
            next_s = start_s
            while next_s <= now_s:
                next_s = stalled[1] if stalled[0] <= next_s < stalled[1] else self._poll(next_s, line)
            begun.append((next_s, line))
        self._next = begun
        for there_s, stamp_s, line, values in sorted(self._coming, key=lambda coming: coming[0]):
            if there_s <= now_s:
                self._publish(stamp_s, line, values)
        self._coming = [coming for coming in self._coming if coming[0] > now_s]

    def _poll(self, start_s: float, line: Line) -> float:
        """Begin a poll; when the next one begins."""
        lost = self._fault.lost
        if lost is not None and lost[0] in line.names and start_s >= lost[1]:
            self._fault = self._fault._replace(lost=None)
            return start_s + TIMEOUT_S + line.round_s  # the first answer after a fault is thrown away
        self._coming.append((start_s + line.reply_s, start_s, line, self._sample(start_s + 5e-4, line.names)))
        return start_s + line.round_s

    def _publish(self, stamp_s: float, line: Line, values: list[float]) -> None:
        for name, value in zip(line.names, values, strict=True):
            history = self._histories[name]
            history.append(GaugeSample(value, stamp_s, WINDOW_S))
            motion = self._motions[name].note(history)
            self.readings[self._slots[name]] = good(value, stamp_s)._replace(motion=motion)


def told(configuration: Configuration, fault: Fault = NONE) -> list[Told]:
    """Every setpoint from BEGIN_S to END_S, in mode cmm."""
    pipeline = build_pipeline(configuration, configuration.gauge_objects())
    lines = _Lines(configuration, pipeline, 0.2, fault)
    lengths = {pipeline.latest.index[channel] for channel in pipeline.wires.length_channels}
    zero = MachineZero(configuration.zero_hash, "2026-01-01T00:00:00+00:00", lines.zero_mm)
    state, truth, setpoints = CycleState.at_start(pipeline.settings.model), track(configuration.path.name), []
    for tick in range(round((END_S - BEGIN_S) / PERIOD_S)):
        now_s = BEGIN_S + tick * PERIOD_S
        lines.go_on(now_s)
        readings = [
            reading if slot in lengths else good(ROOM_DEGC, now_s) for slot, reading in enumerate(lines.readings)
        ]
        inputs = CycleInputs(tick, Snapshot(now_s, Readings.of(readings)), zero, None)
        setpoint, state = step(state, inputs, pipeline.settings)
        bound_um, error_um = np.nan, np.nan
        if setpoint.values is not None:
            bound_um = setpoint.u_tip_um
            true_mm = truth.tip_M_mm[min(round(now_s / GRID_S), len(truth.tip_M_mm) - 1)]
            error_um = 1e3 * float(np.linalg.norm(setpoint.values.tip_M_mm - true_mm))
        setpoints.append(Told(now_s, setpoint.valid, setpoint.state, setpoint.reason, bound_um, error_um))
    return setpoints
