"""What a residual follows: causes that the library does not have, described and never named."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.comparison import AlignedRecording, fit, initial_effect
from compd.diagnosis.recording_diagnosis import diagnose
from compd.diagnosis.verdict import Diagnosis
from compd.diagnosis.words.error_fall import error_fall
from compd.model.library import find_effect
from compd.report.diagnosis_evidence import findings_table
from tests.support.hidden_effects import LIBRARY, record_with_effects
from tests.support.paths import SHARED
from tests.support.sampled import sampled

EFFECTS = list(LIBRARY.values())
Cause = Callable[[AlignedRecording], FloatArray]


def swell_with_humidity(aligned: AlignedRecording) -> FloatArray:
    """All links swell with humidity: the tip by the Jacobian's row sums."""
    by_links = aligned.sensitivity(["link"])["link"].tip.sum(axis=2)
    return by_links * 0.05 * (aligned.rows.quantities["humidity_pct"] - 50.0)[:, None]


def rise_with_pressure(aligned: AlignedRecording) -> FloatArray:
    return np.outer(0.08 * (aligned.rows.quantities["pressure_hPa"] - 1013.0), (0.3, 0.0, 1.0))


def step_in_time(aligned: AlignedRecording) -> FloatArray:
    return np.outer(aligned.rows.time_s > 3000.0, (0.8, -0.5, 0.4))


def swing_in_time(aligned: AlignedRecording) -> FloatArray:
    return np.outer(np.sin(2 * np.pi * aligned.rows.time_s / 800.0), (0.0, 0.2, 0.7))


def drag_at_one_side(aligned: AlignedRecording) -> FloatArray:
    away = np.maximum(0.0, 0.5 + aligned.rows.tip_M_mm[:, 0] / 120.0)
    return np.outer(away**3, (-0.9, 0.0, 0.3))


def diagnose_with_cause(path: Path, cause: Cause, effects: dict[str, tuple[float, ...]], seed: int = 1) -> Diagnosis:
    """The diagnosis of a recording on which a cause outside the library acts beside the effects."""
    still = record_with_effects(path / "still.csv", seed, {})
    aligned = record_with_effects(path / "run.csv", seed, effects, extra_um=cause(still))
    return diagnose(aligned, (), None, EFFECTS)


@pytest.mark.parametrize(
    ("cause", "covariate", "form"),
    sampled(
        [
            (swell_with_humidity, "humidity_pct", "linear"),
            (rise_with_pressure, "pressure_hPa", "linear"),
            (drag_at_one_side, "tip_x_mm", "knee"),
            (swing_in_time, "time_s", "periodic"),
        ],
        4,
    ),
)
def test_a_cause_outside_the_library_is_described_and_not_named(
    tmp_path: Path, cause: Cause, covariate: str, form: str
) -> None:
    diagnosis = diagnose_with_cause(tmp_path, cause, {})
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.steps == ()
    assert (diagnosis.depends_on[0].covariate, diagnosis.depends_on[0].form) == (covariate, form)
    # the drag is a cube with a bend, and described by a parabola
    assert diagnosis.depends_on[0].explained_fraction > (0.8 if form == "square" else 0.95)
    assert diagnosis.depends_on[0].p_value <= 0.01
    assert bool(diagnosis.next_measurement) == (covariate != "time_s"), "time varies by itself"


@pytest.mark.long
def test_a_step_in_time_is_an_effect_that_makes_a_constant_and_begins_then(tmp_path: Path) -> None:
    diagnosis = diagnose_with_cause(tmp_path, step_in_time, {})
    assert (diagnosis.verdict, diagnosis.steps) == ("unexplained", ())
    first = diagnosis.depends_on[0]
    assert (first.covariate, first.form) == ("time_s", "change")
    assert first.effect in ("reference_registration", "tool_offset", "link_zero", "base_joint_position")
    assert first.time_s == pytest.approx(3000.0, rel=0.1)
    assert first.explained_fraction > 0.95


@pytest.mark.long
@pytest.mark.sample
def test_the_proposed_formula_can_be_pasted_and_lowers_the_error_to_the_floor(tmp_path: Path) -> None:
    diagnosis = diagnose_with_cause(tmp_path, swell_with_humidity, {})
    finding = diagnosis.depends_on[0].as_json()
    assert finding["port"] == "link"
    assert finding["note"] == "a description, not a cause"
    effect = find_effect(finding["formula_effect"], "pasted")
    aligned = diagnosis.before.aligned
    result = fit(aligned, [initial_effect(effect, {}, aligned.rows.links)], diagnosis.before.floor.by_axis_um)
    assert result.rms_um < 1.1 * diagnosis.before.floor.um
    slope = dict(zip((name.split(".")[1] for name in result.names), result.fitted[0].theta, strict=True))["k"]
    assert slope == pytest.approx(0.05, abs=0.004)
    assert finding["fitted"][0]["k"] == pytest.approx(slope, abs=1e-3)
    low, high = finding["formula_effect"]["parameters"]["k"]["plausible"]
    assert low < slope < high


@pytest.mark.long
def test_a_period_is_told_with_its_unit(tmp_path: Path) -> None:
    diagnosis = diagnose_with_cause(tmp_path, swing_in_time, {})
    (constant,) = diagnosis.depends_on[0].as_json()["constants"]
    assert (constant["covariate"], constant["name"], constant["unit"]) == ("time_s", "period", "s")
    assert constant["value"] == pytest.approx(800.0, rel=0.02)
    assert f"/ {constant['value']:.15g})" in diagnosis.depends_on[0].formula_effects[0]["formula"]
    form = findings_table(diagnosis, error_fall(diagnosis)).rows[0][1]
    assert re.fullmatch(r"periodic, period = (79\d|8\d\d)(\.\d)? s", form)


@pytest.mark.long
def test_one_effect_and_a_cause_outside_are_both_told(tmp_path: Path) -> None:
    diagnosis = diagnose_with_cause(tmp_path, swell_with_humidity, {"link_elasticity": (1 / 30,)})
    assert diagnosis.verdict == "partial"
    assert [step.effect.id for step in diagnosis.steps] == ["link_elasticity"]
    assert diagnosis.depends_on[0].covariate == "humidity_pct"
    assert diagnosis.as_json()["verdict"] == "partial"


def test_the_real_frame_needs_two_temperatures() -> None:
    path = SHARED / "real" / "voron-frame-expansion.csv"
    if not path.exists():
        pytest.skip("the real recording (../shared/real) is not here")
    from compd.comparison import read_with_machine
    from compd.comparison.alignment.align_recording import align_recording

    diagnosis = diagnose(align_recording(*read_with_machine(path, None)), (), None, EFFECTS)
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.steps == ()
    pairs = [finding for finding in diagnosis.depends_on if finding.beside]
    assert {pairs[0].covariate, *pairs[0].beside} == {"temperature_frame_degC", "temperature_bed_degC"}
    # one temperature is not enough, two nearly are: 43 um and 5.7 um, each in its own blocks of time
    alone = min(finding.heldout_rms_um for finding in diagnosis.depends_on if not finding.beside)
    assert pairs[0].heldout_rms_um < 7.0
    assert alone > 15.0
