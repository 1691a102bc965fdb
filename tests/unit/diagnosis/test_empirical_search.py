"""What a residual follows: causes that the library does not have, described and never named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.fit import fit, start
from compd.diagnosis.cross_validation import SECTORS, schemes
from compd.diagnosis.diagnose import diagnose
from compd.diagnosis.regression import Block, Evidence, sums
from compd.diagnosis.significance import FLIPS, chances
from compd.diagnosis.verdict import Diagnosis
from compd.model.library import find_effect
from tests.support.diagnosed import LIBRARY, recorded
from tests.support.paths import SHARED

EFFECTS = list(LIBRARY.values())
Cause = Callable[[AlignedRecording], FloatArray]


def wet(aligned: AlignedRecording) -> FloatArray:
    """All links swell with humidity: the tip by the Jacobian's row sums."""
    by_links = aligned.sensitivity(["link"])["link"].tip.sum(axis=2)
    return by_links * 0.05 * (aligned.rows.quantities["humidity_pct"] - 50.0)[:, None]


def pressed(aligned: AlignedRecording) -> FloatArray:
    return np.outer(0.08 * (aligned.rows.quantities["pressure_hPa"] - 1013.0), (0.3, 0.0, 1.0))


def hit(aligned: AlignedRecording) -> FloatArray:
    return np.outer(aligned.rows.time_s > 3000.0, (0.8, -0.5, 0.4))


def breathing(aligned: AlignedRecording) -> FloatArray:
    return np.outer(np.sin(2 * np.pi * aligned.rows.time_s / 800.0), (0.0, 0.2, 0.7))


def dragged(aligned: AlignedRecording) -> FloatArray:
    away = np.maximum(0.0, 0.5 + aligned.rows.tip_M_mm[:, 0] / 120.0)
    return np.outer(away**3, (-0.9, 0.0, 0.3))


def caused(path: Path, cause: Cause, effects: dict[str, tuple[float, ...]], seed: int = 1) -> Diagnosis:
    """The diagnosis of a recording on which a cause that nobody knows acts along."""
    still = recorded(path / "still.csv", seed, {})
    aligned = recorded(path / "run.csv", seed, effects, extra_um=cause(still))
    return diagnose(aligned, (), None, EFFECTS)


@pytest.mark.parametrize(
    ("cause", "covariate", "form"),
    [
        (wet, "humidity_pct", "linear"),
        (pressed, "pressure_hPa", "linear"),
        (hit, "time_s", "step"),
        (breathing, "time_s", "periodic"),
        (dragged, "tip_x_mm", "knee"),
    ],
)
def test_a_cause_outside_the_library_is_described_and_not_named(
    tmp_path: Path, cause: Cause, covariate: str, form: str
) -> None:
    found = caused(tmp_path, cause, {})
    assert found.verdict == "unexplained"
    assert found.steps == ()
    assert (found.depends_on[0].covariate, found.depends_on[0].form) == (covariate, form)
    # the drag is a cube with a bend, and described by a parabola
    assert found.depends_on[0].explained_fraction > (0.8 if form == "square" else 0.95)
    assert found.depends_on[0].p_adjusted <= 0.01
    assert found.next_measurement


def test_the_proposed_formula_can_be_pasted_and_lowers_the_error_to_the_floor(tmp_path: Path) -> None:
    found = caused(tmp_path, wet, {})
    first = found.depends_on[0].as_json()
    assert first["port"] == "link"
    assert first["note"] == "a description, not a cause"
    effect = find_effect(first["formula_effect"], "pasted")
    aligned = found.before.aligned
    result = fit(aligned, [start(effect, {}, aligned.rows.links)], found.before.floor.by_axis_um)
    assert result.rms_um < 1.1 * found.before.floor.um
    slope = dict(zip((name.split(".")[1] for name in result.names), result.fitted[0].theta, strict=True))["k"]
    assert slope == pytest.approx(0.05, abs=0.004)
    assert first["fitted"][0]["k"] == pytest.approx(slope, abs=1e-3)
    low, high = first["formula_effect"]["parameters"]["k"]["plausible"]
    assert low < slope < high


