"""The tip on the move, and when its gauges were read: `python -m tests.benchmarks.bench_sampling [SECONDS]`.

The simulated machine tours its workspace at 50 mm/s, with 250 mm/s2. Time is virtual: every request and reply takes
what its bytes take at the line's baud rate, its silences and a turnaround as long; a device samples in the middle of
its turnaround. So neither the computer nor its load is in the figures. Nine units of one register each share a line;
the other lines are those of the shipped machine. The same readings go through the daemon's own cycle, once as they are
and once carried on to the tick. The error is the distance of the tip from the simulated machine's true one; what is
left of it where every gauge is read at the tick stands above the table. "Off the path" is the distance from the nearest
place at which the tip was within the last second: a tip that is late, and else right, is on it.
"""

from __future__ import annotations

import argparse
import heapq
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Configuration, load
from compd.gauge import Quality, Reading, bad, good
from compd.line_settings import Pace, serial_pace
from compd.live.acquisition.motion_estimate import estimated_motion
from compd.live.acquisition.possible_motion import WINDOW_S, GaugeSample
from compd.live.loop import CycleInputs, CycleSettings, CycleState, build_pipeline, step
from compd.live.machine import MachineZero, Models
from compd.live.memory import Readings, Snapshot
from compd.simulation import World
from compd.stated_noise import tolerance_mm
from tests.benchmarks.figures import show
from tests.benchmarks.limits import run_limited
from tests.support.paths import CONFIG

BAUDS = (9600, 19200, 115200)
REGISTER = (8, 7)  # bytes of a request for one register, and of its reply, on an RTU line
TRIGGER = 8  # bytes of a write by function 5 or 6
SETTLE_S = 2e-3
NOISE_UM = 0.1
PERIOD_S = 5e-3
AT_REST_S = 1.0
ZERO_AT_S = 0.5
TOUR_S = 12.0
SEED = 5


class Exchange(NamedTuple):
    """One request and its reply: bytes there and back, and the gauges in it by the simulated machine's names."""

    sent: int
    received: int
    names: tuple[str, ...]


class Sampling(NamedTuple):
    """When gauges are sampled, when their readings say that they were, and when these are there, s."""

    sampled_s: float
    stamp_s: float
    there_s: float
    names: tuple[str, ...]


@dataclass(frozen=True)
class VirtualLine:
    """Exchanges one after the other, round after round, behind a round trigger where it has one."""

    pace: Pace
    exchanges: tuple[Exchange, ...]
    trigger: bool = False

    def round(self, start_s: float) -> list[Sampling]:
        """The exchanges of the round that begins at `start_s`, s."""
        pace, now_s, latched_s = self.pace, start_s, None
        if self.trigger:
            latched_s = now_s + pace.quiet_s + TRIGGER * pace.character_s
            now_s = latched_s + SETTLE_S
        samplings = []
        for exchange in self.exchanges:
            asked_s = now_s + pace.quiet_s + exchange.sent * pace.character_s
            now_s = asked_s + pace.turnaround_s + exchange.received * pace.character_s
            sampled_s = asked_s + pace.turnaround_s / 2 if latched_s is None else latched_s
            samplings.append(Sampling(sampled_s, asked_s if latched_s is None else latched_s, now_s, exchange.names))
        return [s._replace(there_s=now_s) for s in samplings] if self.trigger else samplings


def lines(names: Sequence[str], nine: Sequence[str], baud: int, trigger: bool) -> list[VirtualLine]:
    """Nine units on one line, and the lines of config/tripod-cmm.yaml for all others."""
    own = [name for name in names if name not in nine]
    scales = [(name,) for name in own if name.startswith("scale")]
    rest = [tuple(name for name in own if name.startswith(kind)) for kind in ("joint", "frame_u", "frame_t")]
    usb, fast = serial_pace(38400, "7E2", rtu=False), serial_pace(115200, "8N1", rtu=True)
    return [
        VirtualLine(serial_pace(baud, "8N1", rtu=True), tuple(Exchange(*REGISTER, (name,)) for name in nine), trigger),
        *(VirtualLine(usb, (Exchange(2, 16, scale),)) for scale in scales),
        *(VirtualLine(fast, (Exchange(8, 5 + 4 * len(block), block),)) for block in rest if block),
    ]


