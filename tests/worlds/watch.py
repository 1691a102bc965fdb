"""Watches one world: a digest of its setpoints, its coverage, and what does not hold."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import dataclass, field

from compd.live.loop import Setpoint
from compd.setpoint_states import State
from tests.worlds import invariants
from tests.worlds.blindness import Blindness, Onset
from tests.worlds.coverage import Coverage
from tests.worlds.promises import Promises
from tests.worlds.recovery import Recovery
from tests.worlds.sight import Happening, Sight
from tests.worlds.unknowable import Judge
from tests.worlds.world import Told, World

# From a person's `accept` until every process of the daemon has taken it in, s.
ACCEPTED_WITHIN_S = 0.5
# Work during which the daemon serves its clients without a pause.
QUIET = ("driven", "jogged", "rests", "accept")
# A daemon that starts anew serves its clients after so long, s.
SERVES_AFTER_S = 1.0
# Between two comparisons of the gauges with each other, s.
LOOK_EVERY_S = 0.1


@dataclass
class Finding:
    """Something that did not hold in a world, once for each invariant and each set of faults beside it.

    time_s : of its first occurrence, from the beginning of the plan. count : of setpoints.
    """

    what: str
    blame: str
    time_s: float
    text: str
    count: int = 1

    def __str__(self) -> str:
        return f"{self.what} at {self.time_s:.3f} s, {self.count} times, beside {self.blame}: {self.text}"


@dataclass
class Watch:
    """Hears every setpoint of a world. Nothing in it grows with time but counts.

    found : findings by invariant and faults beside it.
    """

    world: World
    blindness: Blindness
    digest: hashlib._Hash = field(default_factory=hashlib.sha256)
    coverage: Coverage = field(default_factory=Coverage)
    found: dict[tuple[str, str], Finding] = field(default_factory=dict)
    setpoints: int = 0
    hear_also: Callable[[Sight], object] | None = None

    def __post_init__(self) -> None:
        self._began_s = self.world.hub.now_s
        self._recovery = Recovery()
        self._recent: list[Happening] = []
        self._suspects: set[str] = set()
        self._accepted: tuple[float, set[str]] = -math.inf, set()
        self._onsets: list[tuple[Happening, Onset]] = []
        self._before: Setpoint | None = None
        self._judge = Judge(self.world, self.blindness.due_s)
        self.promises = Promises(self.world)
        self._faulty_since_s: float | None = None
        self._without_zero_since_s: float | None = None
        self._setpoint_s = self._disturbed_s = self._began_s
        self.world.hearers.append(self.hear)
        self.world.hub.every(LOOK_EVERY_S, lambda: self.blindness.look(self.world.hub.now_s))

    def begins(self, happening: Happening) -> None:
        """An event begins. Its gauges are suspects until a person has looked; all gauges where it names none."""
        self._recent.append(happening)
        self._recovery.begins(happening)
        if happening.is_fault:
            self._suspects.update(happening.fault.suspects)
        if happening.is_fault and happening.fault.targets:
            onset = self.blindness.begins(happening.fault.began_s, *happening.fault.targets)
            self._onsets.append((happening, onset))

    def accepted(self) -> None:
        """A person has looked at every gauge."""
        now_s = self.world.hub.now_s
        self._recovery.accepted(now_s)
        self.blindness.accept()
        self._faulty_since_s = None
        self._accepted = now_s, self._suspects
        self._suspects = set()
        for happening in self._recent:
            if happening.is_fault and happening.concerns(now_s):
                self._suspects.update(happening.fault.suspects)

    @property
    def asks_for_s(self) -> float:
        """How long the daemon has been asking for a person, s."""
        return 0.0 if self._faulty_since_s is None else self.world.hub.now_s - self._faulty_since_s

    @property
    def lacks_zero_for_s(self) -> float:
        """How long the daemon has had no machine zero, s."""
        return 0.0 if self._without_zero_since_s is None else self.world.hub.now_s - self._without_zero_since_s

    def hear(self, setpoint: Setpoint, told: Told) -> None:
        """Take in one setpoint."""
        self.setpoints += 1
        self.digest.update(setpoint.line or setpoint.to_json())
        now_s = self.world.hub.now_s
        self._recent = [happening for happening in self._recent if happening.concerns(now_s)]
        sight = Sight(
            self.world.running,
            setpoint,
            told,
            self._before,
            tuple(self._recent),
            self._suspects_at(now_s),
            told.error_um,
        )
        left_um, departed = self._judge.judge(setpoint, told, self._hidden(setpoint.time_s), sight.bound_um)
        sight = sight._replace(left_um=left_um, departed=departed)
        self.coverage.count(sight.cases, told.valid, sight.counted_um, sight.bound_um)
        for name, invariant in invariants.OF_SETPOINTS.items():
            if text := invariant(sight):
                self.note(name, sight.blame, text)
        if text := self._recovery.late(sight):
            self.note("valid_again", sight.blame, text)
        if text := invariants.nobody_waits(self._heard_s(now_s), now_s):
            self.note("nobody_waits", sight.blame, text)
        valid_for_s = self.world.running.sockets.target.valid_for_s
        if text := invariants.fresh_target(setpoint, self.world.controller.target_s, valid_for_s):
            self.note("fresh_target", sight.blame, text)
        if text := self.promises.broken(setpoint):
            self.note("adopted_model", sight.blame, text)
        if told.state is not State.FAULT:
            self._faulty_since_s = None
        elif self._faulty_since_s is None:
            self._faulty_since_s = now_s
        if told.state is not State.NO_ZERO:
            self._without_zero_since_s = None
        elif self._without_zero_since_s is None:
            self._without_zero_since_s = now_s
        if told.valid:
            self._before = setpoint
        if self.hear_also is not None:
            self.hear_also(sight)

    def _heard_s(self, now_s: float) -> float:
        """When the client that watches has got a setpoint, s; it is owed none soon after the daemon was disturbed."""
        families = {one.event.family for one in self._recent if one.event.kind not in QUIET}
        if families - {"clients"} or now_s - self._setpoint_s > invariants.HEARS_WITHIN_S:
            self._disturbed_s = now_s
        self._setpoint_s = now_s
        return max(self.world.clients.heard_s, self._disturbed_s + SERVES_AFTER_S)

    def _suspects_at(self, now_s: float) -> frozenset[str]:
        """Gauges that had a fault since a person has looked, as far as the daemon can know of that."""
        accepted_s, before = self._accepted
        return frozenset(self._suspects | before if now_s < accepted_s + ACCEPTED_WITHIN_S else self._suspects)

    def _hidden(self, time_s: float) -> set[str]:
        """Channels of faults that no reading shows yet, and that have an effect at this time, s."""
        for happening, onset in self._onsets:
            if not happening.fault.present and onset.ended_s == math.inf:
                self.blindness.ends(onset, happening.fault.ended_s)
        self._onsets = [one for one in self._onsets if time_s < min(one[1].seen_s, one[1].ended_s)]
        return {channel for _, onset in self._onsets if onset.hides_at(time_s) for channel in onset.channels}

    def note(self, what: str, blame: str, text: str) -> None:
        """Something does not hold now."""
        known = self.found.get((what, blame))
        if known is None:
            self.found[what, blame] = Finding(what, blame, self.world.hub.now_s - self._began_s, text)
        else:
            known.count += 1
