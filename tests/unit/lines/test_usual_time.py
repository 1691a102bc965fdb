"""How long a device is waited for, by how long it usually takes."""

from __future__ import annotations

import pytest

from compd.lines.usual_time import FEWEST, IN_MIND, MAX_IN_VAIN, MIN_WAIT_S, Durations, UsualWait

LONGEST_S = 0.15


def answered(duration_s: float, count: int = FEWEST) -> UsualWait:
    wait = UsualWait(LONGEST_S)
    for _ in range(count):
        wait.took(duration_s)
    return wait


def test_the_whole_timeout_is_waited_until_enough_is_known():
    assert answered(0.001, FEWEST - 1).wait_s == LONGEST_S
    assert answered(0.001).wait_s == MIN_WAIT_S


@pytest.mark.parametrize(("usual_s", "wait_s"), [(0.002, MIN_WAIT_S), (0.02, 0.06), (0.09, LONGEST_S)])
def test_three_times_the_usual_time_is_waited(usual_s, wait_s):
    assert answered(usual_s).wait_s == pytest.approx(wait_s)


@pytest.mark.parametrize("paused_s", [0.02, 0.2, 3.0])
def test_a_pause_of_this_computer_is_no_slowness_of_the_device(paused_s):
    wait = answered(0.004, IN_MIND)
    for _ in range(2):
        wait.took(paused_s)
    assert wait.wait_s == MIN_WAIT_S


def test_a_device_that_answers_slowly_now_and_then_is_waited_for():
    wait = UsualWait(LONGEST_S)
    for number in range(IN_MIND):
        wait.took(0.03 if number % 20 == 0 else 0.004)
    assert wait.wait_s == pytest.approx(0.09)


def test_a_device_that_has_become_slower_is_heard():
    wait = answered(0.004, IN_MIND)
    for _ in range(MAX_IN_VAIN):
        assert wait.wait_s == MIN_WAIT_S
        wait.missed()
    for _ in range(FEWEST):
        assert wait.wait_s == LONGEST_S
        wait.took(0.03)
    assert wait.wait_s == pytest.approx(0.09)


def test_bytes_that_come_after_all_show_a_slower_device_at_once():
    wait = answered(0.004)
    wait.came_late()
    assert wait.wait_s == MIN_WAIT_S, "nothing was given up"
    wait.missed()
    wait.came_late()
    assert wait.wait_s == LONGEST_S


def test_the_oldest_durations_are_forgotten():
    durations = Durations()
    for duration_s in [1.0] * IN_MIND + [0.002] * IN_MIND:
        durations.note(duration_s)
    assert len(durations) == IN_MIND
    assert durations.within_s(1.0) == 0.002
