"""The motion that readings show, and where it carries them: truths in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from compd.gauge import Quality, Reading, bad, good
from compd.live.acquisition.motion_estimate import MotionEstimate, estimated_motion
from compd.live.acquisition.possible_motion import GaugeSample
from compd.live.machine.wiring import Wire, Wires
from compd.live.memory.latest import Snapshot
from compd.live.memory.readings import Readings

ROUND_S = 0.04
TOLERANCE_MM = 0.001


def motion(values, times_s=None):
    times_s = [ROUND_S * k for k in range(len(values))] if times_s is None else times_s
    samples = [GaugeSample(value, time_s, 1e-3) for value, time_s in zip(values, times_s, strict=True)]
    return estimated_motion(samples, TOLERANCE_MM)


A_MM_PER_S2 = 300.0
SCALE = Wires([Wire("scale_1.position", "scale 1", 0, 1, math.inf, acceleration_mm_per_s2=A_MM_PER_S2)])


def extrapolated(reading, now_s):
    return SCALE.read(Snapshot(now_s, Readings.of([reading])), np.zeros(1), extrapolate=True).values[0]


def age_bound_mm(reading, now_s, extrapolate=True):
    return SCALE.age_bound_mm(Snapshot(now_s, Readings.of([reading])), 1, extrapolate, math.inf)[0][0]


def carried(values, age_s):
    return extrapolated(good(values[-1], 0.0)._replace(motion=motion(values)), age_s)


@pytest.mark.parametrize("speed", [50.0, -50.0, 0.3])
def test_a_steady_motion_is_carried_on_to_the_time_of_the_cycle(speed):
    values = [speed * ROUND_S * k for k in range(12)]
    assert motion(values).speed_mm_per_s == pytest.approx(speed)
    assert carried(values, 0.03) == pytest.approx(values[-1] + speed * 0.03)


def test_a_drift_of_less_than_the_scatter_from_poll_to_poll_is_carried_on_too():
    rng = np.random.default_rng(3)
    values = [0.005 * ROUND_S * k + rng.normal(0.0, 0.0001) for k in range(30)]
    assert motion(values).speed_mm_per_s == pytest.approx(0.005, rel=0.3)


def test_noise_alone_is_no_motion():
    rng = np.random.default_rng(4)
    for _ in range(200):
        values = rng.normal(0.0, 0.0001, 20).tolist()
        assert motion(values).speed_mm_per_s == 0.0
        assert carried(values, 0.05) == values[-1]


def test_a_single_step_is_not_carried_on_and_its_speed_is_in_the_uncertainty():
    step = motion([0.0] * 10 + [0.5])
    assert step.speed_mm_per_s == 0.0
    assert step.u_mm_per_s >= 0.5 / ROUND_S
    assert motion([0.0] * 10 + [0.5, 0.5]).speed_mm_per_s == 0.0


@pytest.mark.parametrize("last_mm", [0.5, 5.0, 9.0, 10.0])
@pytest.mark.parametrize("round_s", [0.01, 0.04, 0.3])
def test_what_the_last_two_readings_show_at_rest_is_at_rest_however_it_came_there(last_mm, round_s):
    moving = [10.0 * k for k in range(6)]
    end = moving[-1] + last_mm
    for rounds_at_rest in range(1, 6):
        values = [*moving, *[end] * (1 + rounds_at_rest)]
        shown = motion(values, [round_s * k for k in range(len(values))])
        assert shown.speed_mm_per_s == 0.0
        if rounds_at_rest == 1 and round_s < 0.25:
            assert shown.u_mm_per_s >= last_mm / round_s / 2, "it may be where it turns round"
        if rounds_at_rest > 1:
            assert shown.u_mm_per_s < 0.01, "it stands"


def test_a_motion_that_turns_is_not_carried_on():
    assert motion([0.0, 1.0, 2.0, 3.0, 2.0]).speed_mm_per_s == 0.0


def test_a_part_that_brakes_is_carried_on_to_its_standstill_and_not_beyond():
    braking, speed = 250.0, 20.0  # at the last reading; it stands after 0.08 s, 0.8 mm further
    times_s = [-ROUND_S * k for k in range(6, -1, -1)]
    values = [speed * t - 0.5 * braking * t * t for t in times_s]
    shown = motion(values, times_s)
    assert shown.speed_mm_per_s == pytest.approx(speed)
    assert shown.braking_mm_per_s2 == pytest.approx(braking)
    reading = good(values[-1], 0.0)._replace(motion=shown)
    assert extrapolated(reading, 0.04) == pytest.approx(speed * 0.04 - 0.5 * braking * 0.04**2)
    assert extrapolated(reading, 0.08) == pytest.approx(0.8)
    assert extrapolated(reading, 0.3) == pytest.approx(0.8, abs=1e-4)


def test_a_gauge_that_falls_silent_is_not_carried_away():
    values = [50.0 * ROUND_S * k for k in range(12)]
    end = values[-1] + 50.0 * 2 * ROUND_S
    assert [carried(values, age_s) for age_s in (0.08, 0.1, 0.5)] == pytest.approx([end] * 3)


def test_where_a_round_takes_long_nothing_is_carried_on_for_longer_than_drives_take_to_stop():
    slow = [50.0 * 0.2 * k for k in range(6)]
    shown = motion(slow, [0.2 * k for k in range(6)])
    assert shown.speed_mm_per_s == pytest.approx(50.0)
    assert shown.horizon_s == 0.15


def test_a_start_is_carried_on_with_at_most_twice_the_speed_before():
    assert motion([0.0, 0.0, 0.1, 1.0]).speed_mm_per_s == pytest.approx(2 * 0.1 / ROUND_S)


def test_too_few_readings_have_no_known_motion():
    assert math.isnan(motion([1.0]).u_mm_per_s)
    reading = good(1.0, 0.0)._replace(motion=motion([1.0]))
    assert extrapolated(reading, 0.1) == 1.0
    assert math.isnan(age_bound_mm(reading, 0.1))


def test_readings_at_the_same_time_have_no_speed():
    assert motion([0.0, 1.0], [5.0, 5.0]).speed_mm_per_s == 0.0


def test_the_bound_is_what_a_limited_acceleration_allows():
    shown = motion([50.0 * ROUND_S * k for k in range(12)])._replace(late_s=1e-3)
    late_mm = 1e-3 * (50.0 + 1.96 * shown.u_mm_per_s)
    reading = Reading(1.0, 10.0, Quality.OK, "", shown)
    for age_s in (0.02, 0.05, 0.08, 0.4):
        not_carried_mm = 50.0 * max(age_s - shown.horizon_s, 0.0)
        by_limit_mm = 0.5 * A_MM_PER_S2 * age_s * (age_s + ROUND_S)
        assert age_bound_mm(reading, 10.0 + age_s) == pytest.approx(by_limit_mm + not_carried_mm + late_mm, rel=1e-6)
    assert age_bound_mm(reading, 10.05, extrapolate=False) == pytest.approx(
        0.05 * 50.0 + 0.5 * A_MM_PER_S2 * 0.05 * (0.05 + ROUND_S) + late_mm, rel=1e-6
    )


def test_a_length_at_rest_is_taken_to_rest_until_its_next_reading_is_due():
    rng = np.random.default_rng(4)
    rested_s = 20 * 2 * ROUND_S
    reading = Reading(1.0, 10.0, Quality.OK, "", motion(rng.normal(0.0, 1e-5, 30).tolist())._replace(rest_s=rested_s))
    assert age_bound_mm(reading, 10.0 + 2 * ROUND_S) < 1e-4
    silent_s = 3 * ROUND_S
    assert age_bound_mm(reading, 10.0 + silent_s) >= 0.5 * A_MM_PER_S2 * silent_s**2


def test_a_length_that_has_just_come_to_rest_may_have_left_again():
    shown = motion([0.0] * 12)
    age_s = ROUND_S / 2
    for rest_s, departs in ((15 * age_s, True), (20 * age_s, False)):
        reading = Reading(1.0, 10.0, Quality.OK, "", shown._replace(rest_s=rest_s))
        assert (age_bound_mm(reading, 10.0 + age_s) > 0.49 * A_MM_PER_S2 * age_s**2) == departs


@pytest.mark.parametrize("stood_s", [0.05, 2.0])
def test_a_joint_that_was_read_before_the_links_stood_has_gone_on(stood_s):
    """At its reading it did not move, by its own readings; the links did."""
    acceleration, age_s = 20.0, 0.2
    joint = Wire("joints.1", "joint 1", 1, 1, math.inf, acceleration_mm_per_s2=acceleration)
    wires = Wires([*SCALE.wires, joint])
    still = motion([0.0] * 12)._replace(due_s=1.0)
    readings = [
        Reading(0.0, 10.0, Quality.OK, "", still._replace(rest_s=stood_s)),
        Reading(0.0, 10.0 - age_s, Quality.OK, "", still._replace(rest_s=1.0)),
    ]
    bound_mm = wires.age_bound_mm(Snapshot(10.0, Readings.of(readings)), 1, True, math.inf)[0][1]
    went_mm = 0.5 * acceleration * max(age_s - stood_s, 0.0) ** 2
    assert bound_mm == pytest.approx(went_mm, abs=1e-4)


def test_readings_of_one_time_have_no_speed():
    """A source's clock has whole tenths of a second."""
    history = [GaugeSample(0.0, t, 1e-3) for t in (9.7, 9.8, 9.9)] + [
        GaugeSample(1e-5 * k, 10.0, 1e-3) for k in range(3)
    ]
    assert estimated_motion(history, TOLERANCE_MM).speed_mm_per_s == 0.0


