"""Gross rows and the weight of the others, on noise to which they are added."""

from __future__ import annotations

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.findings import GrossRows
from compd.diagnosis.search.gross_rows import RowWeights, consistency, gross_rows, weigh_rows

ROWS = 400
CRITERIA = Criteria()
GROSS = [50, 120, 121, 300]


def noise(m: int = 3, seed: int = 1) -> FloatArray:
    return np.random.default_rng(seed).standard_normal((ROWS, m))


def weigh(residual: FloatArray, columns: list[FloatArray] | None = None, visit: object = None) -> RowWeights:
    known = np.isfinite(residual).all(axis=1)
    return weigh_rows(columns or [], np.nan_to_num(residual), known, visit, 1.0, CRITERIA)  # type: ignore[arg-type]


@pytest.mark.parametrize("m", [1, 2, 3, 6])
@pytest.mark.parametrize("full", [1.5, 2.0, 3.0])
def test_consistency_is_the_mean_of_the_weighted_squares_of_normal_noise(m: int, full: float) -> None:
    d = np.sqrt(np.mean(np.random.default_rng(2).standard_normal((400_000, m)) ** 2, axis=1))
    assert consistency(m, full) == pytest.approx(np.mean(np.minimum(d**2, full * d)), rel=4e-3)


def test_weights_leave_the_mean_square_of_noise_as_it_is() -> None:
    squares = []
    for seed in range(30):
        residual = noise(1, seed)
        weights = weigh(residual)
        squares.append(float((weights.weight[:, None] * residual**2).mean()))
    assert np.mean(squares) == pytest.approx(1.0, abs=0.03)  # 12 000 values: 0.013


def test_noise_has_no_gross_rows_and_gross_rows_are_found() -> None:
    residual = noise()
    assert not weigh(residual).gross.any()
    residual[GROSS, [0, 1, 2, 1]] += [30.0, -400.0, 9.0, 12.0]
    weights = weigh(residual)
    assert np.flatnonzero(weights.gross).tolist() == GROSS
    assert (weights.weight[GROSS] == 0.0).all()


def test_gross_rows_neither_hide_one_another_nor_raise_the_scale() -> None:
    """Eight per cent of garbage, all on one side."""
    residual = noise()
    bad = np.random.default_rng(3).choice(ROWS, 32, replace=False)
    residual[bad] += 40.0
    assert np.flatnonzero(weigh(residual).gross).tolist() == sorted(bad.tolist())


@pytest.mark.parametrize("seed", range(4))
def test_gross_rows_beside_effects_that_are_not_known_yet(seed: int) -> None:
    """A run of 30 rows of 240, and nothing but the effects' columns to tell them by."""
    rng = np.random.default_rng(seed)
    columns = np.stack([rng.choice([-1.0, 1.0], 240), rng.uniform(0, 1, 240)], axis=1)[:, None, :]
    residual = rng.standard_normal((240, 1)) + columns @ [6.0, 4.0]
    residual[100:130, 0] += rng.normal(70, 15, 30)
    weights = weigh_rows([columns], residual, np.ones(240, dtype=bool), None, 1.0, CRITERIA)
    assert np.flatnonzero(weights.gross).tolist() == list(range(100, 130))


def test_beyond_the_full_weight_it_falls_as_one_over_the_distance() -> None:
    residual = noise(1)
    residual[[7, 8, 9], 0] = 3.0, 4.2, 0.1
    weight = weigh(residual).weight
    assert weight[7] / weight[8] == pytest.approx(4.2 / 3.0, rel=0.02)
    assert weight[9] == weight.max() == pytest.approx(1 / consistency(1, 2.0))


def test_what_columns_explain_is_not_gross() -> None:
    """An effect that acts on three rows with 40 times the noise, fitted along, makes none of them gross."""
    acts = np.zeros((ROWS, 3, 1))
    acts[GROSS] = 40.0
    residual = noise() + acts[:, :, 0]
    assert weigh(residual).gross.sum() == 4
    assert not weigh(residual, [acts]).gross.any()


def test_many_columns_do_not_hide_a_gross_row() -> None:
    columns = np.random.default_rng(4).standard_normal((ROWS, 3, 60))
    residual = noise()
    residual[50] += 60.0
    assert np.flatnonzero(weigh(residual, [columns]).gross).tolist() == [50]


def test_more_columns_than_rows_can_test_are_not_fitted() -> None:
    """Of as many columns as values every row would be explained."""
    columns = np.random.default_rng(4).standard_normal((ROWS, 3, ROWS * 2))
    residual = noise()
    residual[GROSS] += 60.0
    assert np.flatnonzero(weigh(residual, [columns]).gross).tolist() == GROSS


def test_a_row_that_its_visit_confirms_is_not_gross_and_counts_little() -> None:
    visit = np.arange(ROWS) // 2
    residual = noise()
    residual[[100, 101]] += 40.0  # one visit: the machine was there
    residual[200] += 40.0  # its other row says otherwise
    weights = weigh(residual, visit=visit)
    assert np.flatnonzero(weights.gross).tolist() == [200]
    assert 0 < weights.weight[100] < 0.2


def test_rows_without_a_visit_confirm_nothing() -> None:
    residual = noise()
    residual[[100, 101]] += 40.0
    assert np.flatnonzero(weigh(residual, visit=np.full(ROWS, -1)).gross).tolist() == [100, 101]


def test_rows_that_are_not_known_neither_count_nor_are_gross() -> None:
    residual = noise()
    residual[[3, 4]] = np.nan
    weights = weigh(residual)
    assert not weights.gross.any()
    assert weights.weight[[3, 4]].tolist() == [0.0, 0.0]


def test_a_row_in_which_another_candidate_is_not_known_may_be_gross_and_does_not_count() -> None:
    """The fit of the effects that are found rests on it all the same."""
    residual = noise()
    residual[3] += 40.0
    known = np.arange(ROWS) > 9
    weights = weigh_rows([], residual, known, None, 1.0, CRITERIA)
    assert np.flatnonzero(weights.gross).tolist() == [3]
    assert (weights.weight[:10] == 0.0).all()


def test_a_stretch_of_gross_rows_is_a_run() -> None:
    gross = np.zeros(60, dtype=bool)
    gross[[5, 20, 22, 23, 26, 27, 40, 41, 42]] = True
    found = gross_rows(gross, np.arange(60) + 2)
    assert found.rows == (7, 22, 24, 25, 28, 29, 42, 43, 44)
    assert found.runs == ((22, 29),)  # three in a row happen
    assert gross_rows(np.zeros(60, dtype=bool), np.arange(60)) == GrossRows()


def test_rows_of_which_most_are_alike_to_the_last_digit_are_not_gross_by_a_digit() -> None:
    """Of 40 rows 36 are 0, and 4 are one step of 3.5 robust noises: the step is what the display can show."""
    residual = np.zeros((40, 1))
    residual[::10] = 3.5
    known = np.ones(40, dtype=bool)
    alone = weigh_rows([], residual, known, None, 0.0, CRITERIA)
    held = weigh_rows([], residual, known, None, 0.0, CRITERIA, least=1.0)
    assert alone.gross.sum() == 4
    assert not held.gross.any()


def test_far_rows_that_follow_one_another_count_in_full() -> None:
    """The first rows of a warm-up are what the machine did; a single far row may be chance."""
    residual = noise(1)
    residual[:12] = 3.5 * np.sign(residual[:12])
    residual[200] = 3.5
    weights = weigh(residual)
    assert weights.weight[:12] == pytest.approx(weights.weight.max())
    assert weights.weight[200] < 0.7 * weights.weight.max()
