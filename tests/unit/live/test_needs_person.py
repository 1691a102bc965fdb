"""Which lost gauges a person has to accept: those that count anew, once the machine has moved without them."""

from __future__ import annotations

import pytest

from compd.live.memory import Doubt, TrustMemory

CHANNELS = ["scale_1.position", "scale_2.position", "joints.4", "cabinet.t1"]


@pytest.fixture
def memory():
    made = TrustMemory(CHANNELS, [0.01] * 4, ["degC"], 2)
    for i in (0, 1, 2, 3):
        made.believe(i, 1.0, 10.0)
    for i in range(3):  # each has seen the others where they stand
        made.believe(i, 1.0, 10.1)
    return made


@pytest.mark.parametrize("lost", [0, 2])
def test_a_gauge_that_was_lost_waits_for_a_person_once_the_machine_has_moved(memory, lost):
    assert not memory.needs_person(lost)
    memory.lose(lost, 11.0, power=True)
    assert not memory.needs_person(lost)
    memory.believe(1, 5.0, 12.0)
    assert memory.needs_person(lost)
    memory.believe(1, 1.0, 13.0)
    assert not memory.needs_person(lost), "it has driven back"


def test_one_that_returns_by_itself_needs_nobody_and_a_distrusted_one_does(memory):
    memory.returns[0] = 1.0
    memory.lose(0, 11.0, power=True)
    memory.believe(1, 5.0, 12.0)
    assert not memory.needs_person(0)
    memory.distrust(0, Doubt.RETURNED, 4.0)
    assert memory.needs_person(0)


def test_a_quantity_that_is_lost_needs_nobody(memory):
    memory.lose(3, 11.0)
    memory.believe(1, 5.0, 12.0)
    assert not memory.needs_person(3)
