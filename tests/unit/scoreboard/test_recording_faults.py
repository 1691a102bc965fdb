"""What happens to recordings: each fault does what it says to the reference, and to nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from compd.simulation.truth.instruments import TRACKER_SIGMA_UM
from tests.scoreboard import recording_faults as faults

ROWS = 600
UM = 1e-3


@pytest.fixture
def columns():
    rng = np.random.default_rng(1)
    reference = {f"reference_{axis}_mm": np.round(rng.uniform(-60, 60, ROWS), 6) for axis in "xyz"}
    places = ("link_1", "link_2", "room")
    return {
        "time_s": np.arange(ROWS) * 25.0,
        **{f"temperature_{place}_degC": np.full(ROWS, 20.0) for place in places},
        **reference,
    }


def error_um(before, after):
    return (faults.reference_mm(after) - faults.reference_mm(before)) / UM


def test_glints_are_4_percent_and_a_run_of_18(columns):
    error = error_um(columns, faults.with_glints(columns, np.random.default_rng(2)))
    gross = (np.abs(error) > 1e-6).any(axis=1)
    assert 18 + 0.02 * ROWS < gross.sum() < 18 + 0.06 * ROWS
    runs = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], gross, [0]])))).tolist()[::2]
    assert max(runs) >= 18
    assert 1.0 < np.median(np.abs(error[gross])) < 8.0


def test_a_shift_is_the_same_in_all_rows(columns):
    error = error_um(columns, faults.with_shift(columns))
    assert np.ptp(error, axis=0).max() < 1e-6
    np.testing.assert_allclose(error[0] / TRACKER_SIGMA_UM, (20.0, -14.0, 8.0), atol=1e-6)


@pytest.mark.parametrize("comes_back", [True, False])
def test_wandering_noise_is_correlated_in_time_and_has_no_mean(columns, comes_back):
    error = error_um(columns, faults.with_wander(columns, np.random.default_rng(3), comes_back))
    assert np.abs(error.mean(axis=0)).max() < 1e-3
    assert 2.0 <= np.sqrt(np.mean(error**2)) / TRACKER_SIGMA_UM <= 6.0
    correlation = np.corrcoef(error[1:, 0], error[:-1, 0])[0, 1]
    assert correlation > 0.9


def test_an_instruments_frame_is_a_rigid_motion(columns):
    turned = faults.reference_mm(faults.in_instrument_frame(columns, np.random.default_rng(4)))
    distances = np.linalg.norm(np.diff(faults.reference_mm(columns), axis=0), axis=1)
    np.testing.assert_allclose(np.linalg.norm(np.diff(turned, axis=0), axis=1), distances, atol=5e-6)
    assert np.abs(turned - faults.reference_mm(columns)).max() > 10


def test_a_thermometer_is_missing(columns):
    left = faults.without(columns, r"temperature_link_\d+_degC")
    assert set(columns) - set(left) == {"temperature_link_1_degC", "temperature_link_2_degC"}


def test_ten_sensors_more_and_the_same_reference(columns):
    more = faults.with_distractors(columns, np.random.default_rng(5))
    assert len(more) == len(columns) + 10
    assert all((more[name] == columns[name]).all() for name in columns)


def test_values_in_steps_are_multiples_of_one(columns):
    shown = faults.reference_mm(faults.in_steps(columns, np.random.default_rng(6)))
    steps = [step for step in faults.STEPS_UM if np.allclose(shown / UM / step, np.round(shown / UM / step), atol=1e-5)]
    assert steps
    error = (shown - faults.reference_mm(columns)) / UM
    assert np.sqrt(np.mean(error**2)) == pytest.approx(steps[-1] / np.sqrt(12), rel=0.1)
    assert faults.rms_um({**columns, **_reference(shown)}, columns) == pytest.approx(np.sqrt(np.mean(error**2)))


def test_a_target_sits_elsewhere_from_a_session_on(columns):
    sessions = {**columns, "session": 1.0 + np.arange(ROWS) // 150}
    moved, begin_s = faults.with_target_re_mounted(sessions, np.random.default_rng(7))
    error = error_um(columns, moved)
    later = columns["time_s"] >= begin_s
    assert 0 < later.sum() < ROWS
    assert later.sum() % 150 == 0
    assert np.abs(error[~later]).max() < 1e-6
    assert np.ptp(error[later], axis=0).max() < 1e-5
    assert 4.0 <= np.sqrt(np.mean(error[later] ** 2)) / TRACKER_SIGMA_UM <= 12.0


def test_a_touched_plane_has_one_height_and_no_pin(columns):
    touched = {name: values for name, values in columns.items() if not name.startswith("reference_")}
    touched |= {"point": 1.0 + np.arange(ROWS) % 5, "pin": np.ones(ROWS)}
    plane = faults.on_a_plane(touched, np.array([[x, 0.0, -12.5] for x in range(5)]))
    assert set(plane["reference_z_mm"]) == {-12.5}
    assert not {"pin", "reference_x_mm", "reference_y_mm"} & set(plane)


def _reference(values):
    return dict(zip((f"reference_{axis}_mm" for axis in "xyz"), values.T, strict=True))
