"""The attitude beside the tip: it counts with its own noise and unit, and its derivatives are those of the model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from compd.comparison.alignment.aligned_recording import AlignedRecording, effect_deltas
from compd.comparison.effect_fit import fit, initial_effect
from compd.comparison.nuisance import fit_along, nuisance_columns
from compd.comparison.recording_comparison import compare
from tests.support.measured import SIGMA_UM, aligned, hidden
from tests.support.pose_recordings import SIGMA_URAD, hexapod, poses


def opened(directory: Path, effects: tuple[Any, ...] = (), **options: Any) -> AlignedRecording:
    return aligned(poses(directory, effects, **options), hexapod())


def test_poses_without_an_error_are_at_both_floors(tmp_path: Path) -> None:
    comparison = compare(opened(tmp_path))
    assert comparison.aligned.labels == ("x", "y", "z", "rx", "ry", "rz")
    assert comparison.rms_um == pytest.approx(SIGMA_UM, rel=0.12)
    assert comparison.attitude_rms_urad == pytest.approx(SIGMA_URAD, rel=0.12)
    assert comparison.floor.um == pytest.approx(SIGMA_UM, rel=0.15)
    assert comparison.floor.by_axis_um[3:] == pytest.approx(np.full(3, SIGMA_URAD), rel=0.3)
    assert comparison.at_floor
    assert comparison.as_json()["attitude_counts"] is True


def test_noise_of_the_attitude_beyond_what_is_declared_is_told(tmp_path: Path) -> None:
    comparison = compare(opened(tmp_path, sigma_urad=0.2))
    assert comparison.rms_um == pytest.approx(SIGMA_UM, rel=0.12)
    # the noise of the attitude is ten times what was declared; repeats show it all the same
    assert "contradict" in comparison.floor.how
    assert "urad" in comparison.floor.how


def test_an_instruments_frame_and_the_targets_turn_are_fitted_along(tmp_path: Path) -> None:
    comparison = compare(opened(tmp_path, moved=True))
    assert comparison.aligned.registration_columns.shape == (150, 6, 12)
    assert comparison.rms_um == pytest.approx(SIGMA_UM, rel=0.12)
    assert comparison.attitude_rms_urad == pytest.approx(SIGMA_URAD, rel=0.12)
    assert comparison.at_floor


def test_the_derivative_of_the_attitude_is_the_models(tmp_path: Path) -> None:
    recording = opened(tmp_path)
    effect = initial_effect(hidden("link_elasticity", 50.0).effect, {}, 6)
    theta = np.array([1.0 / 50.0])
    columns = recording.columns(effect.effect, effect.constants) @ theta
    _, added = effect_deltas([hidden("link_elasticity", 50.0)], recording.rows)
    small = {port: 1e-2 * values for port, values in added.items()}
    difference = (recording.predicted_mm(small) - recording.predicted_mm({})) / 1e-2
    assert columns == pytest.approx(difference, abs=1e-7)
    assert np.abs(columns[:, 3:]).max() > 1e-3


def test_the_attitude_alone_finds_an_effect(tmp_path: Path) -> None:
    recording = opened(tmp_path, (hidden("link_elasticity", 50.0),))
    effect = initial_effect(hidden("link_elasticity", 50.0).effect, {}, 6)
    result = fit(recording, [effect], np.array([1e4 * SIGMA_UM] * 3 + [SIGMA_URAD] * 3))
    value, _ = effect.effect.columns(6)[0].parameter.from_theta(float(result.fitted[0].theta[0]))
    assert value == pytest.approx(50.0, rel=0.1)
    after = compare(recording, result.fitted)
    assert after.attitude_rms_urad == pytest.approx(SIGMA_URAD, rel=0.15)
    assert after.attitude_rms_urad < compare(recording).attitude_rms_urad


@pytest.mark.parametrize(
    ("declared", "counts"),
    [({}, True), ({"sigma_um": 5}, False), ({"sigma_urad": 20}, True), ({"sigma_um": 5, "sigma_urad": 20}, True)],
)
def test_the_attitude_counts_unless_the_noise_of_the_position_alone_is_declared(
    tmp_path: Path, declared: dict[str, int], counts: bool
) -> None:
    path = poses(tmp_path, moved=True)
    sidecar = yaml.safe_load(path.with_suffix(".yaml").read_text())
    reference = {name: value for name, value in sidecar["reference"].items() if "sigma" not in name}
    path.with_suffix(".yaml").write_text(yaml.safe_dump(sidecar | {"reference": reference | declared}))
    assert aligned(path, hexapod()).with_attitude is counts


def test_what_the_frame_takes_away_does_not_weigh_lengths_against_attitudes(tmp_path: Path) -> None:
    """The attitudes are far off and say little; a frame that begins elsewhere leaves the same."""
    recording = opened(tmp_path, moved=True)
    use = np.ones(150, dtype=bool)
    left_um = np.random.default_rng(5).normal(0, [1.0] * 3 + [300.0] * 3, (150, 6))
    columns_um = nuisance_columns(recording, ())
    away_um = columns_um @ (20.0 / np.sqrt(np.mean(columns_um**2, axis=(0, 1))))
    begins_um = (left_um, left_um + away_um)
    near, far = (residual_um - fit_along(recording, (), residual_um, use).total_um for residual_um in begins_um)
    assert np.abs(far - near).max() < 1e-3
