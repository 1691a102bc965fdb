"""Causes under load on machines whose platform is so light that the forces in their links change sign."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.scoreboard.case import KINDS_FAMILY, Case
from tests.scoreboard.prepare import prepare
from tests.scoreboard.scoring import score
from tests.scoreboard.trial import run

# Seeds choose the kind: 3-SPR, 3-RPS, 3-PRS, linear delta.
SEEDS = (5_000_003, 5_000_004, 5_000_005, 5_000_006)


@pytest.mark.long
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("cause", ["joint_contact", "link_elasticity"])
def test_a_contact_and_a_spring_are_not_taken_for_one_another(tmp_path: Path, cause: str, seed: int) -> None:
    """The contact's balls are held by a preload: neither a spring nor the power 2/3 of the force."""
    case = Case(KINDS_FAMILY, (cause,), (5.0,), seed)
    found = score(run(prepare(case, tmp_path)))
    assert found.near, (case.kind, found.missing)
    assert not found.dangerous, (case.kind, found.missing)
