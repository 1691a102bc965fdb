"""Losses, scores, estimates and gains of sets of candidates, each against its definition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compd.arrays import FloatArray, IntArray
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.search.subset_losses import Subset
from tests.support.candidate_sets import BLOCKS, ROWS, candidate, columns, description, noise, subset_losses

CRITERIA = Criteria()
A, B = columns(1), columns(2)
Y = noise(4) + 1.5 * A[:, :, 0]


def test_the_baseline_is_the_mean_square_where_nothing_is_fitted_along() -> None:
    losses = subset_losses(Y, {"a": A})
    assert losses.baseline == pytest.approx(np.mean(Y**2), rel=1e-6)
    assert losses.loss(()) == losses.baseline


def squares_left(columns: FloatArray, fold: IntArray) -> FloatArray:
    """(ROWS,) squares that fits on the other folds leave in each row of Y."""
    squares = np.empty(ROWS)
    for k in np.unique(fold):
        out = fold == k
        theta, *_ = np.linalg.lstsq(columns[~out].reshape(-1, columns.shape[2]), Y[~out].ravel(), rcond=None)
        squares[out] = ((Y[out] - columns[out] @ theta) ** 2).sum(axis=1)
    return squares


def test_the_loss_is_that_of_fits_without_the_rows_on_which_it_is_taken() -> None:
    losses = subset_losses(Y, {"a": A, "b": B})
    both = np.concatenate([A, B], axis=2)
    by_split = [squares_left(both, fold).sum() / Y.size for fold in losses.data.splits]
    assert losses.loss((1, 0)) == pytest.approx(np.mean(by_split), rel=1e-4)


def test_a_set_is_computed_once_and_in_whatever_order_it_is_given() -> None:
    losses = subset_losses(Y, {"a": A, "b": B})
    one, other = losses.evaluate([(1, 0), (0,), (0, 1)])
    assert (one.members, other.members) == ((0, 1), (0,))
    assert [subset.members for subset in losses.scored] == [(0,), (0, 1), ()]


def test_the_score_is_the_log_loss_and_the_prices() -> None:
    losses = subset_losses(Y, [candidate("a", A), description("b", B)])
    expected = np.log(1.7) + CRITERIA.effect_price + CRITERIA.description_price
    assert losses.score(Subset((0, 1), 1.7)) == pytest.approx(expected)


def test_below_a_known_floor_nothing_is_gained_and_below_an_unknown_one_it_is() -> None:
    assert subset_losses(Y, {"a": A}).log_loss(0.5) == 0.0
    assert subset_losses(Y, {"a": A}, least_loss=0.0).log_loss(0.5) == pytest.approx(np.log(0.5))


@pytest.mark.parametrize(
    ("kind", "price"),
    [
        ("effect", CRITERIA.effect_price),
        ("constant", CRITERIA.effect_price),
        ("proxy", CRITERIA.effect_price),
        ("description", CRITERIA.description_price),
        ("change", CRITERIA.description_price),
    ],
)
def test_what_names_no_cause_costs_more_and_so_does_every_number(kind: str, price: float) -> None:
    three = candidate("a", columns(1, 3), kind=kind, searched_parameters=2)
    assert three.price(CRITERIA) == pytest.approx(price + 4 * CRITERIA.number_price)
    assert subset_losses(Y, [three]).number_price(0) == pytest.approx(4 * CRITERIA.number_price)


def test_a_set_that_no_split_can_test_has_no_loss() -> None:
    once = np.where((np.arange(ROWS) < 3)[:, None, None], A, 0.0)  # in one session, and
    losses = subset_losses(Y, [candidate("once", once), candidate("a", A)])
    split, sector = losses.data.splits
    once[sector != sector[0]] = 0.0  # in one sector
    losses = subset_losses(Y, [candidate("once", once), candidate("a", A)])
    assert losses.evaluate([(0,)]) == []
    assert losses.loss((0,)) == np.inf
    assert np.isfinite(losses.loss((1,)))
    assert len(np.unique(split[:3])) == 1


def test_estimates_are_those_of_a_joint_fit_on_all_rows() -> None:
    y = noise(4) + 2.0 * A[:, :, 0] - 1.5 * B[:, :, 0]
    (theta_b, covariance), (theta_a, _) = subset_losses(y, {"a": A, "b": B}).estimates((1, 0))
    assert (theta_a[0], theta_b[0]) == pytest.approx((2.0, -1.5), abs=0.2)
    assert covariance[0, 0] == pytest.approx(1 / (ROWS * 3), rel=0.1)


def test_above_the_floor_standard_errors_are_those_of_what_is_left() -> None:
    y = noise(4, 10.0) + 2.0 * A[:, :, 0]
    ((_, covariance),) = subset_losses(y, {"a": A}).estimates((0,))
    assert covariance[0, 0] == pytest.approx(100 / (ROWS * 3), rel=0.15)


def test_the_gain_is_the_difference_of_losses_with_the_standard_error_over_blocks() -> None:
    losses = subset_losses(Y, {"a": A, "b": B})
    gain, std = losses.gain((0,), (1,))
    assert gain == pytest.approx(losses.loss((1,)) - losses.loss((0,)), rel=1e-6)
    difference = np.mean([squares_left(B, fold) - squares_left(A, fold) for fold in losses.data.splits], axis=0)
    by_block = difference.reshape(BLOCKS, -1).sum(axis=1)
    assert std == pytest.approx(by_block.std(ddof=1) * np.sqrt(BLOCKS) / Y.size, rel=1e-3)
    assert losses.gain((1,), (0,))[0] == pytest.approx(-gain)


@pytest.mark.parametrize(("limit", "plausible"), [(100.0, True), (1.4, True), (0.1, False)])
def test_a_set_is_plausible_within_its_ranges(limit: float, plausible: bool) -> None:
    assert subset_losses(Y, [candidate("a", A, limit)]).is_plausible((0,)) == plausible


def test_descriptions_are_plausible_with_any_number_and_a_constant_is() -> None:
    losses = subset_losses(1e6 * Y, [description("a", A), candidate("c", B, np.inf, kind="constant")])
    assert losses.is_plausible((0, 1))


def test_what_the_rows_do_not_determine_is_not_plausible() -> None:
    unseen = replace(candidate("a", 1e-6 * A), limits=np.array([[4.0, 12.0]]))
    losses = subset_losses(Y, [unseen, candidate("b", B)])
    assert not losses.is_plausible((0,))
    assert losses.is_plausible((1,))


def test_of_each_effect_the_best_variant_is_kept() -> None:
    variants = [candidate("lag", B, constants={"tau": 1.0}), candidate("lag", A, constants={"tau": 2.0})]
    best = subset_losses(Y, [*variants, candidate("b", columns(3))]).best_variants
    assert list(best) == ["lag", "b"]
    assert best["lag"].members == (1,)


def test_constant_and_effects_are_no_descriptions() -> None:
    kinds = ("effect", "constant", "proxy", "description", "change")
    losses = subset_losses(Y, [candidate(kind, columns(k), kind=kind) for k, kind in enumerate(kinds)])
    assert losses.described(range(5)) == (2, 3, 4)
    assert losses.describes
    assert not subset_losses(Y, [candidate("a", A), candidate("p", B, kind="proxy")]).describes


def test_two_effects_that_do_the_same_with_opposite_signs_are_no_two_causes() -> None:
    """A twin differs from the cause by a tenth: what they differ by takes both with numbers of opposite sign."""
    twin = A + 0.1 * B
    cancelling = subset_losses(noise(4) + 2.0 * (A - twin)[:, :, 0] + 0.2 * A[:, :, 0], {"a": A, "twin": twin})
    assert not cancelling.is_plausible((0, 1))
    assert subset_losses(Y + B[:, :, 0], {"a": A, "b": B}).is_plausible((0, 1))


def test_numbers_that_nearly_cancel_are_plausible_where_others_within_their_ranges_do_as_well() -> None:
    """Of 13 of one and -10 of the other their sum is known well: 6 and -3 leave hardly more."""
    nearly = A + 0.03 * columns(7)
    candidates = [candidate("a", A, 5.0), candidate("b", np.concatenate([nearly, B], axis=2), 15.0)]
    losses = subset_losses(noise(4) + (13.0 * A - 10.0 * nearly + 12.0 * B)[:, :, 0], candidates)
    theta = np.concatenate([values for values, _ in losses.estimates((0, 1))])
    assert abs(theta[0]) > 6.25
    assert losses.is_plausible((0, 1))
    alone = [candidate("a", A, 5.0), candidate("c", B, 5.0)]
    assert not subset_losses(noise(4, 0.1) + 13.0 * A[:, :, 0] + B[:, :, 0], alone).is_plausible((0, 1))


def test_a_gain_in_one_block_is_sure_where_the_others_agree_in_their_shares() -> None:
    """Nine tenths of the squares lie in one block; in every block the candidate takes half of what is there."""
    size = np.where(np.arange(ROWS) < ROWS // BLOCKS, 30.0, 1.0)[:, None]
    A_there = A * size[:, :, None]
    losses = subset_losses(size * noise(4, 0.5) + A_there[:, :, 0], {"a": A_there}, least_loss=0.0)
    gain, std = losses.gain((0,), ())
    assert gain < CRITERIA.least_sigmas * std
    assert losses.is_sure((0,), ())
    assert not losses.is_sure((), (0,))
