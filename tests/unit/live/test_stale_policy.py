"""What becomes of the correction when a comparator is lost."""

from __future__ import annotations

import math

import numpy as np
import pytest

from compd.gauge import Quality
from compd.live.loop.stale_policy import ComparatorSet, usable_comparators
from compd.live.machine.reasons import WAITS_FOR_PERSON, Lost
from compd.operation_settings import LoopSettings
from compd.setpoint_states import State
from tests.support.live_machine import PERIOD_S, machine

HOLD_S = 4.0
LOST = Lost("joint 4 (joints.4): timeout")
LAST = ComparatorSet(np.array([0.01, -0.02, 0.03]), time_s=100.0, oldest_s=99.9)


def settings(on_stale: str) -> LoopSettings:
    return LoopSettings(rate_hz=200, stale_after_s=0.5, on_stale=on_stale, hold_s=HOLD_S)


@pytest.mark.parametrize("on_stale", ["hold", "fade", "stop"])
def test_a_live_set_is_used_as_it_is(on_stale):
    live = LAST._replace(time_s=101.0)
    usable = usable_comparators(live, LAST, Lost(), 101.0, settings(on_stale))
    assert usable.comparators is live
    assert (usable.state, usable.reason, usable.expires_s) == (State.OK, "", math.inf)


@pytest.mark.parametrize("on_stale", ["hold", "fade", "stop"])
def test_before_the_first_whole_set_there_is_nothing_to_hold(on_stale):
    usable = usable_comparators(None, None, LOST, 100.0, settings(on_stale))
    assert usable.comparators is None
    assert usable.state is State.STARTING
    assert LOST.text in usable.reason
    assert WAITS_FOR_PERSON not in usable.reason


@pytest.mark.parametrize("last", [None, LAST])
@pytest.mark.parametrize("on_stale", ["hold", "fade", "stop"])
def test_where_a_person_is_waited_for_every_reason_says_so(on_stale, last):
    lost = LOST._replace(distrusted=True)
    usable = usable_comparators(None, last, lost, 100.5, settings(on_stale))
    assert f"{WAITS_FOR_PERSON}: {LOST.text}" in usable.reason


def test_stop_is_at_once():
    usable = usable_comparators(None, LAST, LOST, 100.005, settings("stop"))
    assert usable.comparators is None
    assert usable.state is State.STOP
    assert LOST.text in usable.reason


def test_hold_keeps_the_set_whole_and_then_stops():
    held = usable_comparators(None, LAST, LOST, 103.9, settings("hold"))
    assert held.comparators is LAST
    assert (held.state, held.expires_s) == (State.HOLD, 104.0)
    assert LOST.text in held.reason
    ended = usable_comparators(None, LAST, LOST, 104.0, settings("hold"))
    assert ended.comparators is None
    assert ended.state is State.STOP
    assert "ended after 4 s" in ended.reason


def test_fade_takes_the_set_back_in_a_straight_line_and_then_stops():
    for elapsed_s, weight in ((0.0, 1.0), (1.0, 0.75), (2.0, 0.5), (3.0, 0.25)):
        faded = usable_comparators(None, LAST, LOST, 100.0 + elapsed_s, settings("fade"))
        assert faded.state is State.FADE
        assert faded.comparators is not None
        assert faded.comparators.change_mm == pytest.approx(LAST.change_mm * weight)
        assert faded.comparators.oldest_s == LAST.oldest_s, "its age is that of the readings, not of the fading"
    ended = usable_comparators(None, LAST, LOST, 104.0, settings("fade"))
    assert ended.comparators is None
    assert ended.state is State.STOP


@pytest.mark.parametrize("on_stale", ["hold", "fade", "stop"])
def test_while_the_daemon_ends_a_set_that_was_good_is_held_and_an_old_one_is_not_revived(on_stale):
    tripod = machine(on_stale=on_stale)
    tripod.settle()
    before = tripod.step()
    held = tripod.step(ending="compd is stopping")
    assert held.state is State.HOLD
    assert held.reason == "compd is stopping; the last good set is held"
    assert held.values.correction_mm == pytest.approx(before.values.correction_mm)
    assert tripod.step().state is State.OK, "the daemon may have changed its mind"
    tripod.faults["joints.1"] = Quality.TIMEOUT
    for _ in range(round(2.0 / PERIOD_S)):
        lost = tripod.step()
    assert tripod.step(ending="compd is stopping").state is lost.state
