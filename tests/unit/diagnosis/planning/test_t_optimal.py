"""The T-optimal choice: the criterion against brute force, and that the choice raises it."""

from __future__ import annotations

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.planning.t_optimal import Predictions, RivalRefit, choose_programmes

LENGTHS = np.array([1, 3, 2, 1, 1])
ENDS = np.cumsum([0, *LENGTHS])


def predictions(seed: int, rows: int, size: float = 1.0) -> Predictions:
    rng = np.random.default_rng(seed)
    return Predictions(size * rng.standard_normal((rows, 2)), rng.standard_normal((rows, 2, 3)))


def brute_force(*parts: Predictions) -> float:
    """What the rival leaves of the effect on all rows of the parts, by numpy's own least squares."""
    A = np.concatenate([part.rival.reshape(-1, part.rival.shape[2]) for part in parts])
    y = np.concatenate([part.effect.ravel() for part in parts])
    theta, *_ = np.linalg.lstsq(A, y, rcond=None)
    return float(((y - A @ theta) ** 2).sum())


def rows_of(possible: Predictions, k: int) -> Predictions:
    return Predictions(*(values[ENDS[k] : ENDS[k + 1]] for values in possible))


def test_the_criterion_is_what_a_refit_leaves() -> None:
    recorded, possible = predictions(1, 20), predictions(2, int(ENDS[-1]))
    refit = RivalRefit(recorded, possible, ENDS)
    assert refit.discrepancy == pytest.approx(brute_force(recorded))
    expected = [brute_force(recorded, rows_of(possible, k)) for k in range(len(LENGTHS))]
    np.testing.assert_allclose(refit.discrepancies_with_each(), expected)
    refit.add(1)
    refit.add(1)
    assert refit.discrepancy == pytest.approx(brute_force(recorded, *[rows_of(possible, 1)] * 2))


def test_digits_are_not_lost_where_the_rival_imitates_nearly_all() -> None:
    recorded, possible = predictions(1, 20), predictions(2, int(ENDS[-1]))
    theta = np.array([1e6, -3e6, 2e6])
    close = [Predictions(part.rival @ theta + 1e-2 * part.effect, part.rival) for part in (recorded, possible)]
    refit = RivalRefit(*close, ENDS)
    for k in range(len(LENGTHS)):
        refit.add(k)
    assert refit.discrepancy == pytest.approx(1e-4 * brute_force(recorded, possible), rel=1e-3)


def test_a_row_on_which_the_rival_does_as_well_is_worth_nothing() -> None:
    recorded = predictions(1, 20)
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((2, 2, 3))
    theta, *_ = np.linalg.lstsq(recorded.rival.reshape(-1, 3), recorded.effect.ravel(), rcond=None)
    effect: FloatArray = columns @ theta
    effect[1] += 5.0
    refit = RivalRefit(recorded, Predictions(effect, columns), np.array([0, 1, 2]))
    gains = refit.discrepancies_with_each() - refit.discrepancy
    assert gains[0] == pytest.approx(0.0, abs=1e-6)
    assert gains[1] > 1.0


def test_the_worst_pair_decides_and_the_rows_are_kept() -> None:
    recorded, possible = predictions(1, 20), predictions(2, int(ENDS[-1]))
    refits = [
        RivalRefit(recorded, possible, ENDS),
        RivalRefit(Predictions(0.1 * recorded.effect, recorded.rival), possible, ENDS),
    ]
    choice = choose_programmes(refits, LENGTHS, 7)
    assert sum(LENGTHS[k] for k in choice.programmes) <= 7
    assert choice.before == pytest.approx(0.01 * brute_force(recorded))
    weak = Predictions(0.1 * recorded.effect, recorded.rival)
    assert choice.after == pytest.approx(
        min(brute_force(part, *(rows_of(possible, k) for k in choice.programmes)) for part in (recorded, weak))
    )


def test_programmes_that_are_too_long_are_not_taken() -> None:
    recorded, possible = predictions(1, 20), predictions(2, int(ENDS[-1]), size=100.0)
    choice = choose_programmes([RivalRefit(recorded, possible, ENDS)], LENGTHS, 2)
    assert 1 not in choice.programmes
    assert sum(LENGTHS[k] for k in choice.programmes) == 2


def test_without_columns_everything_is_a_difference() -> None:
    recorded, possible = predictions(1, 20), predictions(2, int(ENDS[-1]))
    alone = [Predictions(part.effect, part.rival[:, :, :0]) for part in (recorded, possible)]
    assert RivalRefit(*alone, ENDS).discrepancy == pytest.approx(float((recorded.effect**2).sum()))