def test_a_late_sample_makes_the_speed_uncertain():
    """The first and the last reading of a window, each late by up to 10 ms: uniformly distributed delays."""
    rng, at_s = np.random.default_rng(6), np.arange(2) * ROUND_S
    shown = estimated_motion([GaugeSample(50.0 * t, t, 0.01) for t in ROUND_S * np.arange(12)], TOLERANCE_MM)
    late_s = rng.uniform(0.0, 0.01, (4000, 2))
    speeds = 50.0 * np.diff(at_s + late_s, axis=1)[:, 0] / ROUND_S
    assert shown.u_mm_per_s == pytest.approx(speeds.std(), rel=0.05)


def test_a_rest_begins_with_the_last_motion_and_a_drift_is_none():
    estimate, history = MotionEstimate(TOLERANCE_MM), []

    def rests_s(values):
        for value in values:
            history.append(GaugeSample(value, ROUND_S * len(history), 1e-3))
            yield estimate.note(history[-32:]).rest_s

    assert list(rests_s(0.01 * np.arange(10))) == [0.0] * 10
    stood_s = list(rests_s(0.09 + 1e-6 * np.arange(60)))
    assert stood_s[49] == pytest.approx(50 * ROUND_S, abs=4 * ROUND_S)
    assert min(rests_s(0.0901 + 2e-5 * np.arange(200))) > 40 * ROUND_S
    assert list(rests_s([0.2])) == [0.0]


