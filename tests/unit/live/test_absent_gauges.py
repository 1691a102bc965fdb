"""Gauges that do not answer: how long they rest, and what the others on their line lose."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import pytest
import structlog

from compd.gauge import LineFault, Quality, Reading, bad, good
from compd.live.acquisition.polled_gauge import MAX_FAILURES
from tests.support.sampled import sampled
from tests.support.scripted_thread import STALE_AFTER_S, ScriptedGauge, ScriptedThread, polls_with_faults


def test_an_absent_unit_rests_and_the_others_go_on() -> None:
    def present() -> list[Reading]:
        scripted.clock.now_s += 0.01
        if scripted.clock.now_s > 120.0:
            scripted.thread.stop()
        return [good(1.0, scripted.clock.now_s)]

    def absent() -> list[Reading]:
        scripted.clock.now_s += 0.1
        raise LineFault(Quality.TIMEOUT, "no byte")

    scripted = ScriptedThread(ScriptedGauge(present), ScriptedGauge(absent))
    scripted.run()
    status = scripted.thread.status()["gauges"]
    assert status["g1"]["faults"] == {"timeout": status["g1"]["polls"]}
    assert status["g1"]["polls"] == 31, "ten without a rest, then rests of 0.1, 0.2, 0.4 and 0.8 s, then of 0.9 s"
    assert status["g0"]["polls"] > 1000
    assert scripted.lines[0].drained == 0, "a miss costs the others one timeout"


@pytest.mark.parametrize(("misses", "rests_s"), [(3, 0.0), (MAX_FAILURES, 0.0), (MAX_FAILURES + 3, 0.1 + 0.2 + 0.4)])
def test_a_unit_that_answers_again_is_polled_at_full_pace(misses: int, rests_s: float) -> None:
    polls = 0

    def poll() -> list[Reading]:
        nonlocal polls
        polls += 1
        if polls <= misses:
            scripted.clock.now_s += 0.1
            raise LineFault(Quality.TIMEOUT, "no byte")
        scripted.clock.now_s += 0.01
        return [good(float(polls), scripted.clock.now_s)]

    def other() -> list[Reading]:
        scripted.clock.now_s += 0.01
        if scripted.clock.now_s > 104.0:
            scripted.thread.stop()
        return [good(1.0, scripted.clock.now_s)]

    scripted = ScriptedThread(ScriptedGauge(poll), ScriptedGauge(other))
    scripted.run()
    times_s = [reading.time_s for name, reading in scripted.latest.history if name == "g0.c0" and reading.ok]
    assert times_s[0] == pytest.approx(100.0 + misses * 0.1 + rests_s, abs=0.02 * misses + 0.06)
    assert times_s[-1] - times_s[0] == pytest.approx(0.02 * (len(times_s) - 1)), "then at once"


def test_a_gauge_with_a_line_of_its_own_rests_after_ten_misses_too() -> None:
    scripted = polls_with_faults(None, *[LineFault(Quality.TIMEOUT, "no byte")] * (MAX_FAILURES + 2))
    assert [wait for wait in scripted.clock.waits_s if wait >= 0.05] == pytest.approx([0.1, 0.2])


def test_a_channel_that_is_always_faulty_does_not_make_its_neighbours_rest() -> None:
    polls = 0

    def poll() -> list[Reading]:
        nonlocal polls
        polls += 1
        scripted.clock.now_s += 0.1
        if polls == 10:
            scripted.thread.stop()
        if polls % 2 == 0:
            raise LineFault(Quality.TIMEOUT, "no byte")
        return [good(1.0, scripted.clock.now_s), bad(scripted.clock.now_s, Quality.SENSOR_FAULT)]

    scripted = ScriptedThread(ScriptedGauge(poll, channels=2))
    scripted.run()
    assert [wait for wait in scripted.clock.waits_s if wait >= 0.05] == []


class SlowBus:
    """Six gauges in virtual time, 10 ms each, and `wait_s` for one that is dead; which snapshots had fresh readings."""

    UNITS = 6

    def __init__(self, wait_s: float, until_s: float, quality: Quality) -> None:
        self.dead: set[int] = set()
        self.asked: list[tuple[int, float]] = []
        self.last_s = [0.0] * self.UNITS
        self.stale: list[tuple[float, float]] = []  # from, to: one of those that live had no fresh reading
        self._wait_s = wait_s
        self._until_s = until_s
        self._quality = quality
        self.scripted = ScriptedThread(
            *[ScriptedGauge(lambda unit=unit: self.poll(unit)) for unit in range(self.UNITS)]
        )
        self.start_s = self.scripted.clock.now_s
        self.last_s = [self.start_s] * self.UNITS
        self.at: dict[float, Callable[[], None]] = {}

    def poll(self, unit: int) -> list[Reading]:
        clock = self.scripted.clock
        for time_s in [time_s for time_s in self.at if clock.now_s - self.start_s >= time_s]:
            self.at.pop(time_s)()
        if clock.now_s - self.start_s > self._until_s:
            self.scripted.thread.stop()
        self.asked.append((unit, clock.now_s - self.start_s))
        if unit in self.dead:
            clock.now_s += self._wait_s
            raise LineFault(self._quality, "no answer")
        clock.now_s += 0.01
        if clock.now_s - self.last_s[unit] > STALE_AFTER_S:
            self.stale.append((self.last_s[unit] + STALE_AFTER_S - self.start_s, clock.now_s - self.start_s))
        self.last_s[unit] = clock.now_s
        return [good(1.0, clock.now_s)]

    def times_s(self, unit: int) -> list[float]:
        return [time_s for asked, time_s in self.asked if asked == unit]

    def stale_share(self, from_s: float, to_s: float) -> float:
        """Part of that time in which a gauge had no fresh reading; at most: several may have been stale at once."""
        spans = [(max(begin, from_s), min(end, to_s)) for begin, end in self.stale]
        instants = [from_s + 0.01 * k for k in range(int((to_s - from_s) / 0.01))]
        return sum(any(a <= t < b for a, b in spans) for t in instants) / len(instants)


@pytest.mark.parametrize("quality", sampled([Quality.TIMEOUT, Quality.DEVICE_ERROR], 2))
def test_a_unit_that_makes_the_others_stale_is_asked_seldom(quality: Quality) -> None:
    bus = SlowBus(1.0, 610.0, quality)
    bus.at[10.0] = lambda: bus.dead.add(2)
    with structlog.testing.capture_logs() as logs:
        bus.scripted.run()
    asked_s = [time_s for time_s in bus.times_s(2) if time_s > 10.0]
    assert len(asked_s) == 2 + 5, "twice at first, then after a hundred times the second that each one costs"
    assert bus.stale_share(10.0, 30.0) < 0.08
    assert bus.stale_share(30.0, 600.0) < 0.01
    (event,) = [entry for entry in logs if entry["event"] == "gauge is polled seldom"]
    assert (event["gauge"], event["cost_s"], event["rest_s"]) == ("g2", pytest.approx(1.01), pytest.approx(101.0))


def test_a_unit_that_is_asked_seldom_is_asked_at_once_where_a_client_wants_it() -> None:
    bus = SlowBus(1.0, 90.0, Quality.TIMEOUT)
    bus.at[10.0] = lambda: bus.dead.add(2)
    for time_s in (40.0, 60.0):
        bus.at[time_s] = lambda: bus.scripted.poll_requests.add("g2")
    bus.at[50.0] = bus.dead.clear
    bus.scripted.run()
    asked_s = [time_s for time_s in bus.times_s(2) if time_s > 30.0]
    assert asked_s[0] == pytest.approx(40.0, abs=0.2)
    assert asked_s[1] == pytest.approx(60.0, abs=0.2), "it did not answer at 40 s, and rests again"
    assert asked_s[2] < 60.5
    assert bus.scripted.latest.wait_for("g2.c0", Quality.OK).ok


def test_a_unit_that_misses_once_is_asked_again_within_a_second() -> None:
    bus = SlowBus(1.0, 60.0, Quality.TIMEOUT)
    for time_s in (10.0, 20.0, 30.0):
        bus.at[time_s] = lambda: bus.dead.add(2)
        bus.at[time_s + 0.5] = bus.dead.clear
    bus.scripted.run()
    asked_s = bus.times_s(2)
    assert max(late - soon for soon, late in pairwise(asked_s)) < 2.0


def test_units_that_come_back_together_are_all_asked_within_a_second() -> None:
    bus = SlowBus(1.0, 100.0, Quality.TIMEOUT)
    bus.at[10.0] = lambda: bus.dead.update(range(6))
    bus.at[60.0] = bus.dead.clear
    bus.scripted.run()
    back_s = [min(time_s for time_s in bus.times_s(unit) if time_s > 60.0) for unit in range(6)]
    assert max(back_s) < 63.0
