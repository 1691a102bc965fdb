"""Diagnosis end to end: effects found one after another, outliers, memory, causes outside the library, verdicts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.comparison.aligned_recording import align_recording
from compd.comparison.open import read_with_machine
from compd.diagnosis.diagnose import diagnose
from compd.diagnosis.holdout import evaluate_holdout
from compd.diagnosis.verdict import Diagnosis
from tests.support.diagnosed import LIBRARY, recorded
from tests.support.paths import SHARED

EFFECTS = list(LIBRARY.values())
EXAMPLES = sorted(path.parent for path in SHARED.glob("recordings/*/answer.json"))


def diagnosed(path: Path, effects: dict[str, tuple[float, ...]], seed: int = 1, **given: Any) -> Diagnosis:
    return diagnose(recorded(path / "run.csv", seed, effects, **given), (), None, EFFECTS)


def names(found: Diagnosis) -> list[str]:
    return [step.effect.id for step in found.steps]


@pytest.mark.parametrize(
    ("effect", "theta"),
    [
        ("link_expansion", (1.5,)),
        ("link_elasticity", (1 / 40,)),
        ("backlash", (0.8, 1.1, 0.6)),
        ("scale_gain", (8.0, -6.0, 11.0)),
        ("frame_rod_expansion", (0.7,)),
        ("tool_expansion", (9.0,)),
        ("reference_drift", (2.0, -1.0, 1.5)),
    ],
)
def test_one_hidden_effect_is_named_first(tmp_path: Path, effect: str, theta: tuple[float, ...]) -> None:
    found = diagnosed(tmp_path, {effect: theta})
    assert names(found) == [effect]
    assert found.verdict in ("identified", "ambiguous")
    assert found.after.floor_ratio < 1.2 < found.before.floor_ratio
    for number, true in zip(found.steps[0].parameters, theta, strict=True):
        shown = 1 / true if effect == "link_elasticity" else true
        assert abs(number.value - shown) < 4 * number.std
        assert number.plausible


def test_two_hidden_effects_are_both_named(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, {"link_elasticity": (1 / 30,), "scale_expansion": (9.0,)})
    assert set(names(found)) == {"link_elasticity", "scale_expansion"}
    first, second = found.steps
    assert first.heldout_rms_um > second.heldout_rms_um
    assert found.after.rms_um < 1.1 * found.after.floor.um


def test_three_hidden_effects_are_all_named(tmp_path: Path) -> None:
    hidden = {"link_elasticity": (1 / 30,), "scale_expansion": (9.0,), "backlash": (1.0, 0.9, 1.2)}
    found = diagnosed(tmp_path, hidden)
    assert set(names(found)) == set(hidden)


def test_a_searched_constant_is_found_with_its_effect(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, {"link_expansion_lag": (2.0,)})
    assert names(found) == ["link_expansion_lag"]
    assert found.steps[0].fitted.constants["tau"] == pytest.approx(900.0, rel=0.2)


def test_nothing_hidden_is_adequate_and_costs_no_search(tmp_path: Path) -> None:
    said: list[str] = []
    found = diagnose(recorded(tmp_path / "run.csv", 3, {}), (), None, EFFECTS, said.append)
    assert (found.verdict, found.steps, found.depends_on) == ("adequate", (), ())
    assert all(one.status in ("no_gain", "not_testable") for one in found.candidates)
    assert "every covariate, lag, direction and time" not in said


def test_weak_disturbances_are_no_verdict(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    aligned = recorded(tmp_path / "still.csv", 4, {})
    warm = aligned.rows.quantities["temperature_tool_degC"] - 20.0
    wet = aligned.rows.quantities["humidity_pct"] - 50.0
    weak_um = 0.03 * (warm[:, None] * rng.standard_normal(3) + wet[:, None] / 8.0 * rng.standard_normal(3))
    found = diagnosed(tmp_path, {}, seed=4, extra_um=weak_um)
    assert found.verdict == "adequate"


def test_outliers_are_listed_and_change_nothing(tmp_path: Path) -> None:
    clean = diagnosed(tmp_path, {"link_expansion": (1.5,)})
    found = diagnosed(tmp_path, {"link_expansion": (1.5,)}, outliers=3)
    assert names(found) == ["link_expansion"]
    assert found.as_json()["outlier_rows"] == [14, 34, 54]  # the header is row 1
    number, before = found.steps[0].parameters[0], clean.steps[0].parameters[0]
    assert abs(number.value - before.value) < before.std
    assert found.after.floor_ratio < 1.2


def test_an_effect_of_the_model_is_refitted_and_not_proposed_again(tmp_path: Path) -> None:
    both = {"link_elasticity": (1 / 30,), "scale_expansion": (9.0,)}
    first = diagnosed(tmp_path, {"link_elasticity": both["link_elasticity"]})
    aligned = recorded(tmp_path / "both.csv", 2, both)
    found = diagnose(aligned, first.after.fitted, None, EFFECTS)
    assert names(found) == ["scale_expansion"]
    assert "link_elasticity" not in [one.effect for one in found.candidates]
    assert [one.effect.id for one in found.after.fitted] == ["link_elasticity", "scale_expansion"]


def test_what_cannot_be_told_apart_is_named_with_the_rows_that_can(tmp_path: Path) -> None:
    aligned = recorded(tmp_path / "run.csv", 6, {"tool_offset": (0.5, -0.4, 0.3)})
    found = diagnose(aligned, (), None, EFFECTS)
    (step,) = found.steps
    assert found.verdict == "ambiguous"
    assert {step.effect.id, *(rival.name for rival in step.rivals)} >= {"tool_offset", "link_zero"}
    assert all(0.9 < rival.cosine <= 1.0 for rival in step.rivals)
    assert {"tip_x_mm", "approach_1", "purpose"} <= set(found.next_measurement[0])


def test_an_effect_that_needs_an_implausible_number_is_not_named(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, {"frame_comparator_gain": (-0.8,)})  # 16 times what any comparator errs
    assert "frame_comparator_gain" not in names(found)
    judged = {one.effect: one for one in found.candidates}["frame_comparator_gain"]
    assert judged.status == "partial"
    assert "implausible" in judged.why


def test_missing_columns_are_not_testable_and_say_which(tmp_path: Path) -> None:
    aligned = recorded(tmp_path / "run.csv", 1, {"link_expansion": (1.5,)})
    text = (tmp_path / "run.csv").read_text().replace("force_x_N", "current_x_A")
    (tmp_path / "less.csv").write_text(text)
    (tmp_path / "less.yaml").write_text((tmp_path / "run.yaml").read_text())
    recording, configuration = read_with_machine(tmp_path / "less.csv", None)
    found = diagnose(align_recording(recording, configuration), (), None, EFFECTS)
    judged = {one.effect: one for one in found.candidates}
    assert aligned.rows.links == 3
    assert judged["link_elasticity"].status == "not_testable"
    assert "force_x_N" in judged["link_elasticity"].why
    assert names(found) == ["link_expansion"]


def test_json_has_the_keys_of_the_verdict_and_no_nan(tmp_path: Path) -> None:
    data = diagnosed(tmp_path, {"link_elasticity": (1 / 30,)}).as_json()
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
    assert set(step["parameters"][0]) == {"name", "value", "std", "unit", "plausible"}
    assert step["p_adjusted"] <= 0.01
    assert again["floor_ratio"] == pytest.approx((again["residual_rms_um"] / again["noise_floor_um"]) ** 2)
    wanted = {"effect", "status", "why", "heldout_rms_um", "explained_fraction", "p_adjusted", "parameters"}
    assert all(set(one) == wanted for one in again["candidates"])
    assert {one["effect"] for one in again["candidates"]} == set(LIBRARY)


def test_a_sealed_recording_is_looked_at_with_what_was_learned_elsewhere(tmp_path: Path) -> None:
    found = diagnosed(tmp_path, {"link_expansion": (1.5,)})
    sealed = evaluate_holdout(found, recorded(tmp_path / "other.csv", 9, {"link_expansion": (1.5,)}))
    assert sealed.after.floor_ratio < 1.2 < sealed.before.floor_ratio
    assert np.array_equal(sealed.after.fitted[0].theta, found.after.fitted[0].theta)


@pytest.mark.parametrize("folder", EXAMPLES or [None], ids=lambda path: path.name if path else "absent")
def test_the_examples(folder: Path | None) -> None:
    if folder is None:
        pytest.skip("the example recordings (../shared/recordings) are not here")
    answer = json.loads((folder / "answer.json").read_text())
    recording, configuration = read_with_machine(folder / "train.csv", None)
    found = diagnose(align_recording(recording, configuration), (), None, EFFECTS)
    assert names(found) == answer["answers"]
    wanted = {"adequate": "adequate", "outside": "unexplained"}.get(answer["kind"], "identified")
    assert found.verdict == wanted
    if answer["kind"] == "outside":
        assert [one.covariate for one in found.depends_on][:1] == ["humidity_pct"]
        return
    recording, configuration = read_with_machine(folder / "valid.csv", None)
    assert evaluate_holdout(found, align_recording(recording, configuration)).after.floor_ratio <= 1.1
