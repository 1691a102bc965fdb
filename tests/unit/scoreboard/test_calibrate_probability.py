"""The numbers of a probability, fitted to cases that are drawn with known ones."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from compd.diagnosis import Criteria
from tests.scoreboard.calibrate_probability import evidence_of, fit, report

TRUE = np.array([2.5, 0.6, 0.8, 1.0])
FAMILIES = ("library", "pair", "triple", "weak")


def case(better: float, told: int, above: bool, right: bool, family: str) -> dict[str, Any]:
    said = {"better_sets": better, "sets_told": told, "above_noise": above}
    steps = [{"effect": "link_sag" if right else "backlash", "rivals": []}]
    verdict = {"verdict": "identified", "steps": steps, "constant": None, "probability": 0.5, "probability_from": said}
    expected = {"verdicts": ["identified"], "groups": [["link_sag"]]}
    return {"family": family, "expected": expected, "verdict": verdict, "answer": {"weak_disturbances": {}}}


@pytest.fixture(scope="module")
def drawn() -> list[dict[str, Any]]:
    """4000 cases whose odds are linear in their evidence."""
    rng = np.random.default_rng(3)
    made = []
    for k in range(4000):
        better, told, above = rng.exponential(0.5) ** 3, int(rng.choice([1, 1, 2, 4])), bool(rng.uniform() < 0.2)
        odds = TRUE @ evidence_of(case(better, told, above, True, "library"))
        right = bool(rng.uniform() < 1 / (1 + math.exp(-odds)))
        made.append(case(better, told, above, right, FAMILIES[k % len(FAMILIES)]))
    return made


def test_the_numbers_are_found_again(drawn: list[dict[str, Any]]) -> None:
    evidence = np.array([evidence_of(result) for result in drawn])
    right = np.array([result["verdict"]["steps"][0]["effect"] == "link_sag" for result in drawn])
    assert fit(evidence, right) == pytest.approx(TRUE, abs=0.25)


def test_the_evidence_of_a_sure_set_is_nought() -> None:
    assert evidence_of(case(0.0, 1, False, True, "library")) == (1.0, 0.0, 0.0, 0.0)
    unseen = Criteria().probability.unseen
    assert evidence_of(case(unseen, 1, False, True, "library"))[1] == pytest.approx(-math.log(2.0))


def test_the_report_has_the_numbers_and_what_they_are_worth_on_other_families(drawn: list[dict[str, Any]]) -> None:
    real = {**drawn[0], "family": "real"}
    unstated = {**drawn[0], "verdict": {**drawn[0]["verdict"], "probability": None}}
    said = list(report([*drawn, real, unstated]))
    assert said[0].startswith("4000 cases")
    assert [line.partition(" =")[0] for line in said[1:5]] == ["certain", "per_better", "per_told", "above_noise"]
    bins = [line for line in said if line.endswith("| yes |")]
    assert len(bins) >= 5
    assert not [line for line in said if line.endswith("| no |")]
    reduction = next(line for line in said if line.startswith("Brier"))
    assert int(reduction.partition(": ")[2].split()[0]) > 10
