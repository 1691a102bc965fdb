"""Effects that take little: named where they surely act, and never as identified."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from compd.comparison import AlignedRecording
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.findings import DiagnosisStep
from compd.diagnosis.holdout import evaluate_holdouts
from compd.diagnosis.little_effects import little_effects
from compd.diagnosis.recording_diagnosis import diagnose
from compd.diagnosis.verdict import Diagnosis
from compd.diagnosis.words.summary_lines import summary_lines
from tests.support.diagnoses import step
from tests.support.external_recordings import SIGMA_UM, along, record_external

ROWS = 900
PLAY = along("x", "play", "k * moved_1")
BEND = along("x", "bend", "k * moved_2")
HEAD = along("x", "head", "k * moved_3")


def stage(path: Path, size: Mapping[str, float], seed: int = 1) -> AlignedRecording:
    """A stage with effects of a size each, rms over the noise."""
    rng = np.random.default_rng(seed)
    columns = {name: rng.choice([-1.0, 1.0], ROWS) for name in ("moved_1", "moved_2", "moved_3")}
    error_um = sum(SIGMA_UM * size.get(name, 0.0) * values for name, values in columns.items())
    return record_external(path, columns, {"x": error_um}, seed=seed)


def diagnosed(path: Path, **size: float) -> Diagnosis:
    return diagnose(stage(path / "run.csv", size), (), None, [PLAY, BEND, HEAD])


@pytest.mark.parametrize(
    ("size", "verdict"), [(0.15, "adequate"), (0.33, "likely"), (0.6, "identified")], ids=["weak", "little", "half"]
)
def test_alone_an_effect_is_likely_where_it_takes_more_than_what_stays_unnamed(
    tmp_path: Path, size: float, verdict: str
) -> None:
    diagnosis = diagnosed(tmp_path, moved_1=size)
    assert diagnosis.verdict == verdict
    assert [found.effect.id for found in diagnosis.steps] == ([] if verdict == "adequate" else ["play"])


@pytest.mark.parametrize(("size", "verdict"), [(0.7, "likely"), (1.3, "identified")], ids=["little", "enough"])
def test_beside_another_an_effect_is_identified_where_it_takes_more_than_the_noise(
    tmp_path: Path, size: float, verdict: str
) -> None:
    diagnosis = diagnosed(tmp_path, moved_1=4.0, moved_2=size)
    assert [found.effect.id for found in diagnosis.steps] == ["play", "bend"]
    assert diagnosis.verdict == verdict
    said = "bend takes less than the noise and may be something else: measure where it does more"
    assert (said in diagnosis.summary) == (verdict == "likely")
    assert diagnosis.doubt_of("bend").startswith("bend takes less than") == (verdict == "likely")
    assert diagnosis.doubt_of("play") == ""
    lines = " ".join(line.strip() for line in summary_lines(diagnosis))
    assert ("bend takes less than the noise" in lines) == (verdict == "likely")


@pytest.mark.parametrize(("size", "verdict"), [(0.7, "likely"), (1.3, "identified")], ids=["little", "enough"])
def test_a_sealed_recording_does_not_identify_what_takes_little(tmp_path: Path, size: float, verdict: str) -> None:
    acts = {"moved_1": 4.0, "moved_2": size}
    other = stage(tmp_path / "other.csv", acts, seed=2)
    diagnosis, holdouts = evaluate_holdouts(diagnosed(tmp_path, **acts), [other])
    assert holdouts[0].after.at_floor
    assert diagnosis.verdict == verdict


def test_the_first_effect_has_to_take_less_than_the_others() -> None:
    def taking(effect: str, squares: float) -> DiagnosisStep:
        return replace(step(effect, [1.0], 0.1, 1.0), taken=squares)

    criteria = Criteria()
    steps = [taking("link_expansion", 0.3), taking("gauge_latency", 0.9), taking("link_sag", 1.1)]
    assert little_effects(steps, criteria) == ["gauge_latency"]
    assert little_effects(steps[:1], criteria) == []
    assert little_effects([taking("link_sag", 0.1)], criteria) == ["link_sag"]
    assert little_effects([taking("link_sag", float("nan"))], criteria) == []
