"""A machine without faults in time-lapse: what is judged wrong of readings that are right.

The simulated machine goes through its tour, warms up and rests. Its readings go to the parts of the daemon that judge
them, which have the simulated time. There are no wires, so that a day takes an hour.
"""

from __future__ import annotations

import math
import random
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from compd.configuration import Configuration, load
from compd.gauge import Channel, Gauge, Quality, Reading, good
from compd.live.acquisition import LOOK_EVERY_S, Votes
from compd.live.acquisition.polled_gauge import PolledGauge
from compd.live.loop import Commands, CycleInputs, CycleState, build_pipeline, step
from compd.live.machine import MachineZero
from compd.live.memory import Doubt
from compd.live.wired_trust import wired_channels, wired_memory, wired_trust
from compd.simulation import World
from compd.simulation.wires.server import Sensing

# All gauges are polled one after the other, a round in this time, s; now and then the computer is late.
ROUND_S = (0.02, 0.035)
LATE_S, LATE_SHARE = 0.15, 0.002
# The tour: so long, then a rest of the same length.
TOUR_S = REST_S = 900.0
# While the machine rests its parts move with the temperature alone: it is enough to compute them so often, s.
THERMAL_STEP_S = 2.0
# What the devices show: a display's and a unit's last digit. Floats in registers have no step.
STEP_MM = {"heidenhain_nd28x": 1e-4, "keyence_gt2_dlrs1a": 1e-4}
# Of a line and a gauge; nothing fails here.
REST_AFTER_FAULT_S, STALE_S = 0.2, 0.5
STARTED_AT = "2026-01-01T00:00:00+00:00"


