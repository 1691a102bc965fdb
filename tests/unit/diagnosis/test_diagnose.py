"""Diagnosis end to end: effects found one after another, outliers, memory, causes outside the library, verdicts."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.comparison import AlignedRecording, read_with_machine
from compd.comparison.alignment.align_recording import align_recording
from compd.diagnosis.holdout import evaluate_holdout
from compd.diagnosis.recording_diagnosis import diagnose
from compd.diagnosis.verdict import Diagnosis
from tests.support.hidden_effects import LIBRARY, campaign, record_with_effects
from tests.support.paths import SHARED
from tests.support.sampled import sampled

EFFECTS = list(LIBRARY.values())
EXAMPLES = sorted(path.parent for path in SHARED.glob("recordings/*/answer.json"))


def diagnose_with_effects(
    path: Path, effects: dict[str, tuple[float, ...]], seed: int = 1, **options: Any
) -> Diagnosis:
    return diagnose(record_with_effects(path / "run.csv", seed, effects, **options), (), None, EFFECTS)


def effect_ids(diagnosis: Diagnosis) -> list[str]:
    return [step.effect.id for step in diagnosis.steps]


@pytest.mark.parametrize(
    ("effect", "theta"),
    sampled(
        [
            ("link_expansion", (1.5,)),
            ("link_elasticity", (1 / 40,)),
            ("backlash", (0.8, 1.1, 0.6)),
            ("scale_gain", (8.0, -6.0, 11.0)),
            ("frame_rod_expansion", (0.7,)),
            ("tool_expansion", (9.0,)),
            ("reference_drift", (2.0, -1.0, 1.5)),
        ],
        2,
    ),
)
def test_one_hidden_effect_is_named_first(tmp_path: Path, effect: str, theta: tuple[float, ...]) -> None:
    diagnosis = diagnose_with_effects(tmp_path, {effect: theta})
    assert effect_ids(diagnosis) == [effect]
    assert diagnosis.verdict in ("identified", "ambiguous")
    assert diagnosis.after.floor_ratio < 1.2 < diagnosis.before.floor_ratio
    for number, true in zip(diagnosis.steps[0].parameters, theta, strict=True):
        shown = 1 / true if effect == "link_elasticity" else true
        assert abs(number.value - shown) < 4 * number.std
        assert number.plausible


def test_two_hidden_effects_are_both_named(tmp_path: Path) -> None:
    diagnosis = diagnose_with_effects(tmp_path, {"link_elasticity": (1 / 30,), "scale_expansion": (9.0,)})
    assert set(effect_ids(diagnosis)) == {"link_elasticity", "scale_expansion"}
    first, second = diagnosis.steps
    assert first.heldout_rms_um > second.heldout_rms_um
    assert diagnosis.after.rms_um < 1.1 * diagnosis.after.floor.um


@pytest.mark.long
def test_three_hidden_effects_are_all_named(tmp_path: Path) -> None:
    hidden = {"link_elasticity": (1 / 30,), "scale_expansion": (9.0,), "backlash": (1.0, 0.9, 1.2)}
    diagnosis = diagnose_with_effects(tmp_path, hidden)
    assert set(effect_ids(diagnosis)) == set(hidden)


def test_a_searched_constant_is_found_with_its_effect(tmp_path: Path) -> None:
    diagnosis = diagnose_with_effects(tmp_path, {"link_expansion_lag": (2.0,)})
    assert effect_ids(diagnosis) == ["link_expansion_lag"]
    assert diagnosis.steps[0].fitted.constants["tau"] == pytest.approx(900.0, rel=0.2)


def test_nothing_hidden_is_adequate_and_costs_no_search(tmp_path: Path) -> None:
    stages: list[str] = []
    diagnosis = diagnose(record_with_effects(tmp_path / "run.csv", 3, {}), (), None, EFFECTS, stages.append)
    assert (diagnosis.verdict, diagnosis.steps, diagnosis.depends_on) == ("adequate", (), ())
    assert all(candidate.status in ("no_gain", "not_testable") for candidate in diagnosis.candidates)
    assert "every covariate, lag, direction and time" not in stages


def test_weak_disturbances_are_no_verdict(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    aligned = record_with_effects(tmp_path / "still.csv", 4, {})
    warm = aligned.rows.quantities["temperature_tool_degC"] - 20.0
    wet = aligned.rows.quantities["humidity_pct"] - 50.0
    weak_um = 0.03 * (warm[:, None] * rng.standard_normal(3) + wet[:, None] / 8.0 * rng.standard_normal(3))
    diagnosis = diagnose_with_effects(tmp_path, {}, seed=4, extra_um=weak_um)
    assert diagnosis.verdict == "adequate"


def test_outliers_are_listed_and_change_nothing(tmp_path: Path) -> None:
    clean = diagnose_with_effects(tmp_path, {"link_expansion": (1.5,)})
    diagnosis = diagnose_with_effects(tmp_path, {"link_expansion": (1.5,)}, outliers=3)
    assert effect_ids(diagnosis) == ["link_expansion"]
    assert diagnosis.as_json()["outlier_rows"] == [14, 34, 54]  # the header is row 1
    number, before = diagnosis.steps[0].parameters[0], clean.steps[0].parameters[0]
    assert abs(number.value - before.value) < before.std
    assert diagnosis.after.floor_ratio < 1.2


def test_an_effect_of_the_model_is_refitted_and_not_proposed_again(tmp_path: Path) -> None:
    both = {"link_elasticity": (1 / 30,), "scale_expansion": (9.0,)}
    first = diagnose_with_effects(tmp_path, {"link_elasticity": both["link_elasticity"]})
    aligned = record_with_effects(tmp_path / "both.csv", 2, both)
    diagnosis = diagnose(aligned, first.after.fitted, None, EFFECTS)
    assert effect_ids(diagnosis) == ["scale_expansion"]
    assert "link_elasticity" not in [candidate.effect for candidate in diagnosis.candidates]
    assert [fitted.effect.id for fitted in diagnosis.after.fitted] == ["link_elasticity", "scale_expansion"]


def test_what_cannot_be_told_apart_is_named_with_what_would_tell(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 6, {"tool_offset": (0.5, -0.4, 0.3)})
    diagnosis = diagnose(aligned, (), None, EFFECTS)
    (step,) = diagnosis.steps
    assert diagnosis.verdict == "ambiguous"
    assert {step.effect.id, *(rival.name for rival in step.rivals)} >= {"tool_offset", "link_zero"}
    assert step.rivals[0].cosine > 0.9
    assert "a tool of another length" in diagnosis.next_measurement[0]["measure"]


@pytest.mark.long
def test_an_effect_that_needs_an_implausible_number_is_not_named(tmp_path: Path) -> None:
    diagnosis = diagnose_with_effects(tmp_path, {"frame_comparator_gain": (-0.8,)})  # 16 times what any comparator errs
    assert "frame_comparator_gain" not in effect_ids(diagnosis)
    result = {candidate.effect: candidate for candidate in diagnosis.candidates}["frame_comparator_gain"]
    assert result.status == "partial"
    assert "implausible" in result.why


def test_missing_columns_are_not_testable_and_say_which(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"link_expansion": (1.5,)})
    text = (tmp_path / "run.csv").read_text().replace("force_x_N", "current_x_A")
    (tmp_path / "less.csv").write_text(text)
    (tmp_path / "less.yaml").write_text((tmp_path / "run.yaml").read_text())
    recording, configuration = read_with_machine(tmp_path / "less.csv", None)
    diagnosis = diagnose(align_recording(recording, configuration), (), None, EFFECTS)
    results = {candidate.effect: candidate for candidate in diagnosis.candidates}
    assert aligned.rows.links == 3
    assert results["link_elasticity"].status == "not_testable"
    assert "force_x_N" in results["link_elasticity"].why
    assert effect_ids(diagnosis) == ["link_expansion"]


def test_json_has_the_keys_of_the_verdict_and_no_nan(tmp_path: Path) -> None:
    data = diagnose_with_effects(tmp_path, {"link_elasticity": (1 / 30,)}).as_json()
    again = json.loads(json.dumps(data, allow_nan=False))
    assert set(again) >= {
        "verdict",
        "noise_floor_um",
        "noise_floor_source",
        "residual_rms_um",
        "floor_ratio",
        "steps",
        "candidates",
        "depends_on",
        "next_measurement",
        "final_rms_um",
        "final_floor_ratio",
    }
    step = again["steps"][0]
    assert set(step) >= {"effect", "rivals", "heldout_rms_um", "explained_fraction", "p_adjusted", "parameters"}
    assert set(step["parameters"][0]) == {"name", "value", "std", "unit", "plausible", "determined"}
    assert step["p_adjusted"] <= 0.01
    assert again["floor_ratio"] == pytest.approx((again["residual_rms_um"] / again["noise_floor_um"]) ** 2)
    wanted = {"effect", "status", "why", "heldout_rms_um", "explained_fraction", "p_adjusted", "parameters"}
    assert all(set(candidate) == wanted for candidate in again["candidates"])
    assert {candidate["effect"] for candidate in again["candidates"]} == set(LIBRARY)


def test_a_holdout_recording_is_looked_at_with_what_was_learned_elsewhere(tmp_path: Path) -> None:
    diagnosis = diagnose_with_effects(tmp_path, {"link_expansion": (1.5,)})
    holdout = evaluate_holdout(diagnosis, record_with_effects(tmp_path / "other.csv", 9, {"link_expansion": (1.5,)}))
    assert holdout.after.floor_ratio < 1.2 < holdout.before.floor_ratio
    assert np.array_equal(holdout.after.fitted[0].theta, diagnosis.after.fitted[0].theta)
    low, high = holdout.expected_um
    assert low < holdout.after.rms_um < high < 1.6 * low
    assert not holdout.other_conditions
    assert " um, with 90 %." in holdout.summary


def test_of_a_sealed_recording_under_other_conditions_nothing_is_expected(tmp_path: Path) -> None:
    diagnosis = diagnose_with_effects(tmp_path, {"link_expansion": (1.5,)})
    other = record_with_effects(tmp_path / "other.csv", 9, {"link_expansion": (1.5,)})
    name = "temperature_link_1_degC"
    quantities = {**other.rows.quantities, name: other.rows.quantities[name] + 40.0}
    holdout = evaluate_holdout(diagnosis, replace(other, rows=replace(other.rows, quantities=quantities)))
    assert [text.split(" was ")[0] for text in holdout.other_conditions] == [name]
    assert "Expected: not known: other conditions (temperature_link_1_degC was " in holdout.summary
    assert holdout.as_json()["expected_um"] is None


@pytest.mark.parametrize(("there", "says"), [(0.1, "holds here: "), (0.0, "does not hold here: ")])
def test_a_description_is_tried_on_a_sealed_recording(tmp_path: Path, there: float, says: str) -> None:
    def recorded(seed: int, per_pct: float) -> AlignedRecording:
        humid_um = per_pct * (campaign(seed)["humidity_pct"][:, None] - 50.0) * (0.3, -0.5, 1.0)
        return record_with_effects(tmp_path / f"{seed}.csv", seed, {}, extra_um=humid_um)

    diagnosis = diagnose(recorded(4, 0.1), (), None, EFFECTS)
    assert diagnosis.depends_on[0].covariate == "humidity_pct"
    holdout = evaluate_holdout(diagnosis, recorded(9, there))
    assert holdout.described is not None
    assert f"What the rest followed, {holdout.described.name}, {says}" in holdout.summary
    assert holdout.described.holds == (holdout.described.rms_um < holdout.after.rms_um)
    assert (holdout.described.rms_um < 1.1 * holdout.after.floor.um) == (there > 0)


def test_a_description_needs_its_quantity_on_a_sealed_recording(tmp_path: Path) -> None:
    humid_um = 0.1 * (campaign(4)["humidity_pct"][:, None] - 50.0) * (0.3, -0.5, 1.0)
    diagnosis = diagnose(record_with_effects(tmp_path / "4.csv", 4, {}, extra_um=humid_um), (), None, EFFECTS)
    other = record_with_effects(tmp_path / "9.csv", 9, {})
    quantities = {name: values for name, values in other.rows.quantities.items() if name != "humidity_pct"}
    holdout = evaluate_holdout(diagnosis, replace(other, rows=replace(other.rows, quantities=quantities)))
    assert "cannot be tried here: humidity_pct was not recorded." in holdout.summary


@pytest.mark.long
@pytest.mark.parametrize("folder", EXAMPLES or [None], ids=lambda path: path.name if path else "absent")
def test_the_examples(folder: Path | None) -> None:
    if folder is None:
        pytest.skip("the example recordings (../shared/recordings) are not here")
    answer = json.loads((folder / "answer.json").read_text())
    recording, configuration = read_with_machine(folder / "train.csv", None)
    diagnosis = diagnose(align_recording(recording, configuration), (), None, EFFECTS)
    assert effect_ids(diagnosis) == answer["answers"]
    wanted = {"adequate": "adequate", "outside": "unexplained"}.get(answer["kind"], "identified")
    assert diagnosis.verdict == wanted
    if answer["kind"] == "outside":
        assert [finding.covariate for finding in diagnosis.depends_on][:1] == ["humidity_pct"]
        return
    recording, configuration = read_with_machine(folder / "valid.csv", None)
    assert evaluate_holdout(diagnosis, align_recording(recording, configuration)).after.floor_ratio <= 1.1
