"""Plays a plan in a world and reports what it saw."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from compd.configuration import load
from compd.simulation.truth.motion import Drives
from tests.worlds.blindness import Blindness, listening
from tests.worlds.clients import Recording
from tests.worlds.coverage import NO_FAULT, Coverage
from tests.worlds.faults import begin
from tests.worlds.faults.fault import Fault, mend, present
from tests.worlds.faults.persons import zero
from tests.worlds.invariants import mostly_valid
from tests.worlds.machines import fast, machine_file, measured_errors
from tests.worlds.plan import Event, Plan
from tests.worlds.rates import kinds
from tests.worlds.recorded import recorded
from tests.worlds.sight import Happening, Sight
from tests.worlds.watch import Finding, Watch
from tests.worlds.world import World, built

# How often a person looks at the display, and how long it may ask before the person acts, s.
LOOKS_EVERY_S, ACTS_AFTER_S = 0.25, 3.0
# From the repair of gauges to their acceptance, s.
ACCEPTS_AFTER_S = 0.5
# Until the files of a recording are closed, s.
RECORDED_WITHIN_S = 1.0
# Before the first event, so that what every gauge shows without a fault is known, s.
LISTENS_FIRST_S = 0.3
# Speed of the drives before the first event, mm/s.
_MM_PER_S = 50.0
# Work during which the daemon stops and starts anew.
_STOPS = {"persons.reload"}
_WORK = {f"{kind.family}.{kind.name}" for kind in kinds() if not kind.fault}


@dataclass
class Report:
    """What a world showed. asked : how often a person came."""

    plan: Plan
    setpoints: int
    sha256: str
    coverage: Coverage
    findings: list[Finding]
    asked: int

    @property
    def valid_share(self) -> float:
        return self.coverage.valid.total() / max(1, self.coverage.all.total())


def play(
    plan: Plan,
    hear: Callable[[Sight], object] | None = None,
    until: Callable[[Watch], bool] = lambda watch: False,
    record_to: Path | None = None,
) -> Report:
    """Play a plan.

    hear : called with every setpoint. until : ends the world early; asked after every step. record_to : path of a
    recording without its suffix; the machine's file is put beside it.
    """
    with tempfile.TemporaryDirectory() as directory:
        path = machine_file(plan.machine, Path(directory))
        drives = Drives(_MM_PER_S, plan.mm_per_s2)
        change = partial(fast, mm_per_s2=plan.mm_per_s2)
        with built(path, plan.seed, drives, change, measured_errors) as world:
            blindness = Blindness.of(world.configuration)
            with listening(blindness):
                world.run(LISTENS_FIRST_S)
                return _Play(plan, world, blindness, hear).run(until, record_to)


def _recording(world: World, name: Path) -> Recording:
    """Record the world, with its machine's file beside the recording."""
    machine = name.with_name(f"{name.name}.machine.yaml")
    machine.write_text(world.configuration.path.read_text())
    return world.clients.record(name, load(machine))


class _Play:
    """One plan in its world."""

    def __init__(self, plan: Plan, world: World, blindness: Blindness, hear: Callable[[Sight], object] | None) -> None:
        self._plan, self._world = plan, world
        self._watch = Watch(world, blindness, hear_also=hear)
        self._asked = 0
        self._began_s = world.hub.now_s
        self._taking: Fault | None = None

    def run(self, until: Callable[[Watch], bool], record_to: Path | None = None) -> Report:
        plan, watch, world = self._plan, self._watch, self._world
        recording = None if record_to is None else _recording(world, record_to)
        for event in plan.events:
            self._until(event.time_s, until)
            if until(watch):
                break
            self._begin(event)
        self._until(plan.duration_s, until)
        if recording is not None:
            recording.end()
            world.run(RECORDED_WITHIN_S)
            if text := recorded(recording, world.configuration):
                watch.note("recorded", self._blame(), text)
        without_faults = all(event.name in _WORK - _STOPS for event in plan.events)
        if text := mostly_valid(watch.coverage, without_faults):
            watch.note("mostly_valid", NO_FAULT, text)
        return Report(
            plan,
            watch.setpoints,
            watch.digest.hexdigest(),
            watch.coverage,
            list(watch.found.values()),
            self._asked,
        )

    def _until(self, time_s: float, until: Callable[[Watch], bool]) -> None:
        """Let time pass to `time_s` of the plan, with a person who looks now and then."""
        world, watch = self._world, self._watch
        while (left_s := self._began_s + time_s - world.hub.now_s) > 0 and not until(watch):
            world.run(min(left_s, LOOKS_EVERY_S))
            world.forget()
            if world.died:
                watch.note("no_traceback", self._blame(), world.died[-1])
            if text := watch.promises.zero_lost():
                watch.note("nothing_lost", self._blame(), text)
            if watch.asks_for_s >= ACTS_AFTER_S:
                self._asked += 1
                mend(world)
                world.run(ACCEPTS_AFTER_S)
                world.accept()
                watch.accepted()
            if watch.lacks_zero_for_s >= ACTS_AFTER_S and (self._taking is None or not self._taking.present):
                self._asked += 1
                self._taking = zero(world, "")

    def _begin(self, event: Event) -> None:
        fault = begin(self._world, event.family, event.kind, event.target, event.parameters)
        self._watch.begins(Happening(event, fault, event.name not in _WORK))

    def _blame(self) -> str:
        return f"{len(present(self._world))} faults present"
