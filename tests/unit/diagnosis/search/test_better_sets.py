"""How many other sets may be better than the named one, on columns of noise."""

from __future__ import annotations

import numpy as np
import pytest

from compd.diagnosis import SubsetLosses
from compd.diagnosis.search.better_sets import better_sets
from tests.support.candidate_sets import COORDINATES, ROWS, candidate, columns, noise, subset_losses

FIRST, SECOND, THIRD = columns(1), columns(2), columns(3)
CONSTANT = np.broadcast_to(np.eye(COORDINATES), (ROWS, COORDINATES, COORDINATES))


def three(y: np.ndarray) -> SubsetLosses:
    return subset_losses(y, {"first": FIRST, "second": SECOND, "third": THIRD})


def test_no_other_set_may_be_better_than_a_strong_effect_that_resembles_no_other() -> None:
    assert better_sets(three(noise(4) + 1.5 * FIRST[:, :, 0]), (0,)) < 0.01


def test_where_nothing_acts_the_empty_set_is_the_best() -> None:
    assert better_sets(three(noise(4)), ()) < 0.01


def test_an_effect_that_does_the_same_is_the_better_one_in_half_of_all_cases() -> None:
    alike = {"first": FIRST, "alike": FIRST + 0.01 * SECOND, "third": THIRD}
    losses = subset_losses(noise(4) + 1.5 * FIRST[:, :, 0], alike)
    found = better_sets(losses, (0,)), better_sets(losses, (1,))
    assert sum(found) == pytest.approx(1.0, abs=0.05)
    assert min(found) > 0.05


@pytest.mark.parametrize("named", [(0,), (0, 1)])
def test_an_effect_about_as_large_as_its_price_leaves_open_whether_it_is_named(named: tuple[int, ...]) -> None:
    y = noise(4) + 1.5 * FIRST[:, :, 0]
    found = [better_sets(three(y + size * SECOND[:, :, 0]), named) for size in (0.1, 0.36, 1.0)]
    certain, undecided, wrong = found if named == (0,) else reversed(found)
    assert certain < 0.05
    assert 0.1 < undecided < 0.9 < wrong


def test_a_set_with_an_implausible_number_is_not_better() -> None:
    y = noise(4) + 1.5 * FIRST[:, :, 0]
    assert better_sets(subset_losses(y, [candidate("first", FIRST, limit=0.1), candidate("other", SECOND)]), ()) == 0.0
    assert better_sets(subset_losses(y, [candidate("first", FIRST), candidate("other", SECOND)]), ()) > 0.99


def test_effects_that_make_a_constant_count_as_one() -> None:
    offset = CONSTANT[:, :, :1] + 0.005 * SECOND
    tilt = CONSTANT[:, :, :1] + 0.005 * THIRD
    y = noise(4) + 2.0 * CONSTANT[:, :, 0]
    either = [candidate("offset", offset), candidate("tilt", tilt)]
    assert better_sets(subset_losses(y, either), (0,)) > 0.1
    with_constant = [*either, candidate("constant", CONSTANT, np.inf, kind="constant")]
    assert better_sets(subset_losses(y, with_constant), (0,)) < 0.01


def test_the_lead_is_the_difference_of_the_scores() -> None:
    losses = three(noise(4) + 1.5 * FIRST[:, :, 0])
    (best,), (other,) = losses.evaluate([(0,)]), losses.evaluate([(1, 2)])
    lead, _ = losses.lead((0,), (1, 2))
    assert lead == pytest.approx(losses.score(other) - losses.score(best), rel=1e-6)
    assert losses.lead((1, 2), (0,))[0] == pytest.approx(-lead)


def test_the_standard_error_of_a_lead_is_how_much_it_scatters() -> None:
    found = [three(noise(seed, 2.0) + 1.5 * FIRST[:, :, 0] + SECOND[:, :, 0]).lead((0,), (1,)) for seed in range(60)]
    leads, errors = np.array(found).T
    assert np.median(errors) == pytest.approx(leads.std(), rel=0.35)


def test_below_the_floor_a_lead_is_the_price_alone() -> None:
    lead, std = three(noise(4, 0.5)).lead((), (0,))
    assert (lead, std) == (pytest.approx(0.12), 0.0)
