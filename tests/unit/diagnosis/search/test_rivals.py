"""Rivals on columns of noise: what would do in a member's place, and what would not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compd.diagnosis.criteria import Criteria
from compd.diagnosis.search.rivals import collinearity, find_rivals
from compd.model.library import load_library
from tests.support.candidate_sets import COORDINATES, ROWS, candidate, columns, description, noise, subset_losses

A, B, C = columns(1), columns(2), columns(3)
a, b = A[:, :, 0], B[:, :, 0]
ELASTICITY = load_library()["link_elasticity"]
CONSTANT = np.broadcast_to(np.eye(COORDINATES), (ROWS, COORDINATES, COORDINATES))


def test_a_nearly_equal_column_is_a_rival_and_another_is_not() -> None:
    twin = candidate("twin", A + 0.05 * B, effect=ELASTICITY)
    losses = subset_losses(noise(4) + 1.5 * a, [candidate("a", A), twin, candidate("other", C)])
    (rival,) = find_rivals(losses, (0,), 0)
    assert (rival.member, rival.name) == (1, "link_elasticity")
    assert rival.cosine == pytest.approx(1 / np.hypot(1.0, 0.05), abs=1e-3)
    assert rival.excess == pytest.approx(losses.loss((1,)) - losses.loss((0,)), rel=1e-6)
    assert rival.std > 0
    assert collinearity(losses, (), 0, 2) < 0.2


def test_effects_that_do_the_same_are_rivals_far_above_the_floor() -> None:
    """Backlash and latency at one speed, with ten times the noise left of something else."""
    twin = candidate("twin", 1.7 * A, effect=ELASTICITY)
    losses = subset_losses(noise(4, 10.0) + 8.0 * a, [candidate("a", A), twin])
    (rival,) = find_rivals(losses, (0,), 0)
    assert rival.name == "link_elasticity"
    assert rival.cosine == pytest.approx(1.0)


def test_what_misses_most_of_what_the_member_takes_is_no_rival_whatever_the_standard_error() -> None:
    losses = subset_losses(noise(4) + 1.5 * a, [candidate("a", A), candidate("half", A + B, effect=ELASTICITY)])
    generous = replace(Criteria(), least_sigmas=1e6, effect_price=1e6)
    assert find_rivals(subset_losses(noise(4) + 1.5 * a, losses.candidates, generous), (0,), 0) == ()
    generous = replace(generous, rival_share=1.0)
    assert len(find_rivals(subset_losses(noise(4) + 1.5 * a, losses.candidates, generous), (0,), 0)) == 1


def test_what_takes_another_part_of_the_error_that_is_as_large_is_no_rival() -> None:
    """Beside it the member gains as much as alone."""
    losses = subset_losses(noise(4) + 1.5 * a + 1.5 * b, [candidate("a", A), candidate("b", B, effect=ELASTICITY)])
    assert losses.loss((1,)) == pytest.approx(losses.loss((0,)), rel=0.1)
    assert find_rivals(losses, (0,), 0) == ()


def test_a_more_general_effect_is_a_rival_only_where_the_difference_may_be_chance() -> None:
    general = candidate("general", np.concatenate([A + 0.2 * B, columns(6, 4)], axis=2), effect=ELASTICITY)
    as_simple = candidate("simple", A + 0.2 * B, effect=ELASTICITY)
    y = noise(4) + 1.5 * a
    strict = replace(Criteria(), least_sigmas=0.5)
    assert find_rivals(subset_losses(y, [candidate("a", A), as_simple], strict), (0,), 0)
    assert not find_rivals(subset_losses(y, [candidate("a", A), general], strict), (0,), 0)


def test_an_implausible_effect_is_no_rival() -> None:
    twin = candidate("twin", A + 0.05 * B, limit=0.1, effect=ELASTICITY)
    losses = subset_losses(noise(4) + 1.5 * a, [candidate("a", A), twin])
    assert find_rivals(losses, (0,), 0) == ()


def test_with_the_constant_an_effect_may_do_what_it_cannot_do_alone() -> None:
    """The member is its rival and a constant: found only by trying both together."""
    shifted = A + 3.0
    twin = candidate("twin", A, effect=ELASTICITY)
    y = noise(4) + 1.5 * shifted[:, :, 0]
    constant = candidate("constant", CONSTANT, np.inf, kind="constant")
    assert find_rivals(subset_losses(y, [candidate("shifted", shifted), twin]), (0,), 0) == ()
    (rival,) = find_rivals(subset_losses(y, [candidate("shifted", shifted), twin, constant]), (0,), 0)
    assert rival.name == "link_elasticity"


def test_what_the_constant_does_as_well_has_no_rivals_but_those_that_do_it_alone() -> None:
    """Anything at all and the constant would do."""
    shift = candidate("shift", CONSTANT @ np.ones((COORDINATES, 1)))
    constant = candidate("constant", CONSTANT, np.inf, kind="constant")
    y = noise(4) + 3.0
    losses = subset_losses(y, [shift, candidate("other", A, effect=ELASTICITY), constant])
    assert find_rivals(losses, (0,), 0) == ()


def test_descriptions_and_the_constant_are_no_rivals_and_proxies_are() -> None:
    y = noise(4) + 1.5 * a
    others = [description("d", A), candidate("change", A, kind="change"), candidate("constant", A, kind="constant")]
    assert find_rivals(subset_losses(y, [candidate("a", A), *others]), (0,), 0) == ()
    proxy = candidate("link_elasticity by proxy", A, kind="proxy", effect=ELASTICITY)
    (rival,) = find_rivals(subset_losses(y, [candidate("a", A), proxy]), (0,), 0)
    assert rival.name == "link_elasticity"


def test_an_effect_that_is_in_the_set_is_no_rival_of_another_member() -> None:
    twin = candidate("twin", A + 0.05 * B, effect=ELASTICITY)
    losses = subset_losses(noise(4) + 1.5 * a + b, [candidate("a", A), twin])
    assert find_rivals(losses, (0, 1), 0) == ()


def test_an_effect_is_named_once_as_a_rival_by_its_best_variant() -> None:
    variants = [candidate("twin", A + share * B, effect=ELASTICITY) for share in (0.05, 0.04, 0.06)]
    losses = subset_losses(noise(4) + 1.5 * a, [candidate("a", A), *variants])
    (rival,) = find_rivals(losses, (0,), 0)
    assert losses.loss((rival.member,)) == min(losses.loss((k,)) for k in (1, 2, 3))


def test_collinearity_is_that_beside_the_rest_of_the_set() -> None:
    losses = subset_losses(noise(4) + 1.5 * a + 2.0 * b, {"a": A, "b": B, "a and b": A + B})
    assert collinearity(losses, (), 0, 2) == pytest.approx(1 / np.sqrt(2), abs=0.1)
    assert collinearity(losses, (1,), 0, 2) == pytest.approx(1.0)


def test_whatever_can_make_the_constant_is_its_rival_however_many_numbers_it_has() -> None:
    """A frame has six numbers: three of them make the constant, the others cost more than may be chance."""
    constant = candidate("constant", CONSTANT, np.inf, kind="constant")
    frame = candidate("frame", np.concatenate([CONSTANT, columns(6, 6)], axis=2), effect=ELASTICITY)
    strict = replace(Criteria(), least_sigmas=0.0)
    (rival,) = find_rivals(subset_losses(noise(4) + 20.0, [constant, frame], strict), (0,), 0)
    assert rival.excess > rival.std
    assert rival.name == "link_elasticity"
