"""Losses on left-out folds and p-values, each against its definition."""

from __future__ import annotations

import numpy as np
import pytest

from compd.diagnosis.criteria import Criteria
from compd.diagnosis.search.regression import RegressionData, Regressors, normal_equations
from compd.diagnosis.search.significance import Family, OrthogonalComplement, p_values
from compd.diagnosis.search_criteria import SearchCriteria


def random_data(seed: int, rows: int = 120) -> RegressionData:
    """Noise in 3 coordinates, split into 4 blocks of time and at random into 5 folds; 2 nuisance columns."""
    rng = np.random.default_rng(seed)
    splits = (np.arange(rows) * 4 // rows, rng.integers(0, 5, rows))
    nuisance = Regressors(rng.standard_normal((rows, 3, 2)), np.full(2, np.inf))
    return RegressionData(
        rng.standard_normal((rows, 3)), splits, np.arange(rows) * 12 // rows, nuisance, np.arange(rows)
    )


def test_cv_loss_is_that_of_fits_without_the_fold() -> None:
    data = random_data(1)
    regressors = Regressors(np.random.default_rng(2).standard_normal((120, 3, 3)), np.full(3, np.inf))
    equations, (index,) = normal_equations(data, [regressors])
    (loss,) = equations.cv_losses([np.concatenate([[0, 1], index])], np.ones((1, 2), dtype=bool))
    columns = np.concatenate([data.nuisance.values, regressors.values], axis=2)
    loss_by_split = []
    for fold in data.splits:
        squares = 0.0
        for k in np.unique(fold):
            out = fold == k
            theta, *_ = np.linalg.lstsq(columns[~out].reshape(-1, 5), data.y[~out].ravel(), rcond=None)
            squares += float(((data.y[out] - columns[out] @ theta) ** 2).sum())
        loss_by_split.append(squares / data.y.size)
    assert loss == pytest.approx(np.mean(loss_by_split), rel=1e-6)


def test_a_split_that_is_not_testable_does_not_count() -> None:
    data = random_data(1)
    values = np.random.default_rng(2).standard_normal((120, 3, 1))
    equations, (index,) = normal_equations(data, [Regressors(values, np.full(1, np.inf))])
    columns = np.concatenate([[0, 1], index])
    both, first, none = equations.cv_losses([columns] * 3, np.array([[True, True], [True, False], [False, False]]))
    assert first != pytest.approx(both, abs=1e-6)
    assert np.isnan(none)


def test_estimates_are_least_squares_within_the_plausible_range() -> None:
    data = random_data(5)
    values = np.random.default_rng(6).standard_normal((120, 3, 1))
    free, (index,) = normal_equations(data, [Regressors(values, np.full(1, np.inf))])
    theta, covariance, left = free.estimate(np.concatenate([[0, 1], index]))
    columns = np.concatenate([data.nuisance.values, values], axis=2).reshape(-1, 3)
    expected, *_ = np.linalg.lstsq(columns, data.y.ravel(), rcond=None)
    assert theta == pytest.approx(expected, rel=1e-6)
    assert np.diag(covariance) == pytest.approx(np.diag(np.linalg.inv(columns.T @ columns)), rel=1e-6)
    assert left == pytest.approx(np.mean((data.y.ravel() - columns @ expected) ** 2))
    held, _ = normal_equations(data, [Regressors(values, np.full(1, 1e-6))])
    assert abs(held.estimate(np.concatenate([[0, 1], index]))[0][2]) < 1e-3 * abs(expected[2])


def test_a_column_that_acts_in_one_fold_alone_is_not_testable_there() -> None:
    data = random_data(3)
    values = np.random.default_rng(4).standard_normal((120, 3, 1))
    values[data.splits[0] != 2] = 0.0
    equations, (index,) = normal_equations(data, [Regressors(values, np.full(1, np.inf))])
    assert equations.testable_splits(index, Criteria().most_in_one_fold).tolist() == [False, True]


def test_orthogonal_complement_leaves_what_least_squares_does_not_explain() -> None:
    rng = np.random.default_rng(8)
    columns, y = rng.standard_normal((50, 3, 4)), rng.standard_normal((50, 3))
    theta, *_ = np.linalg.lstsq(columns.reshape(-1, 4), y.ravel(), rcond=None)
    assert OrthogonalComplement(columns)(y) == pytest.approx(y - columns @ theta)


def test_p_values_of_noise_are_uniform_and_of_an_effect_the_smallest() -> None:
    rng = np.random.default_rng(7)
    block = np.arange(240) * 24 // 240
    columns = [rng.standard_normal((240, 3, 2)) for _ in range(6)]
    smallest = []
    for _ in range(40):
        y = rng.standard_normal((240, 3))
        smallest.append(float(p_values([Family([variant], y) for variant in columns], block).min()))
    assert np.mean(np.array(smallest) < 0.05) <= 0.15  # 5 % is expected: 2 of 40
    y = columns[2] @ np.array([0.5, -0.5]) + rng.standard_normal((240, 3))
    with_effect = p_values([Family([variant], y) for variant in columns], block)
    assert with_effect[2] == pytest.approx(1 / (SearchCriteria.sign_flips + 1))
    assert int(np.argmin(with_effect)) == 2


def test_p_values_of_what_the_residual_itself_chose_are_uniform_too() -> None:
    rng = np.random.default_rng(9)
    block = np.arange(240) * 24 // 240
    many = rng.standard_normal((300, 240, 3, 1))
    smallest: dict[int, list[float]] = {1: [], 300: []}
    for _ in range(40):
        y = rng.standard_normal((240, 3))
        best = many[int(np.argmax(np.einsum("krmp,rm->k", many, y) ** 2))]
        for count, values in smallest.items():
            values.append(float(p_values([Family([best], y, [count])], block)[0]))
    assert np.mean(np.array(smallest[300]) < 0.05) <= 0.15  # 5 % is expected: 2 of 40
    assert np.mean(smallest[300]) == pytest.approx(0.5, abs=0.14)  # three standard errors of 40 numbers
    assert np.mean(np.array(smallest[1]) < 0.05) > 0.9  # what it would be without counting


def test_what_acts_in_one_block_has_no_evidence_however_many_it_is_the_best_of() -> None:
    rng = np.random.default_rng(10)
    block = np.arange(240) * 24 // 240
    column = np.where((block == 3)[:, None, None], rng.standard_normal((240, 3, 1)), 0.0)
    y = 9.0 * column[:, :, 0] + rng.standard_normal((240, 3))
    assert p_values([Family([column], y, [5000])], block).tolist() == [1.0]
