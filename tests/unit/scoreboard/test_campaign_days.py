"""What the campaigns of the hard families are like, before anything is simulated."""

from __future__ import annotations

import numpy as np
import pytest

from compd.simulation.campaign.campaign_plan import GAP_S
from compd.simulation.truth.mechanism import Mechanism
from tests.scoreboard.campaign_days import HEIGHTS, UNREPEATED_ROWS, air_at_zero, days, touched_plane
from tests.scoreboard.case import Case
from tests.support.simulated import tripod

MACHINE = Mechanism(tripod())
SEEDS = (3, 4, 5)


def case(family, seed):
    return Case(family, ("link_expansion",), (3.0,), seed)


@pytest.mark.parametrize("seed", SEEDS)
def test_one_warm_up_is_one_session_under_one_heat_in_a_steady_room(seed):
    plan = days(case("one-warm-up", seed), MACHINE, 0)
    assert {item.session for item in plan.items} == {1}
    assert all(item.kind == "visit" and item.heat is plan.items[0].heat for item in plan.items)
    assert np.all(np.diff([item.start_s for item in plan.items]) > 0)
    room = [plan.weather.room_degC(item.start_s) for item in plan.items]
    assert np.ptp(room) < 0.5
    # the other day is a usual campaign
    assert len({item.session for item in days(case("one-warm-up", seed), MACHINE, 1).items}) == 4


@pytest.mark.parametrize("seed", SEEDS)
def test_place_by_place_goes_up_or_down_once(seed):
    plan = days(case("place-by-place", seed), MACHINE, 0)
    height_mm = np.array(
        [MACHINE.told_pose(plan.points_mm[item.point - 1], MACHINE.posture0)[0][2] for item in plan.items]
    )
    means = np.array([group.mean() for group in np.array_split(height_mm, HEIGHTS)])
    assert np.all(np.diff(means) > 0) or np.all(np.diff(means) < 0)
    order = np.abs(np.corrcoef(np.arange(len(height_mm)), height_mm)[0, 1])
    assert order > 0.95


@pytest.mark.parametrize("seed", SEEDS)
def test_the_room_is_elsewhere_than_at_machine_zero(seed):
    plan = days(case("zero-elsewhere", seed), MACHINE, 0)
    assert min(item.start_s for item in plan.items) == GAP_S
    assert plan.weather.room_degC(0.0) == air_at_zero(case("zero-elsewhere", seed)).temperature_degC
    first = [plan.weather.room_degC(item.start_s) for item in plan.items if item.session == 1]
    assert 3.0 < np.abs(np.mean(first) - plan.weather.room_degC(0.0)) < 14.0
    assert len({item.session for item in plan.items}) == 4


def test_half_of_the_wrong_declarations_have_no_repeats():
    plans = [days(case("wrong-noise", seed), MACHINE, 0) for seed in range(12)]
    unrepeated = [plan for plan in plans if not any(item.repeated for item in plan.items)]
    assert 3 <= len(unrepeated) <= 9
    assert {len(plan.items) for plan in unrepeated} == {UNREPEATED_ROWS}


def test_a_plane_is_level_and_within_reach():
    places = touched_plane(case("plane", 3), MACHINE)
    assert len(set(places.tip_M[:, 2])) == 1
    assert np.ptp(places.tip_M[:, 0]) > 50
    assert np.all(np.abs(places.scale_mm) < MACHINE.stroke_mm)
    plan = days(case("plane", 3), MACHINE, 0, places)
    assert all(item.kind == "visit" for item in plan.items)
    np.testing.assert_array_equal(plan.points_mm, places.scale_mm)