class Move(NamedTuple):
    """Of every cycle: tip errors on the move and at rest, um, how far the tip is off the path; skew of the setpoints,
    s; ratio of the error of what was carried on to its uncertainty.
    """

    as_read_um: FloatArray
    carried_um: FloatArray
    at_once_um: FloatArray
    rest_um: FloatArray
    rest_carried_um: FloatArray
    off_path_um: FloatArray
    off_path_carried_um: FloatArray
    skew_s: FloatArray
    within: FloatArray


def measured(configuration: Configuration, nine: Sequence[str], baud: int, trigger: bool, tour_s: float) -> Move:
    """Tour the simulated machine with these nine units on one line for `tour_s` (s)."""
    pipeline = build_pipeline(configuration, configuration.gauge_objects())
    world = World(configuration.geometry, configuration.wiring, SEED, zero_hold_s=AT_REST_S)
    channels = channels_by_name(configuration, pipeline.wires)
    slots = {name: pipeline.latest.index[channel] for name, channel in channels.items()}
    world.advance(ZERO_AT_S)
    zero = MachineZero(
        configuration.zero_hash, "2026-01-01T00:00:00+00:00", {channels[n]: world.sense(n) for n in channels}
    )
    cycles = [
        Cycle(replace(pipeline.settings, loop=pipeline.settings.loop.model_copy(update={"extrapolate": carried})))
        for carried in (False, True, False)
    ]
    readings: list[Reading] = [bad(ZERO_AT_S, Quality.NEVER_READ)] * len(pipeline.latest.channels)
    histories = {name: deque[GaugeSample](maxlen=32) for name in channels}
    limit_mm = tolerance_mm(NOISE_UM)
    order, events = count(), []

    def advance(time_s: float) -> None:
        world.advance(time_s - world.time_s)

    def push(time_s: float, action: Callable[[], None]) -> None:
        heapq.heappush(events, (time_s, next(order), action))

    def begin_round(line: VirtualLine, start_s: float) -> None:
        samplings = line.round(start_s)
        for sampling in samplings:
            follow(sampling)
        end_s = samplings[-1].there_s
        push(end_s, lambda: begin_round(line, end_s))

    def follow(sampling: Sampling) -> None:
        values: dict[str, float] = {}

        def sample() -> None:
            values.update({name: world.sense(name) for name in sampling.names})

        def publish() -> None:
            for name, value in values.items():
                histories[name].append(GaugeSample(value, sampling.stamp_s, WINDOW_S))
                motion = estimated_motion(histories[name], limit_mm)
                readings[slots[name]] = good(value, sampling.stamp_s)._replace(motion=motion)

        push(sampling.sampled_s, sample)
        push(sampling.there_s, publish)

    results: list[tuple[bool, list[float], float, float]] = []
    path: deque[FloatArray] = deque(maxlen=round(1.0 / PERIOD_S))

    def tick(number: int) -> None:
        now_s = ZERO_AT_S + number * PERIOD_S
        at_once = list(readings)
        for name, slot in slots.items():
            at_once[slot] = good(world.sense(name), now_s)
        for slot in set(range(len(readings))) - set(slots.values()):
            readings[slot] = at_once[slot] = good(20.0, now_s)
        setpoints = [
            cycle.run(number, Snapshot(now_s, Readings.of(used)), zero)
            for cycle, used in zip(cycles, (readings, readings, at_once), strict=True)
        ]
        if all(setpoint.valid for setpoint in setpoints):
            truth = world.tip_M_mm()
            path.append(truth)
            errors = [float(np.linalg.norm(s.values.tip_M_mm - truth)) * 1e3 for s in setpoints]
            errors += [off_path_mm(s.values.tip_M_mm, path) * 1e3 for s in setpoints[:2]]
            u_um = setpoints[1].u_tip_um
            ratio = errors[1] / float(np.linalg.norm(u_um)) if u_um is not None else np.nan
            results.append((world.phase == "moving", errors, setpoints[0].skew_s, ratio))
        push(now_s + PERIOD_S, lambda: tick(number + 1))

    for k, line in enumerate(lines(tuple(channels), nine, baud, trigger)):
        begin_round(line, ZERO_AT_S + 1e-3 * k)
    push(ZERO_AT_S, lambda: tick(0))
    while events[0][0] < AT_REST_S + tour_s:
        time_s, _, action = heapq.heappop(events)
        advance(time_s)
        action()
    moving = np.array([m for m, *_ in results])
    errors = np.array([e for _, e, *_ in results])
    return Move(
        *errors[moving, :3].T,
        errors[~moving, 0],
        errors[~moving, 1],
        *errors[moving, 3:].T,
        np.array([s for _, _, s, _ in results])[moving],
        np.array([r for *_, r in results])[moving],
    )


