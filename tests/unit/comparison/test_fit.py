"""The fit: right numbers, honest errors, one search, and no help from rows that are gross."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from compd.comparison.alignment.aligned_recording import AlignedRecording, effect_deltas
from compd.comparison.effect_fit import fit, initial_effect
from compd.comparison.prediction_uncertainty import first_order_uncertainty, gauge_noise
from compd.comparison.recording_comparison import compare
from compd.comparison.shape_search import search_constants
from compd.errors import CompdError
from compd.model.effects import FittedEffect
from compd.model.library import load_library
from tests.support.measured import SIGMA_UM, aligned, gauges, hidden, record
from tests.support.monte_carlo import monte_carlo

Floats = NDArray[np.float64]
LIBRARY = load_library()


@pytest.fixture(scope="module")
def blank(tmp_path_factory: pytest.TempPathFactory) -> AlignedRecording:
    """A recording whose measured tips the tests replace."""
    return aligned(record(tmp_path_factory.mktemp("fit"), gauges(300, 40)))


def measured(blank: AlignedRecording, effects: list[FittedEffect], noise_um: Floats) -> AlignedRecording:
    """The same gauges, with these effects and this noise in the reference."""
    _, added = effect_deltas(effects, blank.rows)
    return replace(blank, measured_mm=blank.predicted_mm(added) + noise_um / 1e3)


def white(blank: AlignedRecording, seed: int) -> Floats:
    return np.random.default_rng(seed).normal(0, SIGMA_UM, blank.measured_mm.shape)


def fresh(*effects: str) -> list[FittedEffect]:
    return [initial_effect(LIBRARY[effect], {}, 3) for effect in effects]


@pytest.mark.parametrize(
    "truth",
    [
        hidden("link_expansion", 1.1),
        hidden("link_elasticity", 28.0),
        hidden("backlash", 0.9, 1.1, 0.8),
        hidden("tool_offset", 3.0, -2.0, 40.0),
        hidden("frame_rod_expansion", 0.7),
        hidden("plate_bending", 8.0),
        hidden("joint_comparator_gain", 0.05),
    ],
    ids=lambda truth: truth.effect.id,
)
def test_without_noise_the_numbers_come_back(blank: AlignedRecording, truth: FittedEffect) -> None:
    result = fit(measured(blank, [truth], 0 * white(blank, 0)), fresh(truth.effect.id))
    np.testing.assert_allclose(result.fitted[0].theta, truth.theta, rtol=1e-6)
    assert result.rms_um < 1e-5


def test_two_effects_are_fitted_together(blank: AlignedRecording) -> None:
    truth = [hidden("link_elasticity", 28.0), hidden("backlash", 0.9, 1.1, 0.8)]
    result = fit(measured(blank, truth, white(blank, 1)), fresh("link_elasticity", "backlash"))
    std = np.sqrt(np.diag(result.covariance))
    assert result.names == ("link_elasticity.k", "backlash.b_1", "backlash.b_2", "backlash.b_3")
    off = (
        np.concatenate([effect.theta for effect in result.fitted]) - np.concatenate([effect.theta for effect in truth])
    ) / std
    assert np.abs(off).max() < 4
    assert result.rms_um == pytest.approx(SIGMA_UM, rel=0.05)


@pytest.mark.long
def test_a_95_percent_interval_covers_the_truth_in_95_percent(blank: AlignedRecording) -> None:
    truth = hidden("backlash", 0.9, 1.1, 0.8)
    inside = []
    for seed in range(120):
        result = fit(measured(blank, [truth], white(blank, 100 + seed)), fresh("backlash"))
        std = np.sqrt(np.diag(result.covariance))
        inside += (np.abs(result.fitted[0].theta - truth.theta) < 1.96 * std).tolist()
    assert 0.925 <= np.mean(inside) <= 0.985  # 360 intervals: two standard deviations are 2.3 %


def test_residuals_that_hang_together_make_the_errors_larger(blank: AlignedRecording) -> None:
    slow = np.repeat(np.random.default_rng(2).normal(0, 1.0, (20, 3)), 15, axis=0)
    shuffled = np.random.default_rng(3).permutation(slow)
    large, small = (
        fit(measured(blank, [], noise), fresh("tool_offset")).covariance[0, 0] for noise in (slow, shuffled)
    )
    assert large > 4 * small


def test_gross_rows_are_listed_and_move_nothing(blank: AlignedRecording) -> None:
    truth = hidden("link_expansion", 1.1)
    noise = white(blank, 4)
    clean = fit(measured(blank, [truth], noise), fresh("link_expansion"))
    noise[[50, 100, 200], 2] += [30.0, -4000.0, 3.0]
    result = fit(measured(blank, [truth], noise), fresh("link_expansion"))
    assert np.flatnonzero(result.outlier).tolist() == [50, 100, 200]
    std = np.sqrt(clean.covariance[0, 0])
    assert abs(result.fitted[0].theta[0] - clean.fitted[0].theta[0]) < 0.3 * std


def test_rows_that_are_said_to_be_gross_are_left_out_and_no_others(blank: AlignedRecording) -> None:
    noise = white(blank, 4)
    noise[[50, 100], 2] += 30.0
    recording = measured(blank, [hidden("link_expansion", 1.1)], noise)
    gross = np.zeros(len(noise), dtype=bool)
    gross[[7, 50]] = True
    result = fit(recording, fresh("link_expansion"), outlier=gross)
    assert np.array_equal(result.outlier, gross)
    assert np.flatnonzero(~result.used).tolist() == [7, 50]
    assert np.abs(result.residual_um[100, 2]) > 25.0
    comparison = compare(recording, result.fitted, result.covariance, outlier=gross)
    assert np.array_equal(comparison.outlier, gross)
    assert not comparison.used[[7, 50]].any()
    assert comparison.used[100]
    none = np.zeros(len(noise), dtype=bool)
    assert not compare(recording, result.fitted, outlier=none).outlier.any()


def test_an_effect_on_few_rows_is_fitted_and_not_thrown_out(tmp_path: Path) -> None:
    columns = gauges(600, 41)
    loaded = np.repeat(np.arange(200) % 6 == 0, 3)
    columns |= {f"force_{axis}_N": np.where(loaded, columns[f"force_{axis}_N"], 0.0) for axis in "xyz"}
    result = fit(aligned(record(tmp_path, columns, [hidden("link_elasticity", 20.0)])), fresh("link_elasticity"))
    assert not result.outlier.any()
    assert result.fitted[0].effect.parameters[0].from_theta(result.fitted[0].theta[0])[0] == pytest.approx(
        20.0, rel=0.02
    )


def test_what_the_data_cannot_tell_apart_has_no_error(blank: AlignedRecording) -> None:
    # on a gauge that never moves its gain does nothing at all
    still = replace(blank, rows=replace(blank.rows, frame_mm=np.zeros_like(blank.rows.frame_mm)))
    result = fit(measured(still, [], white(blank, 5)), fresh("frame_comparator_gain"))
    assert np.isnan(result.covariance).all()


def test_a_time_constant_is_searched(tmp_path: Path) -> None:
    columns = gauges(600, 42)
    for i in (1, 2, 3):
        steps = np.repeat(np.random.default_rng(i).normal(0, 1.5, 12), 50)
        columns[f"temperature_link_{i}_degC"] = 20 + steps
    truth = hidden("link_expansion_lag", 8.0, tau=1300.0)
    recording = aligned(record(tmp_path, columns, [truth]))
    (fitted,) = search_constants(recording, (), LIBRARY["link_expansion_lag"], np.ones(3)).fitted
    assert fitted.constants["tau"] == pytest.approx(1300.0, rel=0.05)
    assert fitted.theta[0] == pytest.approx(8.0, rel=0.02)


def test_too_few_rows_for_the_numbers(tmp_path: Path) -> None:
    recording = aligned(record(tmp_path, gauges(3, 43)))
    with pytest.raises(CompdError, match="numbers to fit"):
        fit(recording, fresh("base_joint_position", "link_zero"))


def test_first_order_uncertainty_agrees_with_monte_carlo(blank: AlignedRecording) -> None:
    truth = [hidden("link_elasticity", 28.0), hidden("backlash", 0.9, 1.1, 0.8)]
    recording = measured(blank, truth, white(blank, 6))
    result = fit(recording, fresh("link_elasticity", "backlash"))
    noise = gauge_noise(recording)
    first = first_order_uncertainty(recording, noise, result.fitted, result.covariance).total_um
    index = np.arange(0, 300, 30)
    trials = monte_carlo(recording, noise, result.fitted, result.covariance, index, trials=2000, seed=1)
    np.testing.assert_allclose(trials, first[index], rtol=0.08)  # 2000 trials: 1.6 % each


def test_an_unknown_error_is_nan_in_the_prediction_too(blank: AlignedRecording) -> None:
    result = compare(blank, [hidden("link_expansion", 1.1)])
    assert np.isnan(result.uncertainty.parameters_um).all()
    assert result.as_json()["prediction_std_um"]["total"] is None
