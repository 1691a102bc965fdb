"""Forward search on columns of noise: which set is chosen is known by how the residual is made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compd.diagnosis.criteria import Criteria
from compd.diagnosis.search.forward_search import best_acceptable, extend, forward_search
from compd.diagnosis.search.subset_losses import Subset
from tests.support.candidate_sets import candidate, columns, description, names, noise, subset_losses

A, B, C = columns(1), columns(2), columns(3)
a, b, c = A[:, :, 0], B[:, :, 0], C[:, :, 0]


def test_the_columns_in_the_residual_are_chosen_and_no_others() -> None:
    losses = subset_losses(noise(4) + 2.0 * a - 1.5 * b, {"a": A, "b": B, "c": C, "d": columns(5, 3)})
    assert forward_search(losses).members == (0, 1)


def test_noise_alone_chooses_nothing() -> None:
    losses = subset_losses(noise(5), {"a": A, "b": columns(7, 4)})
    assert forward_search(losses) == Subset((), losses.baseline)


def test_several_effects_of_like_size_are_all_found() -> None:
    """None of them takes the larger part of the error, and each is far beyond chance."""
    values = {str(k): columns(k) for k in range(10, 18)}
    y = noise(4) + sum(0.8 * values[str(k)][:, :, 0] for k in range(10, 15))
    losses = subset_losses(y, values)
    assert names(losses, forward_search(losses).members) == {"10", "11", "12", "13", "14"}


def test_two_effects_that_gain_only_together_are_found() -> None:
    twin = a + 0.25 * b
    y = noise(4) + 8 * (twin - a)  # 2 b, of which neither alone explains much
    values = {"a": A, "twin": twin[:, :, None], "c": C}
    losses = subset_losses(y, [candidate(name, column, 1000.0) for name, column in values.items()])
    assert losses.loss((0,)) > 0.9 * losses.baseline
    assert losses.loss((1,)) > 0.9 * losses.baseline
    assert names(losses, forward_search(losses).members) == {"a", "twin"}


def test_what_was_best_alone_is_exchanged_for_what_is_right_together() -> None:
    mixed = A + B + 0.7 * columns(6)
    losses = subset_losses(noise(4) + a + b, {"mixed": mixed, "a": A, "b": B, "c": C})
    assert next(iter(losses.best_variants)) == "mixed"
    assert names(losses, forward_search(losses).members) == {"a", "b"}


def test_of_two_variants_of_an_effect_one_is_chosen() -> None:
    variants = [candidate("lag", A, constants={"tau": 1.0}), candidate("lag", B, constants={"tau": 2.0})]
    losses = subset_losses(noise(4) + 2.0 * a + b, variants)
    assert forward_search(losses).members == (0,)


def test_a_member_that_does_not_lower_the_log_loss_by_its_price_is_left_out() -> None:
    """0.25 of noise's variance: log 1.25 = 0.22; a price of 0.3 is too much, whatever the standard error."""
    y = noise(4) + 0.5 * a
    assert forward_search(subset_losses(y, {"a": A})).members == (0,)
    dear = replace(Criteria(), effect_price=0.3, least_sigmas=0.0)
    assert forward_search(subset_losses(y, {"a": A}, dear)).members == ()


