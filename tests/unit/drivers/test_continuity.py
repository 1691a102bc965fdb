"""A value that jumps is asked for twice: damage does not pass, a true jump does."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from compd.gauge import LineFault, Quality, Reading, bad, good
from compd_drivers.continuity import MEMORY_S, UNREST_MM, Continuity

FASTEST_MM_PER_S = 1.0
POLL_S = 0.01


class Device:
    """Answers with the values given, one poll after the other."""

    def __init__(self) -> None:
        self.time_s = 50.0
        self.continuity = Continuity(FASTEST_MM_PER_S)
        self.asked = 0

    def poll(self, *answers: float | Quality | LineFault) -> Reading:
        waiting = list(answers)

        def ask() -> list[Reading]:
            self.time_s += POLL_S
            self.asked += 1
            answer = waiting.pop(0)
            if isinstance(answer, LineFault):
                raise answer
            return [bad(self.time_s, answer) if isinstance(answer, Quality) else good(answer, self.time_s)]

        (reading,) = self.continuity.read(ask)
        assert not waiting, f"answers {waiting} were not asked for"
        return reading


def test_the_first_value_needs_a_second_one() -> None:
    device = Device()
    assert device.poll(1.0, 1.0).value == 1.0
    assert device.poll(1.001).value == 1.001


def test_damage_is_asked_for_again() -> None:
    device = Device()
    device.poll(1.0, 1.0)
    assert device.poll(7.0, 1.0).value == 1.0
    assert device.poll(1.0).value == 1.0


def test_a_true_jump_passes_after_a_second_look() -> None:
    device = Device()
    device.poll(1.0, 1.0)
    assert device.poll(7.0, 7.0).value == 7.0
    assert device.poll(7.0).value == 7.0


def test_damage_twice_is_a_fault_and_the_next_poll_is_right() -> None:
    device = Device()
    device.poll(1.0, 1.0)
    with pytest.raises(LineFault) as caught:
        device.poll(7.0, 9.0)
    assert caught.value.quality is Quality.MISMATCH
    assert "7.0000" in caught.value.detail
    assert device.poll(1.0, 1.0).value == 1.0, "after a fault two must agree"


def test_after_a_long_silence_two_must_agree() -> None:
    device = Device()
    device.poll(1.0, 1.0)
    device.time_s += MEMORY_S
    assert device.poll(1.0, 1.0).value == 1.0


def test_a_gap_does_not_widen_what_a_value_may_have_moved() -> None:
    device = Device()
    device.poll(1.0, 1.0)
    with pytest.raises(LineFault):
        device.poll(LineFault(Quality.TIMEOUT))
    device.time_s += 0.5  # time enough to have moved by 0.4
    with pytest.raises(LineFault) as caught:
        device.poll(1.4, 1.0)
    assert caught.value.quality is Quality.MISMATCH


def test_no_value_needs_no_proof_and_is_no_proof() -> None:
    device = Device()
    assert device.poll(Quality.SENSOR_FAULT).quality is Quality.SENSOR_FAULT
    assert device.poll(1.0, 1.0).value == 1.0
    assert device.poll(Quality.SENSOR_FAULT).quality is Quality.SENSOR_FAULT
    assert device.poll(1.0).value == 1.0, "the value before the fault still counts"


@given(st.floats(-100, 100))
def test_one_damaged_answer_never_moves_the_value_further_than_the_part_can(damaged: float) -> None:
    device = Device()
    device.poll(1.0, 1.0)
    reach_mm = UNREST_MM + FASTEST_MM_PER_S * POLL_S
    try:
        reading = device.poll(damaged, 1.0)
    except AssertionError:  # the second answer was not asked for: then the first was within reach
        assert abs(damaged - 1.0) <= reach_mm * (1 + 1e-9)
    else:
        assert reading.value == 1.0