class LapsedClock:
    """Time that is what the simulation says."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        return self.now_s

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        raise AssertionError("nothing waits in time-lapse")


class Poll:
    """In the place of a line: a second answer in one poll comes later."""

    def __init__(self, later: Callable[[], None]) -> None:
        self.answers = 0
        self._later = later

    def asked(self) -> None:
        if self.answers:
            self._later()
        self.answers += 1


class Sensed(Gauge[Any]):
    """A gauge without a wire: shows what the simulated machine's sensors see, in its device's digits."""

    def __init__(self, options: Any, channels: Sequence[Channel], sense: Callable[[str], float], clock: LapsedClock):
        super().__init__(options)
        self._channels = channels
        self._sense = sense
        self._clock = clock
        self._step_mm = STEP_MM.get(options.driver, 0.0)

    @property
    def channels(self) -> Sequence[Channel]:
        return self._channels

    def read(self, line: Poll) -> Sequence[Reading]:
        line.asked()
        return [good(self._shown(channel), self._clock.now_s) for channel in self._channels]

    def _shown(self, channel: Channel) -> float:
        value = self._sense(channel.name)
        if channel.unit != "mm" or not self._step_mm:
            return value
        return round(value / self._step_mm) * self._step_mm


@dataclass
class Undisturbed:
    """What was judged of readings that were right. alarms : by channel and reason. unpublished : single readings."""

    hours: float = 0.0
    polls: int = 0
    asked_twice: int = 0
    unpublished: Counter[str] = field(default_factory=Counter)
    alarms: Counter[str] = field(default_factory=Counter)
    states: Counter[str] = field(default_factory=Counter)

    def text(self) -> str:
        """For people."""
        lines = [
            f"{self.hours:.2f} simulated hours without a fault: {self.polls} polls, {self.asked_twice} asked twice",
            f"false alarms: {self.alarms.total()}, {self.alarms.total() / self.hours:.3f} an hour",
            *(f"    {count} times: {what}" for what, count in self.alarms.most_common()),
            f"single readings that were not published: {self.unpublished.total()}",
            *(f"    {count} times: {what}" for what, count in self.unpublished.most_common(20)),
            f"states, ten times a second: {dict(self.states)}",
        ]
        return "\n".join(lines)


class TimeLapse:
    """The simulated machine, and what judges its readings."""

    def __init__(self, path: Path, seed: int) -> None:
        self.result = Undisturbed()
        self._chance = random.Random(seed)
        self._clock = LapsedClock()
        configuration = load(path)
        self._world = World(configuration.geometry, configuration.wiring, seed, zero_hold_s=10.0)
        self._gauges = self._drivers(configuration)
        pipeline = build_pipeline(configuration, self._gauges)
        self._latest, self._settings = pipeline.latest, pipeline.settings
        self.memory = wired_memory(configuration, pipeline.wires)
        trust = wired_trust(configuration, pipeline.wires, self.memory)
        self._polled = [
            PolledGauge(name, gauge, self._latest, REST_AFTER_FAULT_S, STALE_S, self._clock, trust)
            for name, gauge in self._gauges.items()
        ]
        self._unsolved_s = 0.0
        self._poll()
        readings = {c: float(self.memory.shown[i]) for c, i in self.memory.index.items()}
        self._commands = Commands(MachineZero(configuration.zero_hash, STARTED_AT, readings))
        self._state = CycleState.at_start(self._settings.model)
        self._line = b""
        self._votes = Votes(
            configuration.votes,
            self.memory,
            wired_channels(configuration, pipeline.wires, self._settings.model),
            pipeline.wires.quantity_channels,
            self._latest,
            lambda: readings,
            lambda: self._line or None,
            configuration.geometry.scale_signal_period_mm or math.nan,
        )
        self._tick = 0
        self._looked_s = self._clock.now_s
        self._alarmed: set[int] = set()

    def run(self, hours: float, say: Callable[[str], None] = lambda text: None) -> Undisturbed:
        """So many simulated hours: a tour and a rest, again and again."""
        start_s, told_s = self._clock.now_s, time.monotonic()
        resting = False
        while self._clock.now_s < start_s + 3600 * hours:
            part = (self._clock.now_s - start_s) % (TOUR_S + REST_S)
            # it brakes before it rests
            if (part > TOUR_S) != resting and self._world.phase == "dwelling":
                resting = not resting
                self._catch_up()  # or the time that is left over would be spent in motion, at once
                self._world.command(self._world.scale_mm.tolist()) if resting else self._world.start_tour()
            self._advance()
            self._poll()
            if self._clock.now_s >= self._looked_s + LOOK_EVERY_S:
                self._look()
            self.result.hours = (self._clock.now_s - start_s) / 3600
            if time.monotonic() > told_s + 60:
                told_s = time.monotonic()
                alarms = dict(self.result.alarms) or "no alarms"
                say(f"{self.result.hours:.2f} simulated hours, {alarms}")
        return self.result

    def _drivers(self, configuration: Configuration) -> dict[str, Gauge[Any]]:
        sensing = Sensing(configuration, self._world)
        return {
            name: Sensed(configuration.gauges[name], gauge.channels, sensing.of(name), self._clock)
            for name, gauge in configuration.gauge_objects().items()
        }

    def _advance(self) -> None:
        round_s = self._chance.uniform(*ROUND_S)
        if self._chance.random() < LATE_SHARE:
            round_s += self._chance.uniform(0.0, LATE_S)
        self._clock.now_s += round_s
        self._unsolved_s += round_s
        # at rest its parts move with the temperature alone; on a tour it departs at any time
        rests = self._world.mode == "commanded" and self._world.phase == "dwelling"
        if self._unsolved_s >= (THERMAL_STEP_S if rests else 0.0):
            self._catch_up()
        else:
            self._world.advance(0.0)  # the gauges are read again, with other noise

    def _catch_up(self) -> None:
        self._world.advance(self._unsolved_s)
        self._unsolved_s = 0.0

    def _poll(self) -> None:
        """Every gauge once; a second answer where one is asked for comes after a poll's time."""
        for gauge in self._polled:
            poll = Poll(self._advance)
            readings = gauge.read(poll)
            before = dict(gauge.faults)
            gauge.put(readings, self._clock.now_s)
            self.result.polls += 1
            self.result.asked_twice += poll.answers > 1
            for quality, count in gauge.faults.items():
                if count != before[quality] and quality is not Quality.DISTRUSTED:
                    self.result.unpublished[f"{gauge.name}: {gauge.detail}"[:100]] += 1

    def _look(self) -> None:
        self._looked_s = self._clock.now_s
        self._tick += 1
        snapshot = self._latest.snapshot(self._clock.now_s)
        inputs = CycleInputs(self._tick, snapshot, self._commands.zero, None, self._commands.models, "")
        setpoint, self._state = step(self._state, inputs, self._settings)
        self.result.states[str(setpoint.state)] += 1
        self._line = setpoint.to_json()
        self._votes.look(self._clock.now_s)
        for channel, i in self.memory.index.items():
            doubted = Doubt(int(self.memory.doubt[i])).until_accepted
            if doubted and i not in self._alarmed:
                self.result.alarms[f"{channel}: {_without_numbers(self.memory.explanation(i))}"] += 1
                self.memory.accept(channel)
            (self._alarmed.add if doubted else self._alarmed.discard)(i)


def _without_numbers(text: str) -> str:
    return " ".join("..." if any(map(str.isdigit, word)) else word for word in text.split())
