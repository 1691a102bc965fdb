"""Derivatives of measured poses by a drawing's numbers, beside differences of the whole prediction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import compd
from compd.calibration import calibration_parameters, pose_columns, without
from compd.calibration.poses import MeasuredPoses
from compd.comparison.alignment.aligned_recording import effect_deltas
from compd.machine_kinds import KINDS
from tests.support.built_machines import built, drawing, record


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_are_differences_on_a_machine_that_is_not_as_drawn(kind: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    world = built(drawing(kind, tmp_path, 1.0), rng, 1.0)
    recording = compd.open_recording(record(tmp_path / "a.csv", world, rng, 8))
    assert recording.model is not None
    parameters = calibration_parameters(recording.model, recording.rows)
    poses = MeasuredPoses.of(recording, parameters)
    theta = parameters.prior_std * rng.standard_normal(len(parameters.names))
    none = np.zeros((len(theta), len(theta)))
    blocks = range(len(parameters.blocks))
    now = poses.now(parameters.split(theta, none, blocks))

    def predicted_mm(numbers: np.ndarray) -> np.ndarray:
        effects = parameters.split(numbers, none, blocks)
        added = effect_deltas(effects, recording.rows)[1]
        return now.aligned.predicted_mm(added)

    for k in range(0, len(theta), 3):
        step = np.zeros(len(theta))
        step[k] = 1e-3 * parameters.prior_std[k]
        difference = (predicted_mm(theta + step) - predicted_mm(theta - step)) / 2e-3
        size = np.abs(difference).max()
        np.testing.assert_allclose(
            now.columns_mm[:, :, k] / size, difference / size, atol=2e-3, err_msg=parameters.names[k]
        )


def test_derivatives_of_poses_are_those_of_recordings(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    world = built(drawing("3-prs", tmp_path), rng)
    recording = compd.open_recording(record(tmp_path / "a.csv", world, rng, 8))
    assert recording.model is not None
    parameters = calibration_parameters(recording.model, recording.rows)
    columns = pose_columns(recording.model, recording.rows, parameters)
    columns[:, 3:] *= 1e3  # a urad as a um
    np.testing.assert_allclose(MeasuredPoses.of(recording, parameters).columns_mm, columns, atol=1e-12)


def test_of_no_rows_nothing_is_projected_out() -> None:
    assert without(np.zeros((0, 1)), np.zeros((0, 3))).shape == (0, 1)
