"""The fault matrix on real ports: no valid setpoint is wrong, whatever is done to gauges, lines, processes and sockets.

`python -m tests.injection CASE` runs one case and prints what it did.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.injection.case import Case
from tests.injection.matrix import MATRIX
from tests.injection.rig import InjectedMachine
from tests.injection.trial import settle, try_case
from tests.support.simulated import run_directory


@pytest.fixture(scope="module")
def machine() -> Iterator[InjectedMachine]:
    with run_directory() as directory, InjectedMachine(directory) as machine:
        yield machine


def marked(case: Case) -> object:
    return pytest.param(case, id=case.id, marks=[pytest.mark.long, *([pytest.mark.sample] if case.sample else [])])


@pytest.mark.parametrize("case", [marked(case) for case in MATRIX])
def test_what_must_happen_happens(machine: InjectedMachine, case: Case) -> None:
    settle(machine)
    outcome = try_case(machine, case)
    print(f"worst {outcome.worst_um:.2f} um, valid {outcome.valid_share:.0%}, back after {outcome.back_s:.2f} s")
    assert not outcome.problems, "\n".join(outcome.problems)


def test_every_case_has_a_name_of_its_own() -> None:
    assert len({case.id for case in MATRIX}) == len(MATRIX)