def test_without_a_limit_of_its_motion_a_silent_gauge_may_be_anywhere():
    free = Wires([Wire("scale_1.position", "scale 1", 0, 1, math.inf)])
    reading = Reading(1.0, 10.0, Quality.OK, "", motion([0.0] * 12))
    bound_mm, _ = free.age_bound_mm(Snapshot(10.5, Readings.of([reading])), 1, True, math.inf)
    assert math.isinf(bound_mm[0])


def test_a_silent_scale_stands_while_all_others_stand_and_moves_with_them():
    wires = Wires(
        [
            Wire(f"scale_{k}.position", f"scale {k}", k - 1, 1, math.inf, acceleration_mm_per_s2=A_MM_PER_S2)
            for k in (1, 2)
        ]
    )
    standing = motion([0.0] * 12)._replace(rest_s=1.0)
    driven = motion([50.0 * ROUND_S * k for k in range(12)])
    silent = Reading(1.0, 10.0, Quality.OK, "", standing)
    for other, lowest_mm, highest_mm in ((standing, 0.0, 1e-6), (driven, 6.0, 8.0)):
        readings = Readings.of([silent, Reading(1.0, 10.18, Quality.OK, "", other)])
        bounds_mm, _ = wires.age_bound_mm(Snapshot(10.2, readings), 2, True, math.inf)
        assert lowest_mm <= bounds_mm[0] <= highest_mm


def test_a_reading_without_a_motion_has_no_bound_by_age():
    assert age_bound_mm(bad(10.0, Quality.TIMEOUT), 10.05) == 0.0
