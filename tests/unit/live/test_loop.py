"""The loop's time: absolute wake times, missed cycles skipped whole, statistics that are right."""

from __future__ import annotations

import itertools
import math
import signal
import time
from dataclasses import replace

import pytest

from compd.errors import StateError
from compd.live.loop.commands import Commands
from compd.live.loop.loop import Loop
from compd.live.loop.timing import Histogram, LoopTiming
from compd.live.system import System
from compd.live.system.realtime import sleep_until
from compd.operation_settings import LoopSettings
from compd.setpoint_states import State
from tests.support.live_machine import machine

PERIOD_S = 1 / 128  # exact in binary: tick times compare with ==
LOOP = LoopSettings(rate_hz=128, stale_after_s=0.5, on_stale="hold", hold_s=1, lock_memory=False)
NO_ZERO = Commands(StateError.of("zero", "none"))
TRIPOD = machine()


class TurnedByHand(System):
    """A clock and a sleeper: sleeping turns the clock, each cycle costs what the script says."""

    def __init__(self, costs_s, late_s=lambda: 0.0):
        """`late_s`: by how much the next sleep is too long, s."""
        self.late_s = late_s
        self.now_s = 10.0
        self.costs_s = iter(costs_s)
        self.woken_s = []

    def monotonic(self):
        return self.now_s

    def wait(self, event, timeout_s):
        self.now_s += timeout_s
        return event.is_set()

    def sleep_until(self, time_s):
        time_s += self.late_s()
        self.woken_s.append(time_s)
        self.now_s = max(self.now_s, time_s)


def loop_with(sink, clock):
    """A loop whose machine has no zero, so that its cycles cost next to nothing."""
    cycle = replace(TRIPOD.settings, loop=LOOP)
    return Loop(cycle, TRIPOD.latest, NO_ZERO, [sink], clock)


def run_cycles(costs_s, late_s=0.0):
    """Run one loop for as many cycles as there are costs; the loop, the setpoints' ticks and the clock."""
    clock = TurnedByHand(costs_s, lambda: late_s)
    ticks, done = [], []

    def sink(setpoint):
        assert setpoint.state is State.NO_ZERO
        ticks.append(setpoint.seq)
        clock.now_s = setpoint.time_s + next(clock.costs_s)
        if len(ticks) == len(costs_s):
            done.append(True)

    loop = loop_with(sink, clock)
    loop.run(lambda: not done)
    return loop, ticks, clock


def test_wake_times_are_absolute_whatever_a_cycle_costs():
    loop, ticks, clock = run_cycles([0.001, 0.005, 0.0, 0.007])
    assert clock.woken_s == [10.0 + k * PERIOD_S for k in (1, 2, 3, 4)]
    assert ticks == [1, 2, 3, 4]
    assert loop.timing.missed == 0


def test_a_cycle_that_takes_too_long_costs_whole_cycles_and_they_are_counted():
    loop, ticks, clock = run_cycles([0.001, 2.5 * PERIOD_S, 0.001])
    assert ticks == [1, 2, 5], "ticks 3 and 4 have passed"
    assert clock.woken_s == [10.0 + k * PERIOD_S for k in (1, 2, 5)], "and the grid stays where it was"
    assert (loop.timing.cycles, loop.timing.missed) == (3, 2)


def test_a_late_wake_up_is_lateness_not_a_shift_of_the_grid():
    loop, ticks, clock = run_cycles([0.0] * 4, late_s=0.001)
    assert ticks == [1, 2, 3, 4]
    assert clock.woken_s == [10.001 + k * PERIOD_S for k in (1, 2, 3, 4)]
    summary = loop.timing.summary()
    assert summary["lateness_median_us"] == pytest.approx(1000, abs=5)
    assert summary["period_mean_ms"] == pytest.approx(PERIOD_S * 1e3)
    assert summary["period_deviation_ms"] == pytest.approx(0, abs=1e-6)


def test_a_loop_that_was_stopped_for_a_while_goes_on_at_the_tick_of_now():
    """SIGSTOP, or a computer that slept: the ticks that went by are missed, and none of them is computed late."""
    ticks = []
    clock = TurnedByHand([0.0] * 3, lambda: 10.5 * PERIOD_S if len(ticks) == 1 else 0.0)

    def sink(setpoint):
        ticks.append(setpoint.seq)

    loop = loop_with(sink, clock)
    loop.run(lambda: len(ticks) < 3)
    assert ticks == [1, 12, 13]
    assert (loop.timing.cycles, loop.timing.missed) == (3, 10)


def test_a_loop_that_takes_over_stays_on_the_grid_and_counts_the_ticks_between():
    clock = TurnedByHand([])
    cycle = replace(TRIPOD.settings, loop=LOOP)
    timing = LoopTiming(PERIOD_S)
    ticks = []
    for rounds in (2, 4):
        loop = Loop(cycle, TRIPOD.latest, NO_ZERO, [lambda s: ticks.append(s.seq)], clock, timing)
        loop.run(lambda rounds=rounds: len(ticks) < rounds)
        clock.now_s += 5.5 * PERIOD_S
    assert ticks == [1, 2, 7, 8]
    assert clock.woken_s == [10.0 + k * PERIOD_S for k in ticks]
    assert (timing.cycles, timing.missed) == (4, 4)


def test_the_sleeper_does_not_wake_early_even_through_signals():
    heard = []
    before = signal.signal(signal.SIGALRM, lambda *_: heard.append(time.monotonic()))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.005, 0.005)
        end_s = time.monotonic() + 0.05
        sleep_until(end_s)
        assert time.monotonic() >= end_s
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert heard, "the test is void unless signals came"


def test_a_time_that_has_passed_is_not_slept_for():
    sleep_until(0.0)


def test_period_statistics_are_those_of_the_periods():
    timing = LoopTiming(0.01)
    starts = [0.0, 0.010, 0.021, 0.030, 0.0405]
    for start in starts:
        timing.note_start(start, start)
    periods_ms = [(b - a) * 1e3 for a, b in itertools.pairwise(starts)]
    mean = sum(periods_ms) / len(periods_ms)
    deviation = math.sqrt(sum((p - mean) ** 2 for p in periods_ms) / (len(periods_ms) - 1))
    summary = timing.summary()
    assert summary["period_mean_ms"] == pytest.approx(mean, abs=1e-6)
    assert summary["period_deviation_ms"] == pytest.approx(deviation, abs=1e-6)


def test_a_histogram_says_nothing_of_nothing_and_keeps_the_largest():
    histogram = Histogram()
    assert histogram.summary() == {}
    for us in (*[12.5] * 98, 402.5, 1e6):
        histogram.add(us * 1e-6)
    assert histogram.quantile_us(0.5) == 13
    assert histogram.quantile_us(0.99) == 403
    assert histogram.largest_us == pytest.approx(1e6)
    assert histogram.quantile_us(1.0) == pytest.approx(1e6), "beyond the bins the largest itself is the answer"