def test_one_effect_and_a_cause_outside_are_both_told(tmp_path: Path) -> None:
    found = caused(tmp_path, wet, {"link_elasticity": (1 / 30,)})
    assert found.verdict == "unexplained"
    assert [step.effect.id for step in found.steps] == ["link_elasticity"]
    assert found.depends_on[0].covariate == "humidity_pct"
    assert found.as_json()["verdict"] == "unexplained"


def test_the_real_frame_needs_two_temperatures() -> None:
    path = SHARED / "real" / "voron-frame-expansion.csv"
    if not path.exists():
        pytest.skip("the real recording (../shared/real) is not here")
    from compd.cli.recording import read_with_machine
    from compd.comparison.aligned_recording import align_recording

    found = diagnose(align_recording(*read_with_machine(path, None)), (), None, EFFECTS)
    assert found.verdict == "unexplained"
    assert found.steps == ()
    both = [one for one in found.depends_on if one.beside]
    assert {both[0].covariate, *both[0].beside} == {"temperature_frame_degC", "temperature_bed_degC"}
    # one temperature is not enough, two nearly are: 43 um and 5.7 um, each in its own blocks of time
    alone = min(one.heldout_rms_um for one in found.depends_on if not one.beside)
    assert both[0].heldout_rms_um < 7.0
    assert alone > 15.0


def evidence(seed: int, rows: int = 120) -> Evidence:
    rng = np.random.default_rng(seed)
    folds = (np.arange(rows) * 4 // rows, rng.integers(0, 5, rows))
    always = Block(rng.standard_normal((rows, 3, 2)), np.full(2, np.inf))
    return Evidence(rng.standard_normal((rows, 3)), folds, np.arange(rows) * 12 // rows, always)


def test_held_out_errors_are_those_of_fits_without_the_fold() -> None:
    one = evidence(1)
    block = Block(np.random.default_rng(2).standard_normal((120, 3, 3)), np.full(3, np.inf))
    total, (place,) = sums(one, [block])
    found = total.held_out([np.concatenate([[0, 1], place])], np.ones((1, 2), dtype=bool))[0]
    columns = np.concatenate([one.always.values, block.values], axis=2)
    by_hand = []
    for fold in one.folds:
        squares = 0.0
        for k in np.unique(fold):
            out = fold == k
            theta, *_ = np.linalg.lstsq(columns[~out].reshape(-1, 5), one.y[~out].ravel(), rcond=None)
            squares += float(((one.y[out] - columns[out] @ theta) ** 2).sum())
        by_hand.append(squares / one.y.size)
    assert found == pytest.approx(np.mean(by_hand), rel=1e-6)


def test_a_column_that_acts_in_one_fold_alone_cannot_be_learned() -> None:
    one = evidence(3)
    values = np.random.default_rng(4).standard_normal((120, 3, 1))
    values[one.folds[0] != 2] = 0.0
    total, (place,) = sums(one, [Block(values, np.full(1, np.inf))])
    assert total.learnable(place).tolist() == [False, True]


def test_folds_keep_points_and_sessions_whole(tmp_path: Path) -> None:
    aligned = recorded(tmp_path / "run.csv", 1, {})
    by_session, by_place = schemes(aligned)
    assert len(np.unique(by_session)) == 4
    assert len(np.unique(by_place)) == SECTORS
    point, session = aligned.recording.point, aligned.recording.session
    assert point is not None
    assert session is not None
    for names, fold in ((session, by_session), (point, by_place)):
        assert all(len(np.unique(fold[names == name])) == 1 for name in np.unique(names))


def test_chance_of_noise_is_a_chance_and_of_an_effect_none() -> None:
    rng = np.random.default_rng(7)
    group = np.arange(240) * 24 // 240
    columns = [[rng.standard_normal((240, 3, 2))] for _ in range(6)]
    by_noise = []
    for _ in range(40):
        y = rng.standard_normal((240, 3))
        by_noise.append(float(chances(columns, y, y, group).min()))
    assert np.mean(np.array(by_noise) < 0.05) <= 0.15  # 5 % is expected: 2 of 40
    y = columns[2][0] @ np.array([0.5, -0.5]) + rng.standard_normal((240, 3))
    found = chances(columns, y, rng.standard_normal((240, 3)), group)
    assert found[2] == pytest.approx(1 / (FLIPS + 1))
    assert int(np.argmin(found)) == 2