def test_a_member_whose_gain_may_be_chance_is_left_out() -> None:
    """All of the gain is in one block of 24, so that its standard error is as large."""
    y = noise(4)
    y[100:110] += 6.0 * a[100:110]
    values = {"a": np.where((np.arange(len(y)) // 10 == 10)[:, None, None], A, 0.02 * A)}
    cheap = replace(Criteria(), effect_price=0.01)
    loose = replace(cheap, least_sigmas=0.0)
    assert forward_search(subset_losses(y, values, loose)).members == (0,)
    assert forward_search(subset_losses(y, values, cheap)).members == ()


def test_the_same_price_is_asked_far_above_the_floor() -> None:
    """A share of what is left: 20 % of the mean square pays for itself at a hundred floors as at one."""
    for size in (1.0, 10.0, 100.0):
        losses = subset_losses(size * (noise(4) + 0.5 * a), {"a": A, "b": B})
        assert forward_search(losses).members == (0,)


def test_every_further_number_has_a_price() -> None:
    """Nine flexible numbers that contain the right one do as well, and lose."""
    flexible = np.concatenate([A, columns(6, 8)], axis=2)
    losses = subset_losses(noise(4) + 1.0 * a, {"flexible": flexible, "a": A})
    assert forward_search(losses).members == (1,)
    assert losses.price(0) - losses.price(1) == pytest.approx(8 * Criteria().number_price)


def test_a_set_with_an_implausible_number_is_passed_over() -> None:
    y = noise(4) + 2.0 * a
    assert forward_search(subset_losses(y, [candidate("a", A, limit=0.1)])).members == ()
    near = A + 0.5 * B
    losses = subset_losses(y, [candidate("a", A, limit=0.1), candidate("near", near)])
    assert forward_search(losses).members == (1,)


def test_an_undetermined_member_does_not_hide_the_set_without_it() -> None:
    losses = subset_losses(noise(4) + 2.0 * a, [candidate("a", A), candidate("tiny", 1e-7 * B, limit=0.01)])
    assert forward_search(losses).members == (0,)


def test_no_more_members_than_a_recording_can_prove() -> None:
    values = {str(k): columns(k) for k in range(10, 20)}
    losses = subset_losses(noise(4) + sum(2.0 * column[:, :, 0] for column in values.values()), values)
    assert len(forward_search(losses).members) == Criteria().search.max_members


def test_effects_that_do_nearly_as_well_are_preferred_to_a_description() -> None:
    """Effects of 0.05 more log loss than a description at the same price: less than an effect's price."""
    better = columns(8)
    y = noise(4) + 2.0 * a + 0.1 * better[:, :, 0]
    equal = replace(Criteria(), description_price=Criteria().effect_price)
    losses = subset_losses(y, [candidate("a", A), description("d", A + 0.05 * better)], equal)
    assert losses.score(Subset((1,), losses.loss((1,)))) < losses.score(Subset((0,), losses.loss((0,))))
    assert forward_search(losses).members == (0,)
    assert forward_search(subset_losses(y, [description("d", A)])).members == (0,), "where there is no cause"


def test_of_sets_that_do_about_as_well_that_with_the_fewest_descriptions_counts() -> None:
    """Two descriptions, or one and an effect that is a little worse in the place of the other."""
    D, like_d = columns(21), columns(21) + 0.05 * columns(23)
    y = noise(4) + 2.0 * a + 2.0 * D[:, :, 0]
    equal = replace(Criteria(), description_price=Criteria().effect_price, least_sigmas=5.0)
    losses = subset_losses(y, [description("a", A), description("d", D), candidate("effect", like_d)], equal)
    both, fewer = losses.evaluate([(0, 1), (0, 2)])
    assert 0 < losses.score(fewer) - losses.score(both) < equal.effect_price
    assert best_acceptable(losses).members == (0, 2)


def test_only_what_is_allowed_is_added() -> None:
    losses = subset_losses(noise(4) + 2.0 * a - 1.5 * b, {"a": A, "b": B, "c": C})
    assert extend(losses, among=[0, 2]).members == (0,)


def test_an_effect_is_no_cause_beside_descriptions_where_a_description_does_better_in_its_place() -> None:
    """The residual is d and e; the effect looks like d and is cheaper, but d predicts rows left out better."""
    D, E = columns(21), columns(22)
    like_d = D + 0.25 * columns(23)
    y = noise(4) + 2.0 * D[:, :, 0] + 2.0 * E[:, :, 0]
    candidates = [candidate("effect", like_d), description("d", D), description("e", E)]
    dear = replace(Criteria(), description_price=0.4)
    losses = subset_losses(y, candidates, dear)
    assert losses.score(losses.evaluate([(0, 2)])[0]) < losses.score(losses.evaluate([(1, 2)])[0])
    assert names(losses, forward_search(losses).members) == {"d", "e"}


def test_the_search_goes_on_from_where_another_ended() -> None:
    losses = subset_losses(noise(4) + 2.0 * a - 1.5 * b, {"a": A, "b": B, "c": C})
    assert forward_search(losses, start=(2,)).members == (0, 1)
    assert best_acceptable(losses).members == (0, 1)


def test_an_effect_with_many_numbers_is_none_where_the_constant_takes_nearly_as_much() -> None:
    ones = np.broadcast_to(np.eye(3), (len(A), 3, 3))
    many = candidate("many", np.concatenate([ones, columns(31, 4)], axis=2))
    constant = candidate("constant", ones, np.inf, kind="constant")
    wiggle = columns(31, 4) @ np.array([0.25, 0.2, 0.0, 0.0])
    losses = subset_losses(noise(4) + 3.0 + wiggle, [many, constant])
    assert losses.score(Subset((0,), losses.loss((0,)))) < losses.score(Subset((1,), losses.loss((1,))))
    assert names(losses, forward_search(losses).members) == {"constant"}
    assert names(losses, forward_search(subset_losses(noise(4) + 3.0 + 4 * wiggle, [many, constant])).members) == {
        "many"
    }
