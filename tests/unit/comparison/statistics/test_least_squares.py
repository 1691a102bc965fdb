"""Least squares: units do not matter, what the rows do not determine is said, and ridge bounds it."""

from __future__ import annotations

import doctest
from types import ModuleType

import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from compd.statistics import cluster_covariance as covariance_of
from compd.statistics import covariance as cluster_covariance
from compd.statistics import least_squares, normal_inverse, ridge_inverse, robust, solve_least_squares, solve_ridge
from compd.statistics.least_squares import determined

RNG = np.random.default_rng(11)
A = RNG.normal(size=(40, 3))
THETA = np.array([1.0, -2.0, 0.5])


@pytest.mark.parametrize("module", [least_squares, robust, cluster_covariance], ids=lambda module: module.__name__)
def test_examples_in_the_docstrings(module: ModuleType) -> None:
    result = doctest.testmod(module, extraglobs={"np": np})
    assert result.attempted > 0
    assert result.failed == 0


def test_exact_data_give_the_parameters_in_any_unit() -> None:
    units = np.array([1e-6, 1.0, 1e7])
    np.testing.assert_allclose(solve_least_squares(A * units, A @ THETA) * units, THETA, rtol=1e-9)


def test_a_weight_counts_as_repeated_rows() -> None:
    y = A @ THETA + RNG.normal(size=40)
    weights = RNG.integers(1, 4, 40)
    repeated = np.repeat(np.arange(40), weights)
    np.testing.assert_allclose(
        solve_least_squares(A, y, weights.astype(float)), solve_least_squares(A[repeated], y[repeated]), rtol=1e-9
    )


def test_many_right_hand_sides_at_once() -> None:
    y = RNG.normal(size=(40, 5))
    each = [solve_least_squares(A, column) for column in y.T]
    np.testing.assert_allclose(solve_least_squares(A, y), np.stack(each, axis=1), rtol=1e-9)


def test_a_copied_and_an_empty_column_are_not_determined() -> None:
    columns = np.column_stack([A[:, 0], A[:, 1], 3.0 * A[:, 1], np.zeros(40)])
    assert determined(columns).tolist() == [True, False, False, False]
    theta = solve_least_squares(columns, A[:, 0] + 2.0 * A[:, 1])
    np.testing.assert_allclose(columns @ theta, A[:, 0] + 2.0 * A[:, 1], atol=1e-9)
    assert theta[3] == 0.0


def test_the_inverse_gives_the_covariance() -> None:
    np.testing.assert_allclose(normal_inverse(A), np.linalg.inv(A.T @ A), rtol=1e-9)


def test_no_columns_at_all() -> None:
    assert solve_least_squares(A[:, :0], A[:, 0]).shape == (0,)
    assert determined(A[:, :0]).shape == (0,)
    assert covariance_of(A[:, None, :0], A[:, :1], np.arange(40)).shape == (0, 0)


def test_ridge_is_a_measurement_of_zero() -> None:
    ridge = np.array([0.1, 10.0, 1e4])
    y = RNG.normal(size=40)
    theta = solve_ridge(A.T @ A, A.T @ y, ridge)
    with_prior = solve_least_squares(np.concatenate([A, np.diag(np.sqrt(ridge))]), np.concatenate([y, np.zeros(3)]))
    np.testing.assert_allclose(theta, with_prior, rtol=1e-6)
    np.testing.assert_allclose(ridge_inverse(A.T @ A, ridge), np.linalg.inv(A.T @ A + np.diag(ridge)), rtol=1e-6)


def test_the_covariance_of_blocks_is_that_of_fits_without_one_of_them() -> None:
    block = np.arange(40) // 4
    drift = np.repeat(RNG.normal(size=10), 4)
    y = A @ THETA + drift * A[:, 0] + 0.1 * RNG.normal(size=40)  # errors that a block shares
    theta, *_ = np.linalg.lstsq(A, y, rcond=None)
    without = np.stack([np.linalg.lstsq(A[block != c], y[block != c], rcond=None)[0] for c in range(10)])
    variance = 9 / 10 * ((without - theta) ** 2).sum(axis=0) * (student.ppf(0.975, 9) / norm.ppf(0.975)) ** 2
    residual = y - A @ theta
    independent = np.diag(np.linalg.inv(A.T @ A)) * float(residual @ residual) / 37
    assert (variance > independent).any()
    clustered = covariance_of(A[:, None, :], residual[:, None], block)
    np.testing.assert_allclose(np.diag(clustered), np.maximum(variance, independent), rtol=1e-5)


def test_what_one_block_alone_determines_has_the_error_of_independent_rows() -> None:
    block = np.arange(40) // 10
    columns = np.column_stack([A[:, 0], np.where(block == 2, A[:, 1], 0.0)])
    residual = RNG.normal(size=40)
    clustered = covariance_of(columns[:, None, :], residual[:, None], block)
    independent = np.linalg.inv(columns.T @ columns) * float(residual @ residual) / 38
    assert clustered[1, 1] == pytest.approx(independent[1, 1])
