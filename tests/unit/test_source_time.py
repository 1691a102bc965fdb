"""When a value was measured: never in the future, never younger than is known, never backwards."""

from __future__ import annotations

import math

import pytest

from compd.source_time import CLOCK_TOLERANCE_S, AgeUnknownError, Arrival, OutOfOrderError, SourceTime

UTC_S = 1.8e9  # of monotonic 0


def arrival(at_s: float, earliest_s: float = math.nan, holds: bool = False, kept: bool = False) -> Arrival:
    return Arrival(at_s, UTC_S + at_s, earliest_s, holds, kept)


def test_the_time_of_the_source_on_the_monotonic_clock() -> None:
    time = SourceTime("source").of(arrival(100.0), UTC_S + 99.5, 1e-3)
    assert time.time_s == pytest.approx(99.5)
    assert time.window_s == pytest.approx(1e-3)


def test_a_coarse_time_may_be_earlier_by_its_last_digit() -> None:
    assert SourceTime("source").of(arrival(100.4), UTC_S + 100.0, 1.0).window_s == pytest.approx(0.4), (
        "no later than now"
    )


@pytest.mark.parametrize("ahead_s", [0.5 * CLOCK_TOLERANCE_S, 2 * CLOCK_TOLERANCE_S, 1e6])
def test_no_time_is_after_the_arrival(ahead_s: float) -> None:
    time = SourceTime("source").of(arrival(100.0), UTC_S + 100.0 + ahead_s, 0.0)
    assert time.time_s == 100.0
    assert bool(time.note) == (ahead_s > CLOCK_TOLERANCE_S)


def test_a_clock_that_is_ahead_gives_no_age_to_a_value_that_was_kept() -> None:
    with pytest.raises(AgeUnknownError):
        SourceTime("source").of(arrival(100.0, kept=True), UTC_S + 200.0, 0.0)


def test_by_arrival_the_time_of_the_source_does_not_count() -> None:
    times = SourceTime("arrival", period_s=1.0)
    assert times.of(arrival(100.0), UTC_S - 3600.0, 0.0).time_s == 100.0
    assert times.of(arrival(101.0, earliest_s=100.5), UTC_S, 0.0) == (100.5, 0.5, "")


def test_what_comes_after_a_pause_may_have_been_held_up() -> None:
    times = SourceTime("source", period_s=1.0)
    assert times.of(arrival(10.0), math.nan, 0.0).time_s == 10.0
    assert times.of(arrival(11.4), math.nan, 0.0).time_s == 11.4
    for late_s in (13.0, 13.01, 13.9):
        with pytest.raises(AgeUnknownError, match="held up"):
            times.of(arrival(late_s), math.nan, 0.0)
    assert times.of(arrival(14.1), math.nan, 0.0).time_s == 14.1


def test_an_earlier_value_is_out_of_order_and_the_next_goes_on() -> None:
    times = SourceTime("source")
    times.of(arrival(100.0), UTC_S + 99.9, 0.0)
    with pytest.raises(OutOfOrderError, match=r"measured 0\.4 s before"):
        times.of(arrival(100.1), UTC_S + 99.5, 0.0)
    assert times.of(arrival(100.2), UTC_S + 100.1, 0.0).time_s == pytest.approx(100.1)


def test_a_value_that_holds_is_as_new_as_the_last_look_at_it() -> None:
    times = SourceTime("source")
    assert times.of(arrival(100.0, 99.9, holds=True), UTC_S, 0.0).time_s == 99.9
    assert times.of(arrival(100.1, 99.9, holds=True), UTC_S + 100.05, 0.0).time_s == pytest.approx(100.05)
    assert times.of(arrival(100.2, 100.0, holds=True), UTC_S, 0.0).time_s == pytest.approx(100.05), "never backwards"


def test_one_wrong_time_in_the_future_does_not_silence_a_gauge() -> None:
    times = SourceTime("source")
    times.of(arrival(100.0), UTC_S + 1e9, 0.0)
    assert times.of(arrival(100.2), UTC_S + 100.15, 0.0).time_s == pytest.approx(100.15)
