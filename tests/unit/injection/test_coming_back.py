"""A scale that has lost its count while nobody read it: the daemon, or its acquisition, starts anew."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from compd.setpoint_states import State
from tests.injection import faults
from tests.injection.machine import Machine
from tests.injection.trial import BACK_WITHIN_S, settle
from tests.injection.verdict import judge
from tests.injection.virtual import VirtualMachine

# At rest a valid setpoint is nearer to the truth.
NOISE_UM = 10.0
STARTED_WITHIN_S = 3.0


@pytest.fixture
def machine() -> Iterator[VirtualMachine]:
    with VirtualMachine() as machine:
        settle(machine)
        yield machine


def _lose_5_mm(machine: Machine) -> None:
    machine.injector.fault("scale_1", faults.Off(("position",), -5.0))


def _restarted(machine: Machine, lose: Callable[[Machine], None]) -> None:
    machine.end_daemon()
    lose(machine)
    machine.start_daemon()


def _killed(machine: Machine, lose: Callable[[Machine], None]) -> None:
    machine.kill("acquisition")
    lose(machine)


GAPS = pytest.mark.parametrize(
    "gap", [pytest.param(_killed, id="killed"), pytest.param(_restarted, id="restarted", marks=pytest.mark.long)]
)


@GAPS
def test_a_scale_that_has_lost_its_count_meanwhile_waits_for_a_person(
    machine: VirtualMachine, gap: Callable[..., None]
) -> None:
    gap(machine, _lose_5_mm)
    with machine.watched() as watcher:
        machine.rest_for(STARTED_WITHIN_S)
        assert watcher.seen[-1]["state"] == State.FAULT
        assert "waits for a person" in watcher.seen[-1]["reason"]
        assert "scale_1" in watcher.seen[-1]["reason"]
        machine.injector.repair()
        machine.accept()
        assert machine.until_ok(watcher, BACK_WITHIN_S)
        assert not judge(machine, watcher.seen).worst_um > NOISE_UM


@GAPS
def test_where_no_gauge_has_changed_nobody_is_asked(machine: VirtualMachine, gap: Callable[..., None]) -> None:
    for _ in range(3):
        gap(machine, lambda machine: None)
        with machine.watched() as watcher:
            machine.rest_for(STARTED_WITHIN_S)
            assert watcher.seen[-1]["state"] == State.OK
            assert judge(machine, watcher.seen).worst_um < NOISE_UM
