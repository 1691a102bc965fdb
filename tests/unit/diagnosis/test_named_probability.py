"""The probability that a verdict states, from the numbers of its evidence, and what the verdict makes of it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compd.comparison import AlignedRecording
from compd.diagnosis import Criteria, Diagnosis
from compd.diagnosis.named_probability import NOT_TESTED, NamedProbability
from compd.diagnosis.probability_criteria import ProbabilityCriteria
from compd.diagnosis.recording_diagnosis import diagnose
from compd.threshold import with_value
from tests.support.external_recordings import along, record_external

ROWS = 240
PLAY = along("x", "play", "k * moved_1", parameters={"k": {"unit": "um", "plausible": [1, 4], "source": "a test"}})
WINDUP = along("x", "windup", "k * moved_1 * (1 + position_mm / 4000)")
NUMBERS = ProbabilityCriteria(certain=2.0, per_better=0.5, per_told=0.25, above_noise=1.0, unseen=0.1)


def test_the_odds_are_linear_in_the_evidence() -> None:
    assert NamedProbability(0.0, criteria=NUMBERS).value == pytest.approx(1 / (1 + math.exp(-2.0)))
    # log((0.9 + 0.1) / 0.1) = log 10
    odds = 2.0 - 0.5 * math.log(10.0) - 0.25 * math.log(3.0) - 1.0
    assert NamedProbability(0.9, 3, above_noise=True, criteria=NUMBERS).value == pytest.approx(
        1 / (1 + math.exp(-odds))
    )


def test_the_more_sets_may_be_better_the_less_probable_is_the_named_one() -> None:
    values = [NamedProbability(number).value for number in (0.0, 0.1, 0.5, 1.0, 10.0)]
    assert values == sorted(values, reverse=True)
    assert NamedProbability(0.1, above_noise=True).value < NamedProbability(0.1).value


def test_a_probability_that_cannot_be_stated_is_none_and_says_why() -> None:
    said = NamedProbability(unknown=NOT_TESTED).as_json()
    assert said["probability"] is None
    assert said["probability_from"]["unknown"] == NOT_TESTED
    assert NamedProbability(0.2).as_json()["probability"] == pytest.approx(NamedProbability(0.2).value)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> AlignedRecording:
    """A stage with 3 um of play."""
    rng = np.random.default_rng(1)
    moved, position = rng.choice([-1.0, 1.0], ROWS), rng.uniform(0, 100, ROWS)
    path = tmp_path_factory.mktemp("stage") / "run.csv"
    columns = {"moved_1": moved, "position_mm": position}
    return record_external(Path(path), columns, {"x": 3 * moved}, model_mm={"x": position})


def of(diagnosis: Diagnosis) -> NamedProbability:
    return diagnosis.probability_from


def test_an_effect_without_a_rival_is_more_probable_than_one_with(stage: AlignedRecording) -> None:
    alone, beside = (diagnose(stage, (), None, effects) for effects in ([PLAY], [PLAY, WINDUP]))
    assert [step.effect.id for step in alone.steps] == [step.effect.id for step in beside.steps] == ["play"]
    assert of(alone).better_sets < 0.01 < of(beside).better_sets
    assert alone.probability > beside.probability
    assert alone.as_json()["probability"] == pytest.approx(alone.probability)


def test_what_is_not_probable_enough_is_likely_and_not_identified(stage: AlignedRecording) -> None:
    assert diagnose(stage, (), None, [PLAY]).verdict == "identified"
    criteria = with_value(Criteria(), "probability.identified_from", 1.0)
    likely = diagnose(stage, (), None, [PLAY], criteria=criteria)
    assert likely.verdict == "likely"
    assert "warm-up" not in likely.summary
    assert f"{likely.probability:.2f}" in likely.summary


def test_where_nothing_was_tested_no_probability_is_stated(stage: AlignedRecording) -> None:
    columns = {"position_mm": np.linspace(0, 100, ROWS)}
    path = stage.recording.path.with_name("still.csv")
    still = record_external(path, columns, {"x": np.zeros(ROWS)}, declared_um=None)
    diagnosis = diagnose(still, (), None, [])
    assert diagnosis.verdict == "not_testable"
    assert math.isnan(diagnosis.probability)
    assert of(diagnosis).unknown == NOT_TESTED


def test_the_criteria_of_a_diagnosis_make_its_probability(stage: AlignedRecording) -> None:
    less = replace(Criteria(), probability=replace(ProbabilityCriteria(), certain=-1.0))
    assert diagnose(stage, (), None, [PLAY], criteria=less).probability < 0.5
