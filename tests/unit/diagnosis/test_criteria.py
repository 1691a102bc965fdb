"""Criteria: every threshold documented and used, and a changed one changes the verdict."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import compd
from compd.calibration.criteria import CalibrationCriteria
from compd.comparison import AlignedRecording, ComparisonCriteria
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.recording_diagnosis import diagnose
from compd.diagnosis.verdict import Diagnosis
from compd.fleet.criteria import FleetCriteria
from compd.threshold import Threshold, thresholds, with_value
from tests.support.external_recordings import along, record_external

ROOMS = [Path(compd.__file__).parent / room for room in ("comparison", "diagnosis", "fleet", "planning", "statistics")]
KINDS = (Criteria, ComparisonCriteria, FleetCriteria)
THRESHOLDS = {name: field for kind in KINDS for name, field in thresholds(kind).items()}
ROWS = 240
PLAY = along("x", "play", "k * moved_1", parameters={"k": {"unit": "um", "plausible": [1, 4], "source": "a test"}})
WINDUP = along("x", "windup", "k * moved_1 * (1 + position_mm / 4000)")


DOCUMENTED = {**THRESHOLDS, **thresholds(CalibrationCriteria)}


@pytest.mark.parametrize("threshold", DOCUMENTED.values(), ids=DOCUMENTED)
def test_every_threshold_says_what_it_means_in_which_unit_and_why(threshold: Threshold) -> None:
    assert all(text.strip() for text in (threshold.unit, threshold.meaning, threshold.reason))


def test_every_threshold_is_used() -> None:
    """As an attribute of criteria, or of its section: `criteria.p_value`, `criteria.search.max_members`."""
    trees = [ast.parse(path.read_text(encoding="utf-8")) for room in ROOMS for path in room.rglob("*.py")]
    used = {
        (owner(node.value), node.attr) for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Attribute)
    }
    unused = [
        name
        for name in THRESHOLDS
        if not {(part, name.rpartition(".")[2]) for part in ("criteria", "_criteria", name.partition(".")[0])} & used
    ]
    assert unused == []


def owner(node: ast.expr) -> str:
    """The last name of an expression: "criteria" of self.criteria."""
    return node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> AlignedRecording:
    """A stage with 3 um of play, 2 um that follow the room, and one row that is 8 times the noise off."""
    rng = np.random.default_rng(1)
    moved, position = rng.choice([-1.0, 1.0], ROWS), rng.uniform(0, 100, ROWS)
    room = 20 + np.cumsum(rng.normal(0, 0.3, ROWS))
    error_um = 3 * moved + 1.0 * (room - 20)
    error_um[77] += 4.0
    columns = {"moved_1": moved, "position_mm": position, "temperature_room_degC": room}
    path = tmp_path_factory.mktemp("stage") / "run.csv"
    return record_external(path, columns, {"x": error_um}, model_mm={"x": position})


def criteria(stage: AlignedRecording, **changed: float) -> dict[str, Any]:
    """What a diagnosis with a changed threshold says."""
    return what_is_said(diagnose(stage, (), None, [PLAY], criteria=replace(Criteria(), **changed)))


def what_is_said(diagnosis: Diagnosis) -> dict[str, Any]:
    return {
        "verdict": diagnosis.verdict,
        "steps": [step.effect.id for step in diagnosis.steps],
        "follows": [finding.covariate for finding in diagnosis.depends_on],
        "gross": diagnosis.gross.rows,
        "std": diagnosis.steps[0].parameters[0].std if diagnosis.steps else None,
    }


def test_the_customary_thresholds_find_play_room_and_one_gross_row(stage: AlignedRecording) -> None:
    result = criteria(stage)
    assert (result["verdict"], result["steps"]) == ("partial", ["play"])
    assert result["follows"][0] == "temperature_room_degC"
    assert result["gross"] == (79,)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"effect_price": 10.0}, {"steps": []}),
        ({"description_price": 10.0}, {"follows": []}),
        ({"least_sigmas": 1e3}, {"steps": [], "verdict": "unexplained"}),
        ({"most_at_floor": 1e3, "description_price": 10.0}, {"verdict": "identified", "follows": []}),
        ({"p_value": 0.0, "description_price": 10.0}, {"follows": []}),
        ({"gross_sigmas": 50.0}, {"gross": ()}),
    ],
    ids=lambda value: ", ".join(value) if isinstance(value, dict) else value,
)
def test_a_changed_threshold_changes_what_is_said(
    stage: AlignedRecording, changed: dict[str, float], said: dict[str, Any]
) -> None:
    result = criteria(stage, **changed)
    assert {key: result[key] for key in said} == said


@pytest.mark.parametrize(("slack", "said"), [(0.0, "unexplained"), (0.25, "identified")])
def test_a_number_slightly_out_of_its_range_is_a_cause_within_the_slack(
    tmp_path: Path, slack: float, said: str
) -> None:
    """4.4 um of play, where 1 to 4 um are plausible: a tenth of the range too much."""
    rng = np.random.default_rng(2)
    columns = {"moved_1": rng.choice([-1.0, 1.0], ROWS), "position_mm": rng.uniform(0, 100, ROWS)}
    error_um = 4.4 * columns["moved_1"]
    path = record_external(
        tmp_path / "run.csv", columns, {"x": error_um}, model_mm={"x": columns["position_mm"]}
    ).recording.path
    diagnosis = compd.diagnose(path, effects=PLAY, criteria=Criteria(range_slack=slack))
    assert diagnosis.verdict == said
    assert [step.effect.id for step in diagnosis.steps] == (["play"] if said == "identified" else [])
    assert diagnosis.criteria.range_slack == slack


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("search.max_members", 0, {"steps": []}),
        ("search.further_members", 0, {"steps": []}),
        ("candidates.min_motion_um", 1e3, {"steps": [], "verdict": "unexplained"}),
        ("descriptions.promising", 0, {"follows": []}),
        ("gross.max_columns_share", 0.0, {"gross": ()}),
    ],
)
def test_a_changed_number_of_a_section_changes_what_is_said(
    stage: AlignedRecording, name: str, value: float, said: dict[str, Any]
) -> None:
    result = what_is_said(diagnose(stage, (), None, [PLAY], criteria=with_value(Criteria(), name, value)))
    assert {key: result[key] for key in said} == said


def test_a_comparison_rests_on_the_criteria_of_its_recording(stage: AlignedRecording) -> None:
    path = stage.recording.path
    lenient = ComparisonCriteria(outlier_sigmas=1e3, trend_share=2.0)
    opened = compd.open_recording(path, criteria=lenient)
    for comparison in (
        compd.compare(path, criteria=lenient),
        compd.compare(opened),
        compd.compare(stage, criteria=lenient),
    ):
        assert comparison.criteria == lenient
        assert comparison.trends == ()
    assert compd.compare(stage).trends
    assert compd.compare(stage).criteria == ComparisonCriteria()
    assert compd.diagnose(opened, effects=PLAY).before.trends == ()
    assert compd.compare(compd.open_sample(path, criteria=lenient)).trends == ()


def test_more_disturbance_widens_the_standard_errors(stage: AlignedRecording) -> None:
    other = along("x", "windup", "k * moved_1 * position_mm / 100")
    narrow, wide = (
        diagnose(stage, (), None, [PLAY, other], criteria=Criteria(disturbance=size)).steps[0].parameters[0].std
        for size in (0.0, 1.0)
    )
    assert wide > 2 * narrow


def test_a_rival_may_miss_the_share_that_is_allowed(stage: AlignedRecording) -> None:
    def named(share: float) -> set[str]:
        criteria = Criteria(rival_share=share, effect_price=0.1)
        diagnosis = diagnose(stage, (), None, [PLAY, WINDUP], criteria=criteria)
        step = diagnosis.steps[0]
        return {step.effect.id, *(rival.name for rival in step.rivals)}

    assert named(0.3) == {"play", "windup"}
    assert len(named(-0.5)) == 1


def test_the_weight_of_a_row_falls_beyond_the_full_one(stage: AlignedRecording) -> None:
    """With a bound far below the noise every row counts by the inverse of its distance: another estimate."""
    plain, bounded = (
        diagnose(stage, (), None, [PLAY], criteria=Criteria(full_weight_sigmas=full)).heldout_after_um
        for full in (2.0, 0.2)
    )
    assert plain != pytest.approx(bounded, rel=1e-3)