def off_path_mm(tip_mm: FloatArray, path: Sequence[FloatArray]) -> float:
    """The distance of the tip from the polygon through the places on its path, mm."""
    places = np.array(path)
    if len(places) < 2:
        return 0.0
    start, way = places[:-1], np.diff(places, axis=0)
    length2 = np.maximum((way**2).sum(axis=1), 1e-30)
    share = np.clip(((tip_mm - start) * way).sum(axis=1) / length2, 0.0, 1.0)
    return float(np.linalg.norm(start + share[:, None] * way - tip_mm, axis=1).min())


class Cycle:
    """The daemon's cycle with its state."""

    def __init__(self, settings: CycleSettings) -> None:
        self._settings = settings
        self._state = CycleState.at_start(settings.model)

    def run(self, tick: int, snapshot: Snapshot, zero: MachineZero):
        inputs = CycleInputs(tick, snapshot, zero, None, Models(self._settings.without_effects.applied))
        setpoint, self._state = step(self._state, inputs, self._settings)
        return setpoint


def channels_by_name(configuration: Configuration, wires) -> Mapping[str, str]:
    """The channel of each length, by its name in the simulated machine."""
    wiring = configuration.wiring
    names = [
        *(f"scale_{k + 1}" for k in range(len(wiring.scale))),
        *(f"joint_{k + 1}" for k in range(len(wiring.joint))),
        *(f"frame_{distance}" for distance in ("t1", "t2", "t3", "u1", "u2", "u3", "u4", "u5", "u6")),
    ]
    return dict(zip(names, wires.length_channels, strict=True))


def shipped() -> Configuration:
    """config/tripod-cmm.yaml with noise, and limits that do not slow the correction."""
    configuration = load(CONFIG / "tripod-cmm.yaml")
    gauges = {name: options.model_copy(update={"noise_um": NOISE_UM}) for name, options in configuration.gauges.items()}
    limits = configuration.limits.model_copy(update={"slew_mm_per_s": 1000.0, "correction_mm": 5.0})
    loop = configuration.loop.model_copy(update={"stale_after_s": 2.0})
    return replace(configuration, gauges=gauges, limits=limits, loop=loop)


WHICH = {
    "nine joint comparators": tuple(f"joint_{k}" for k in range(1, 10)),
    "scales and six joint comparators": (*(f"scale_{k}" for k in (1, 2, 3)), *(f"joint_{k}" for k in range(1, 7))),
}


def rms(values: FloatArray) -> float:
    return float(np.sqrt((values**2).mean()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", nargs="?", type=float, default=TOUR_S)
    tour_s = parser.parse_args().seconds
    configuration = shipped()
    for what, nine in WHICH.items():
        rows = []
        at_once_um = 0.0
        for baud in BAUDS:
            for trigger in (False, True):
                move = measured(configuration, nine, baud, trigger, tour_s)
                at_once_um = max(at_once_um, rms(move.at_once_um))
                rows.append(
                    [
                        f"{baud}{', trigger' if trigger else ''}",
                        f"{np.median(move.skew_s) * 1e3:.0f}",
                        f"{rms(move.as_read_um):.1f}",
                        f"{rms(move.carried_um):.1f}",
                        f"{move.as_read_um.max():.0f}",
                        f"{move.carried_um.max():.0f}",
                        f"{rms(move.off_path_um):.1f}",
                        f"{rms(move.off_path_carried_um):.1f}",
                        f"{rms(move.rest_um):.2f}",
                        f"{rms(move.rest_carried_um):.2f}",
                        f"{np.mean(move.within < 2):.2f}",
                    ]
                )
        show(
            f"{what} on one line: tip error on the move, um; {at_once_um:.2f} with all read at the tick",
            [
                "baud",
                "skew ms",
                "rms as read",
                "rms carried on",
                "max as read",
                "max carried on",
                "off path as read",
                "off path carried on",
                "rest as read",
                "rest carried on",
                "within 2 u",
            ],
            rows,
        )


if __name__ == "__main__":
    run_limited(main, BAUDS=(115200,), TOUR_S=0.2, WHICH=dict(list(WHICH.items())[:1]))
