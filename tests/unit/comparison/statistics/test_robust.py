"""Robust statistics: what outliers do not move."""

from __future__ import annotations

import numpy as np
import pytest

from compd.comparison.alignment.registration import register
from compd.comparison.criteria import ComparisonCriteria
from compd.statistics import SCALE_EFFICIENCY, huber_weights, robust_regression, robust_sigma, trimmed_scale

RNG = np.random.default_rng(12)


def test_sigma_of_normal_values_with_and_without_outliers() -> None:
    values = RNG.normal(0, [0.1, 1.0, 10.0], (20_000, 3))
    np.testing.assert_allclose(robust_sigma(values), [0.1, 1.0, 10.0], rtol=0.03)
    values[::50] += 1e6
    np.testing.assert_allclose(robust_sigma(values), [0.1, 1.0, 10.0], rtol=0.15)


def test_sigma_of_values_that_a_display_rounds_to_zero() -> None:
    values = np.round(RNG.normal(0, 0.4, (1000, 1)))
    assert np.median(np.abs(values)) == 0
    assert robust_sigma(values)[0] > 0.4


@pytest.mark.parametrize("count", [20, 200])
def test_trimmed_scale_is_unbiased_for_normal_noise(count: int) -> None:
    scales = trimmed_scale(np.random.default_rng(20).normal(0, 1, (count, 4000)))
    assert scales.mean() == pytest.approx(1.0, abs=0.02)
    # its variance tells the efficiency: 1 / (2 N) of a standard deviation
    if count == 200:
        assert 1 / (2 * count * scales.var()) == pytest.approx(SCALE_EFFICIENCY, rel=0.06)


@pytest.mark.parametrize("count", [20, 200])
@pytest.mark.parametrize("size", [10.0, 1e4])
def test_trimmed_scale_stands_eight_per_cent_of_garbage(count: int, size: float) -> None:
    rng = np.random.default_rng(21)
    values = rng.normal(0, 1, (count, 2000))
    gross = round(0.08 * count)
    values[:gross] = rng.normal(0, size, (gross, 2000))
    assert trimmed_scale(values).mean() == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("count", [20, 200])
def test_trimmed_scale_of_rounded_noise_holds_the_rounding(count: int) -> None:
    rng = np.random.default_rng(22)
    step = 2.0
    place = rng.uniform(0, step, (count, 2000))
    first, second = (np.round((place + rng.normal(0, 1, place.shape)) / step) * step for _ in range(2))
    right = np.sqrt(1 + step**2 / 12)
    assert trimmed_scale((first - second) / np.sqrt(2)).mean() == pytest.approx(right, rel=0.03)
    assert (np.median(np.abs(first - second), axis=0) == 0).mean() > 0.3  # what a median would say


def test_trimmed_scale_by_weight_and_of_nothing_but_zeros() -> None:
    values = RNG.normal(0, 1.0, (300, 2))
    whole = np.concatenate([values, values[:100]])
    weight = np.where(np.arange(300) < 100, 2.0, 1.0)
    np.testing.assert_allclose(trimmed_scale(values, weight), trimmed_scale(whole))
    assert trimmed_scale(np.zeros((50, 1))).tolist() == [0.0]


def test_weights_hold_back_the_worst_coordinate() -> None:
    residual = RNG.normal(0, 1.0, (2000, 2))
    residual[0] = [0.0, 25.0 * robust_sigma(residual)[1]]
    once, twice = huber_weights(residual, huber=2.5), huber_weights(residual, exponent=2.0, huber=2.5)
    np.testing.assert_allclose(once[0], ComparisonCriteria.huber_sigmas / 25.0, rtol=0.01)
    np.testing.assert_allclose(twice, once**2)
    assert (once[np.abs(residual).max(axis=1) < 2.0] == 1.0).all()


def test_regression_with_outliers_and_with_ridge() -> None:
    G = RNG.normal(size=(300, 3, 4))
    theta = np.array([1.0, 0.0, -3.0, 20.0])
    y = G @ theta + RNG.normal(0, 0.01, (300, 3))
    y[::30] += 100.0
    np.testing.assert_allclose(robust_regression(G, y, rounds=12, exponent=2.0, huber=2.5), theta, atol=0.02)
    copied = np.concatenate([G, G], axis=2)
    np.testing.assert_allclose(
        robust_regression(copied, y, ridge=1e-6, exponent=2.0, rounds=12, huber=2.5), np.tile(theta / 2, 2), atol=0.02
    )


def test_a_frame_is_registered_in_spite_of_outliers() -> None:
    points_M = RNG.uniform(-200, 200, (50, 3))
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    shift = np.array([100.0, -3000.0, 7.0])
    measured = (points_M - shift) @ turn  # x_M = turn x + shift
    measured[[3, 20]] += [5.0, 0.0, -9.0]
    measured[7] = np.nan
    registration = register(measured, points_M)
    assert registration is not None
    np.testing.assert_allclose(registration.rotation, turn, atol=1e-12)
    np.testing.assert_allclose(registration.translation_mm, shift, atol=1e-9)
    assert registration.rows == 47


def test_two_points_fix_no_frame() -> None:
    assert register(np.eye(3)[:2], np.eye(3)[:2]) is None
