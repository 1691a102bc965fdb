"""Least squares with the tolerance as prior: what data do not tell stays at the drawing, and covariances are right."""

from __future__ import annotations

import numpy as np
import pytest

from compd.calibration.block_sets import BlockSets
from compd.calibration.prior_fit import Whitened, fit_with_prior, normal_equations, registration_of

RNG = np.random.default_rng(1)
BLOCK_OF = np.array([0, 0, 0, 1, 1])
ALL = np.ones(5, dtype=bool)
# of two blocks each is off or not, with even odds
SETS = BlockSets(
    np.array([[False, False], [True, False], [False, True], [True, True]]),
    np.zeros(4),
    np.ones(2),
    BLOCK_OF,
    np.zeros(2, dtype=bool),
)


def part(J: np.ndarray, x: np.ndarray, R: np.ndarray, r: np.ndarray, noise: np.ndarray | float = 0.0) -> Whitened:
    return Whitened(J @ x + R @ r + noise, J, R, np.arange(len(J)))


def test_what_the_data_do_not_tell_stays_at_the_drawing_with_its_tolerance() -> None:
    J = RNG.standard_normal((40, 5)) * 100
    J[:, 2] = J[:, 1]  # only the sum of these two is told
    R = RNG.standard_normal((40, 2))
    x = np.array([1.0, 0.6, 0.6, -1.0, 0.5])
    result = fit_with_prior(normal_equations([part(J, x, R, np.array([5.0, -7.0]))]), BLOCK_OF, ALL)
    np.testing.assert_allclose(result.x, x, atol=1e-3)
    difference = np.array([0, 1, -1, 0, 0]) / np.sqrt(2)
    assert difference @ result.C @ difference == pytest.approx(result.scale[0] ** 2, rel=1e-3)
    assert result.C[0, 0] < 1e-3


def test_registrations_are_eliminated_each_for_its_recording() -> None:
    x = np.array([0.3, -0.2, 0.8, 0.1, -0.4])
    parts = []
    for _ in range(3):
        J, R = RNG.standard_normal((30, 5)) * 100, RNG.standard_normal((30, 3))
        parts.append(part(J, x, R, 50 * RNG.standard_normal(3)))
    result = fit_with_prior(normal_equations(parts), BLOCK_OF, ALL)
    np.testing.assert_allclose(result.x, x, atol=1e-3)
    left = [one.z - one.J @ x - one.R @ registration_of(one, x) for one in parts]
    assert max(np.abs(one).max() for one in left) < 1e-9


def test_the_scale_of_a_block_follows_from_its_numbers() -> None:
    block_of = np.repeat([0, 1], 40)
    J = 1e3 * np.eye(80)
    x = np.concatenate([3.0 * RNG.standard_normal(40), 0.2 * RNG.standard_normal(40)])
    empty = np.zeros((80, 0))
    result = fit_with_prior(normal_equations([part(J, x, empty, np.zeros(0))]), block_of, np.ones(80, dtype=bool))
    assert result.scale[0] == pytest.approx(3.0, rel=0.3)
    # numbers that look as drawn make no others better known
    assert result.scale[1] == 1.0


def test_a_tolerance_is_scaled_by_a_hundred_at_most() -> None:
    J = 1e3 * np.eye(5)
    one = part(J, np.full(5, 1e5), np.zeros((5, 0)), np.zeros(0))
    result = fit_with_prior(normal_equations([one]), BLOCK_OF, ALL)
    assert result.scale.max() == 100.0
    np.testing.assert_allclose(result.x, 1e5, rtol=1e-6)


def test_intervals_hold_numbers_of_which_a_block_may_be_as_drawn() -> None:
    """Pooled over drawn machines; of 4,000 numbers a share of 95 % has a standard deviation of 0.4 %."""
    inside = []
    for _ in range(1000):
        off = RNG.random(2) < 0.5
        J = RNG.standard_normal((12, 5)) * 3
        x = np.where(off[BLOCK_OF], RNG.standard_normal(5), 0.0)
        one = part(J, x, np.ones((12, 1)), np.array([4.0]), RNG.standard_normal(12))
        result = SETS.averaged(normal_equations([one]))
        inside.append(np.abs(result.x - x) <= 1.96 * np.sqrt(np.diag(result.C)))
    assert 0.93 <= np.mean(inside) <= 0.98


def test_a_block_that_many_poses_show_as_drawn_is_in_no_likely_set() -> None:
    J = RNG.standard_normal((400, 5)) * 30
    x = np.where(BLOCK_OF == 0, RNG.standard_normal(5), 0.0)
    normal = normal_equations([part(J, x, np.zeros((400, 0)), np.zeros(0), RNG.standard_normal(400))])
    likely = SETS.likely(normal)
    assert (likely.free == (BLOCK_OF == 0)).all()
    assert not likely.averaged(normal).x[BLOCK_OF == 1].any()


def test_the_tolerance_of_a_block_that_is_refused_widens_the_intervals_of_others() -> None:
    J = RNG.standard_normal((40, 5)) * 10
    normal = normal_equations([part(J, RNG.standard_normal(5), np.zeros((40, 0)), np.zeros(0))])
    refused = SETS._replace(inside=SETS.inside[:2], log_prior=SETS.log_prior[:2], refused=np.array([False, True]))
    known, unknown = (one.averaged(normal).C[0, 0] for one in (SETS, refused))
    assert unknown > 2 * known
