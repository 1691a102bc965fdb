"""A sample of the fault matrix with real ptys, sockets and processes; `make faults` runs all of it in virtual time."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.injection.case import Case
from tests.injection.matrix import REAL
from tests.injection.rig import RealMachine
from tests.injection.trial import settle, try_case
from tests.support.resources import resources_by_process
from tests.support.simulated import run_directory

# What opens lines anew, and what opens connections: several times over, it leaves nothing behind.
OPENING = ("scale-unplugged", "cabinet-reset", "client-deaf", "client-churn")


@pytest.fixture(scope="module")
def machine() -> Iterator[RealMachine]:
    with run_directory() as directory, RealMachine(directory) as machine:
        yield machine


def tried(machine: RealMachine, case: Case) -> None:
    settle(machine)
    outcome = try_case(machine, case)
    print(f"worst {outcome.worst_um:.2f} um, valid {outcome.valid_share:.0%}, back after {outcome.back_s:.2f} s")
    assert not outcome.problems, "\n".join(outcome.problems)


@pytest.mark.long
@pytest.mark.sample
@pytest.mark.parametrize("case", [pytest.param(case, id=case.id) for case in REAL])
def test_what_must_happen_happens(machine: RealMachine, case: Case) -> None:
    tried(machine, case)


@pytest.mark.long
def test_faults_leave_no_memory_threads_or_descriptors_behind(machine: RealMachine) -> None:
    cases = [case for case in REAL if case.id in OPENING]
    rounds = []
    for _ in range(3):
        for case in cases:
            tried(machine, case)
        settle(machine)
        rounds.append(resources_by_process(machine.daemon.pids()))
    first, *_, last = rounds
    assert not {name: grown for name, now in last.items() if (grown := now.growth_since(first[name]))}
