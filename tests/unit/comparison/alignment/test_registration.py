"""Registration: frames of instruments are laid over predictions; small motions of them are fitted along."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compd.comparison.alignment.registration import register, registration_columns
from compd.comparison.effect_fit import fit, initial_effect
from compd.comparison.nuisance import nuisance_beside
from compd.comparison.recording_comparison import compare
from compd.units import UM_PER_MM
from tests.support.external_recordings import SIGMA_UM, along, record_external

ROWS = 80


def places(dimensions: int = 3, seed: int = 1) -> np.ndarray:
    """(ROWS, 3) places, with z = 0 in a plane."""
    points = np.random.default_rng(seed).uniform(-100, 100, (ROWS, 3))
    points[:, dimensions:] = 0.0
    return points


@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("angle_deg", [0.0, 3.0, 90.0, 179.0])
def test_a_rigid_motion_is_found_and_never_a_mirror_image(dimensions: int, angle_deg: float) -> None:
    predicted = places(dimensions)
    turned = Rotation.from_rotvec([0.0, 0.0, angle_deg], degrees=True).as_matrix()
    shift = np.array([500.0, -20.0, 0.0])
    measured = (predicted - shift) @ turned
    found = register(measured, predicted)
    assert found is not None
    np.testing.assert_allclose(found.rotation, turned, atol=1e-12)
    np.testing.assert_allclose(found.into_M(measured), predicted, atol=1e-9)
    assert np.linalg.det(found.rotation) == pytest.approx(1.0)


def test_points_in_a_plane_are_not_turned_over() -> None:
    """Mirrored points fit best when the plane is turned over, which no instrument on a plate does."""
    predicted = places(2)
    found = register(predicted * [-1.0, 1.0, 1.0], predicted)
    assert found is not None
    np.testing.assert_allclose(found.rotation[2], [0.0, 0.0, 1.0])


def test_in_a_plane_only_the_rotation_in_it_is_left() -> None:
    tip = places(2)
    tip[:, 2] = np.nan
    columns = registration_columns(tip, (0, 1))
    assert columns.shape == (ROWS, 2, 3)
    np.testing.assert_array_equal(columns[:, :, :2], np.broadcast_to(np.eye(2), (ROWS, 2, 2)))
    lever = tip[:, :2] - tip[:, :2].mean(axis=0)
    rotation = columns[:, :, 2] * np.sqrt(np.mean(lever**2))
    np.testing.assert_allclose(rotation, np.stack([-lever[:, 1], lever[:, 0]], axis=1))


def test_in_space_there_are_three_rotations_and_along_one_axis_of_a_line_none() -> None:
    assert registration_columns(places(3), (0, 1, 2)).shape == (ROWS, 3, 6)
    line = places(1)
    line[:, 1:] = np.nan
    assert registration_columns(line, (0,)).shape == (ROWS, 1, 1)


def test_columns_are_the_derivatives_of_a_small_motion() -> None:
    points = places(3)
    columns = registration_columns(points, (0, 1, 2))
    centroid = points.mean(axis=0)
    spread = np.sqrt(np.mean((points - centroid) ** 2))
    for axis in range(3):
        turn = Rotation.from_rotvec(1e-6 * np.eye(3)[axis]).as_matrix()
        moved = (points - centroid) @ turn.T + centroid - points
        np.testing.assert_allclose(columns[:, :, 3 + axis], moved / 1e-6 / spread, atol=1e-5)


def test_a_plate_that_lies_turned_on_its_instrument_has_no_error(tmp_path: Path) -> None:
    points = places(2)
    turned = points @ Rotation.from_rotvec([0, 0, 0.002]).as_matrix().T + [30.0, -7.0, 0.0]
    error_um = {axis: 1e3 * (turned - points)[:, k] for k, axis in enumerate("xy")}
    model_mm = {axis: points[:, k] for k, axis in enumerate("xy")}
    aligned = record_external(tmp_path / "plate.csv", {}, error_um, model_mm=model_mm, frame="instrument")
    assert aligned.registration_columns.shape[2] == 3
    comparison = compare(aligned)
    assert comparison.rms_um == pytest.approx(SIGMA_UM, rel=0.15)
    as_machine = record_external(tmp_path / "own.csv", {}, error_um, model_mm=model_mm)
    assert as_machine.registration_columns.shape[2] == 2
    assert compare(as_machine).rms_um > 100


def test_a_constant_of_each_axis_is_taken_off_an_external_model(tmp_path: Path) -> None:
    points = places(2)
    error_um = {"x": np.full(ROWS, 400.0), "y": np.full(ROWS, -3.0)}
    aligned = record_external(
        tmp_path / "run.csv", {}, error_um, model_mm={axis: points[:, k] for k, axis in enumerate("xy")}
    )
    comparison = compare(aligned)
    assert comparison.constant_um == pytest.approx([400.0, -3.0], abs=0.2)
    assert comparison.rms_um == pytest.approx(SIGMA_UM, rel=0.15)


def test_an_effect_that_is_a_constant_takes_the_constant_and_others_leave_it(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    bed = 20 + np.cumsum(rng.normal(0, 1, ROWS))
    aligned = record_external(tmp_path / "run.csv", {"temperature_bed_degC": bed}, {"x": 2 * (bed - 20) + 50.0})
    offset = along("x", "offset", "k", parameters={"k": {"unit": "um", "plausible": [-1000, 1000], "source": "a test"}})
    slope = along("x", "slope", "k * (temperature_bed_degC - 20)")
    use = np.ones(ROWS, dtype=bool)
    initial = [initial_effect(effect, {}, 0) for effect in (offset, slope)]
    for effect, left in zip(initial, (0, 1), strict=True):
        own_um = aligned.columns(effect.effect, {}) * UM_PER_MM
        assert nuisance_beside(aligned, [effect], own_um, use).shape[2] == left
    together, alone = fit(aligned, initial), fit(aligned, initial[1:])
    assert together.fitted[0].theta[0] == pytest.approx(50.0, abs=1.0)
    assert together.fitted[1].theta == pytest.approx(alone.fitted[0].theta, rel=1e-3)
    assert alone.fitted[0].theta[0] == pytest.approx(2.0, abs=0.05)
    assert compare(aligned, together.fitted).constant_um == pytest.approx([0.0], abs=1e-6)
