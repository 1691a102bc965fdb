"""A cause that begins or grows, and sessions that begin warm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from compd.simulation.campaign.campaign import Campaign
from compd.simulation.campaign.campaign_plan import draw_campaign_plan
from compd.simulation.causes.catalogue import build_cause
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.strengths import FULLY_MEASURED_WITHOUT_NOISE, NOTHING
from compd.simulation.truth.world import World
from tests.scoreboard.campaign_days import single_visits
from tests.scoreboard.sudden_change import NoCause, SuddenChange
from tests.support.simulated import tripod, wiring

MACHINE = Mechanism(tripod())
UM = 1e-3


def world(*causes):
    return World(tripod(), wiring(), 1, strengths=NOTHING, causes=causes)


def go(machine, *scales_mm, every_s=100.0):
    """Tips after each of the moves."""
    tips = []
    for scale_mm in scales_mm:
        machine.advance_to(np.full(3, float(scale_mm)), machine.posture, every_s, 1.0)
        tips.append(machine.reference_tip_mm())
    return np.array(tips)


def test_an_offset_begins_at_its_time():
    offset = build_cause("tool_offset", 5.0, MACHINE, 1)
    tips = go(world(SuddenChange(NoCause(MACHINE), offset, 250.0)), 1, 2, 3, 4)
    without = go(world(), 1, 2, 3, 4)
    np.testing.assert_allclose(tips[:2], without[:2], atol=1e-9)
    np.testing.assert_allclose((tips - without)[2:] / UM, np.tile(offset.part_strengths, (2, 1)), atol=1e-3)


def test_a_gauge_changes_its_gain():
    gain = build_cause("joint_comparator_gain", 0.1, MACHINE, 1)
    machine = world(SuddenChange(NoCause(MACHINE), gain, 150.0))
    plain = np.full(9, 0.01)
    cause = machine._causes[0]
    np.testing.assert_array_equal(cause.joint_reading_mm(plain), plain)
    go(machine, 1, 2)
    np.testing.assert_array_equal(cause.joint_reading_mm(plain), gain.joint_reading_mm(plain))


def test_a_play_grows_to_what_it_would_be_had_it_always_been_so():
    def play(strength):
        return build_cause("backlash", strength, MACHINE, 1)

    way = (1, 2, 1, 2, 1)
    grown = go(world(SuddenChange(play(4.0), play(10.0), 250.0)), *way)
    np.testing.assert_array_equal(grown[:2], go(world(play(4.0)), *way)[:2])
    np.testing.assert_allclose(grown[2:], go(world(play(10.0)), *way)[2:], atol=1e-9)


def test_visits_alone_have_one_row_each_in_all_sessions():
    plan = single_visits(draw_campaign_plan(MACHINE, 5), 90)
    assert len(plan.items) == 90
    assert {item.kind for item in plan.items} == {"visit"}
    assert not any(item.repeated for item in plan.items)
    assert {item.session for item in plan.items} == {1, 2, 3, 4}


def test_a_session_that_begins_warm_is_the_same_plan_later():
    cold, warm = draw_campaign_plan(MACHINE, 5), draw_campaign_plan(MACHINE, 5, warm_up_s=1500.0)
    assert [item.start_s + 1500.0 for item in cold.items] == [item.start_s for item in warm.items]
    np.testing.assert_array_equal(cold.points_mm, warm.points_mm)


def test_rods_follow_late_where_a_session_begins_warm():
    """After the warm-up the rods of a lag are colder than their tubes; without one both begin alike."""
    lags_K = []
    for warm_up_s in (0.0, 1500.0):
        lag = build_cause("link_expansion_lag", 10.0, MACHINE, 1)
        plan = draw_campaign_plan(MACHINE, 5, warm_up_s=warm_up_s)
        first = replace(plan, items=plan.items[:1])
        Campaign(tripod(), wiring(), first, 5, FULLY_MEASURED_WITHOUT_NOISE, [lag]).run()
        lags_K.append(float(np.abs(lag._tube_K - lag._rod_K).mean()))
    assert lags_K[0] < 0.1
    assert lags_K[1] > 0.5
