"""What the readings can show and what they cannot, of any machine's motion; and in worlds."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from compd.configuration import load
from compd.live.acquisition import LOOK_EVERY_S
from compd.simulation.truth.motion import Drives, SetpointMotion, standing
from tests.support.paths import CONFIG
from tests.worlds.blindness import Blindness, Onset, Stated, left_out, listening, stated_channels
from tests.worlds.faults.computer import keep_busy
from tests.worlds.faults.gauges import shift
from tests.worlds.faults.lines import cable
from tests.worlds.faults.replies import lost
from tests.worlds.faults.wiring import line_of, scales
from tests.worlds.possible_readings import PossibleMotion
from tests.worlds.redundancy import Relation, following
from tests.worlds.world import World, built

A_MM_PER_S2, NOISE_MM, LATE_S = 300.0, 2e-4, 1e-3
GAUGE = "scale"
LENGTH = Stated(NOISE_MM, NOISE_MM / 6, acceleration=A_MM_PER_S2)
THERMOMETER = Stated(0.06, 0.01, per_s=10.0 / 3600.0, lowest=-20.0, highest=150.0)

drives = st.builds(Drives, st.floats(5.0, 500.0), st.floats(20.0, A_MM_PER_S2))
polls = st.floats(3e-3, 0.12)
seeds = st.integers(0, 2**32 - 1)
# Added to the true place (mm) at a time (s).
Added = Callable[[float, float], float]


class Driven:
    """A link that is sent from place to place at any moments, and polled; what its gauge adds is given."""

    def __init__(self, seed: int, drives: Drives, poll_s: float, reach_mm: float = 40.0) -> None:
        self.rng = np.random.default_rng(seed)
        self.watch = Blindness({GAUGE: LENGTH})
        self.longest_s = 0.0
        self.now_s = 0.0
        self.late_s = 0.0  # of the last sample
        self.true_mm = 0.0
        self._motion = SetpointMotion(standing(np.zeros(1)), drives)
        self._poll_s, self._reach_mm = poll_s, reach_mm

    def poll(self, count: int, added: Added = lambda time_s, mm: mm) -> None:
        for _ in range(count):
            wait_s = self._poll_s * self.rng.uniform(1.0, 1.3) - self.late_s
            self.late_s = self.rng.uniform(0.0, LATE_S)
            if self._reach_mm and self.rng.random() < min(1.0, 2.0 * self._poll_s):
                self._motion.setpoint_mm = self.rng.uniform(-self._reach_mm, self._reach_mm, 1)
            self._motion.advance(wait_s + self.late_s)
            self.longest_s = max(self.longest_s, wait_s + LATE_S)
            self.now_s += wait_s
            self.true_mm = float(self._motion.position_mm[0])
            shown = added(self.now_s + self.late_s, self.true_mm) + 0.5 * NOISE_MM * self.rng.uniform(-1.0, 1.0)
            self.watch.read(GAUGE, self.now_s, round(shown / NOISE_MM) * NOISE_MM, LATE_S)
            self.now_s += self.late_s

    def unsure_mm(self, speed: float) -> float:
        """By how much noise and times of readings can be wrong, mm."""
        return 8 * NOISE_MM + 4 * LATE_S * (speed + 2 * A_MM_PER_S2 * self.longest_s + A_MM_PER_S2 * LATE_S)


@given(seeds, drives, polls)
def test_no_motion_of_a_machine_without_a_fault_is_a_contradiction(seed: int, drives: Drives, poll_s: float) -> None:
    driven = Driven(seed, drives, poll_s)
    driven.poll(150)
    assert driven.watch.since_s() == math.inf


@given(seeds, st.floats(1.0, 3.0), st.sampled_from([-1.0, 1.0]), polls)
def test_a_step_at_rest_above_a_t2_is_visible_within_two_polls(
    seed: int, ratio: float, sign: float, poll_s: float
) -> None:
    driven = Driven(seed, Drives(), poll_s, reach_mm=0.0)
    driven.poll(20)
    onset = driven.watch.begins(driven.now_s)
    step_mm = sign * (ratio * A_MM_PER_S2 * (1.3 * poll_s + LATE_S) ** 2 + driven.unsure_mm(0.0))
    driven.poll(2, lambda time_s, mm: mm + step_mm)
    assert onset.seen_s < math.inf
    assert left_out([onset], onset.began_s)
    assert not left_out([onset], driven.now_s)


@given(seeds, drives, st.sampled_from([-1.0, 1.0]), polls)
def test_a_step_of_twice_a_t2_is_visible_within_two_polls_of_any_motion(
    seed: int, drives: Drives, sign: float, poll_s: float
) -> None:
    driven = Driven(seed, drives, poll_s)
    driven.poll(30)
    onset = driven.watch.begins(driven.now_s)
    step_mm = sign * (2 * A_MM_PER_S2 * (1.3 * poll_s + LATE_S) ** 2 + driven.unsure_mm(drives.mm_per_s))
    driven.poll(2, lambda time_s, mm: mm + step_mm)
    assert onset.seen_s < math.inf


@given(seeds, st.floats(5.0, 200.0), st.floats(20.0, A_MM_PER_S2), st.floats(-1.0, 1.0), polls)
def test_a_creep_within_the_acceleration_that_is_left_stays_invisible(
    seed: int, speed: float, acceleration: float, share: float, poll_s: float
) -> None:
    driven = Driven(seed, Drives(speed, acceleration), poll_s)
    driven.poll(20)
    onset = driven.watch.begins(driven.now_s)
    creep = share * (A_MM_PER_S2 - acceleration)
    driven.poll(100, lambda time_s, mm: mm + 0.5 * creep * (time_s - onset.began_s) ** 2)
    assert left_out([onset], driven.now_s)


@given(seeds, st.floats(-1.0, 1.0), polls)
def test_a_gain_from_zero_on_stays_invisible(seed: int, share: float, poll_s: float) -> None:
    drives = Drives(50.0, 200.0)
    driven = Driven(seed, drives, poll_s)
    onset = driven.watch.begins(0.0)
    driven.poll(150, lambda time_s, mm: share * A_MM_PER_S2 / drives.mm_per_s2 * mm)
    assert onset.hides_at(driven.now_s)


def test_the_speeds_between_exact_readings_are_those_that_the_part_may_have() -> None:
    """At rest at every reading a part may swing between them: with +A and -A by turns, by A t / 2 at a reading."""
    motion = PossibleMotion(A_MM_PER_S2, 0.0)
    for k in range(40):
        assert motion.follow(0.1 * k, 0.0, 0.0)
    assert motion.speeds == pytest.approx((-15.0, 15.0), rel=0.05)
    assert motion.follow(4.0, 2.9, 0.0)  # with A all the time: (15 + 15) * 0.1
    assert not motion.follow(4.1, 2.9, 0.0)


# --- gaps, quantities, digits, relations --------------------------------------------------------------------------


def polled(watch: Blindness, until_s: float, value: Callable[[float], float], begin_s: float = 0.0) -> None:
    for time_s in np.arange(begin_s, until_s, 0.01).tolist():
        watch.read(GAUGE, time_s, value(time_s), LATE_S)


@pytest.mark.parametrize(("gap_s", "missed", "visible"), [(0.6, True, True), (0.6, False, True), (0.4, True, False)])
def test_a_gap_in_which_a_display_could_have_restarted_shows_what_happened_in_it(
    gap_s: float, missed: bool, visible: bool
) -> None:
    watch = Blindness({GAUGE: LENGTH})
    polled(watch, 1.0, lambda _: 0.0)
    before, within = watch.begins(0.9), watch.begins(1.1)
    if missed:
        watch.miss(GAUGE, 1.2)
    polled(watch, 3.0, lambda _: 0.01, begin_s=0.99 + gap_s)
    assert before.hides_at(2.9)
    assert within.hides_at(2.9) is not visible
    if visible:
        assert within.seen_s == pytest.approx(1.49)
    assert watch.since_s() == math.inf


def test_a_lost_line_shows_what_happened_while_it_was_lost() -> None:
    watch = Blindness({GAUGE: LENGTH})
    polled(watch, 1.0, lambda _: 0.0)
    watch.miss(GAUGE, 1.05, lost=True)
    onset = watch.begins(1.1)
    polled(watch, 1.4, lambda _: 0.001, begin_s=1.2)
    assert onset.seen_s == pytest.approx(1.1)
    after = watch.begins(1.41)
    polled(watch, 3.0, lambda _: 0.001, begin_s=1.42)
    assert after.hides_at(2.9)


@pytest.mark.parametrize(
    ("step_mm", "other_mm", "ramp_s", "seen"),
    [
        (0.02, 0.0, 0.0, True),
        (0.02, 0.02, 0.0, False),  # the machine may have been jogged
        (0.02, 0.0, 0.3, False),  # a creep
        (3e-4, 0.0, 0.0, False),  # within the noise
    ],
)
def test_a_step_of_one_length_at_rest_shows_itself(step_mm: float, other_mm: float, ramp_s: float, seen: bool) -> None:
    watch = Blindness({"a": LENGTH, "b": LENGTH})
    onset = None
    for k in range(200):
        time_s = 0.01 * k
        if k == 100:
            onset = watch.begins(time_s - 0.005, "a")
        share = 0.0 if k < 100 else min(1.0, (time_s - 1.0) / ramp_s) if ramp_s else 1.0
        watch.read("a", time_s, share * step_mm, LATE_S)
        watch.read("b", time_s + 0.001, share * other_mm, LATE_S)
    assert onset is not None
    assert (onset.seen_s < 1.05) is seen
    assert watch.since_s() == math.inf


def test_a_gauge_that_is_polled_seldom_has_no_gaps() -> None:
    watch = Blindness({GAUGE: THERMOMETER})
    for k in range(100):
        watch.read(GAUGE, 5.0 * k, 20.0)
    onset = watch.begins(497.0)
    watch.read(GAUGE, 500.0, 20.0)
    assert onset.hides_at(501.0)


@pytest.mark.parametrize(
    ("wrong", "seen_s"),
    [(lambda s: 20.0 + s / 720, math.inf), (lambda s: 20.0 + 0.02 * s, 9.0), (lambda _: 200.0, 1.0)],
)
def test_a_thermometer_changes_at_its_usual_rate(wrong: Callable[[float], float], seen_s: float) -> None:
    watch = Blindness({GAUGE: THERMOMETER})
    polled(watch, 1.0, lambda _: 20.0)
    onset = watch.begins(1.0)
    polled(watch, 300.0, lambda time_s: wrong(time_s - 1.0), begin_s=1.0)
    assert onset.seen_s == pytest.approx(seen_s, abs=1.0)


def test_noise_that_stops_shows_a_stuck_gauge_where_it_exceeds_the_digit() -> None:
    rng = np.random.default_rng(0)
    for digit_mm, visible in ((1e-4, True), (1e-2, False)):
        watch = Blindness({GAUGE: LENGTH._replace(noise=6e-3, sigma=1e-3)})
        polled(watch, 60.0, lambda _, digit_mm=digit_mm: round(rng.normal(0.0, 1e-3) / digit_mm) * digit_mm)
        onset = watch.begins(60.0)
        polled(watch, 70.0, lambda _: 0.0, begin_s=60.0)
        assert onset.hides_at(69.0) is not visible


def test_a_relation_shows_what_its_gauges_do_not() -> None:
    channels = dict.fromkeys(("a.1", "b.1", "c.1"), LENGTH)
    pair = Relation(("a.1", "b.1"), lambda now, start: (now[0] - start[0]) - (now[1] - start[1]), 0.05, 0.5)
    watch = Blindness(channels, [pair])
    hidden, found = watch.begins(1.0, "c"), watch.begins(1.0, "a")
    for k in range(400):
        now_s = 0.01 * k
        for name in channels:
            watch.read(name, now_s, 3.0 + (0.1 * max(0.0, now_s - 1.0) if name != "b.1" else 0.0))
        if k % 10 == 0:
            watch.look(now_s)
    assert found.seen_s == pytest.approx(2.0, abs=0.15)
    assert hidden.hides_at(4.0)
    assert watch.since_s("b") == found.seen_s
    watch.accept("a")
    watch.accept("b")
    assert watch.since_s() == math.inf


def test_a_command_shows_a_scale_that_creeps() -> None:
    commanded_mm = [0.0]
    watch = Blindness({GAUGE: LENGTH}, [following(GAUGE, -1, lambda: commanded_mm[0], 0.02)])
    onset = watch.begins(1.0)
    for k in range(500):
        now_s = 0.01 * k
        commanded_mm[0] = now_s
        watch.read(GAUGE, now_s, -now_s - 0.01 * max(0.0, now_s - 1.0))
        if k % 10 == 0:
            watch.look(now_s)
    assert 3.0 < onset.seen_s < 4.3


def test_a_configuration_states_its_relations() -> None:
    configuration = load(CONFIG / "tripod-cmm.yaml")
    watch = Blindness.of(configuration)
    channels = stated_channels(configuration)
    onset, other = watch.begins(2.0, "cabinet.t1"), watch.begins(2.0, "frame_u.u1")
    for k in range(1000):
        now_s = 0.01 * k
        for name in channels:
            value = 20.0 if name.startswith("cabinet") and name[-2] != "t" else 0.0
            creeps = name in ("cabinet.t1", "frame_u.u1")
            watch.read(name, now_s, value + (0.01 * max(0.0, now_s - 2.0) if creeps else 0.0))
        if k % 10 == 0:
            watch.look(now_s)
    assert 2.9 < onset.seen_s < 3.3  # 10 um at 10 um/s
    assert other.hides_at(9.0)


def test_an_ended_fault_hides_nothing_any_more() -> None:
    watch = Blindness({GAUGE: LENGTH})
    onset = watch.begins(1.0)
    watch.ends(onset, 2.0)
    assert left_out([onset], 1.5)
    assert not left_out([onset], 2.0)
    assert not left_out([Onset(3.0, frozenset())], 2.9)


def test_a_reading_costs_little() -> None:
    rng = np.random.default_rng(0)
    shown = [(0.01 * k, value) for k, value in enumerate(rng.normal(0.0, 3e-5, 5_000).tolist())]

    def costs_s() -> float:
        watch = Blindness({GAUGE: LENGTH})
        begin_s = time.process_time()
        for time_s, value in shown:
            watch.read(GAUGE, time_s, value, LATE_S)
        return (time.process_time() - begin_s) / len(shown)

    assert min(costs_s() for _ in range(10)) < 5e-6


# --- in worlds ----------------------------------------------------------------------------------------------------


def watched(world: World, watch: Blindness) -> None:
    world.hub.every(LOOK_EVERY_S, lambda: watch.look(world.hub.now_s))


def drive(world: World, rng: np.random.Generator, count: int) -> None:
    for _ in range(count):
        world.drive(rng.uniform(-40.0, 40.0, len(world.scale_mm())))
        world.arrive()
        world.run(rng.uniform(0.0, 0.5))


def drives_faster(document: dict[str, Any]) -> None:
    for wire in document["wiring"]["scale"]:
        document["gauges"][wire["gauge"]]["acceleration_mm_per_s2"] = 4000.0


@pytest.mark.parametrize("name", ["tripod-cmm.yaml", pytest.param("hexapod.yaml", marks=pytest.mark.long)])
@pytest.mark.parametrize(
    "fast", [False, pytest.param(True, marks=pytest.mark.long)], ids=["busy computer", "fast drives"]
)
def test_a_world_without_faults_of_gauges_shows_none(name: str, fast: bool) -> None:
    watch = Blindness.of(load(CONFIG / name))
    if fast:
        watch = Blindness(
            {
                channel: stated._replace(acceleration=4000.0) if channel.startswith("scale") else stated
                for channel, stated in stated_channels(load(CONFIG / name)).items()
            }
        )
    drives, change = (Drives(500.0, 3333.0), drives_faster) if fast else (Drives(), lambda _: None)
    with listening(watch), built(CONFIG / name, 3, drives, change) as world:
        watched(world, watch)
        if not fast:
            keep_busy(world, 2.0)
        drive(world, np.random.default_rng(3), 3)
    assert watch.since_s() == math.inf


def test_in_a_world_each_fault_is_visible_or_left_out() -> None:
    with (
        listening(watch := Blindness.of(load(CONFIG / "tripod-cmm.yaml"))),
        built(CONFIG / "tripod-cmm.yaml", 5) as world,
    ):
        watched(world, watch)
        one, two, three = scales(world)
        small = watch.begins(world.hub.now_s, one)
        shift(world, one, lambda _, mm: mm + 0.02 * min(max(world.hub.now_s - small.began_s, 0.0), 0.25))  # a creep
        world.run(0.5)
        large = watch.begins(world.hub.now_s, two)
        shift(world, two, 0.5)
        world.run(0.5)
        lost(world, line_of(world, three), 3)
        brief = watch.begins(world.hub.now_s + 0.01, three)
        world.run(0.5)
        cable(world, line_of(world, three), 0.2)
        world.run(0.05)
        gone = watch.begins(world.hub.now_s, three)
        world.run(0.5)
        now_s = world.hub.now_s
    assert small.hides_at(now_s)
    assert brief.hides_at(now_s)
    assert 0.0 < large.seen_s - large.began_s < 0.03, large.why
    assert gone.seen_s == gone.began_s
    assert left_out([small, large], now_s)
    assert not left_out([large, gone], now_s)
