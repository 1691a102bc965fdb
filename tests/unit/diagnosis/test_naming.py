"""Which of several effects that do the same is named, on columns of noise."""

from __future__ import annotations

import numpy as np

from compd.diagnosis.candidates.candidates import Candidate
from compd.diagnosis.rival_selection import named_members, with_fewest_numbers
from compd.model.library import load_library
from tests.support.candidate_sets import COORDINATES, ROWS, candidate, columns, noise, subset_losses

SIMPLE, BESIDE = columns(1), columns(2)
ELASTICITY = load_library()["link_elasticity"]


def general(*more: np.ndarray) -> Candidate:
    """An effect that holds the simple one as a special case."""
    return candidate("general", np.concatenate([SIMPLE, *more], axis=2), effect=ELASTICITY)


def test_an_effect_that_also_describes_a_small_disturbance_gives_way_to_the_simple_one() -> None:
    y = noise(4) + 1.5 * SIMPLE[:, :, 0] + 0.05 * BESIDE[:, :, 0]
    losses = subset_losses(y, [general(BESIDE, columns(6, 5)), candidate("simple", SIMPLE)])
    assert with_fewest_numbers(losses, (0,)) == (1,)
    assert with_fewest_numbers(losses, (1,)) == (1,)


def test_an_effect_that_explains_evidently_more_stays() -> None:
    y = noise(4) + 1.5 * SIMPLE[:, :, 0] + 0.4 * BESIDE[:, :, 0]
    losses = subset_losses(y, [general(BESIDE, columns(6, 5)), candidate("simple", SIMPLE)])
    assert with_fewest_numbers(losses, (0,)) == (0,)


def test_a_lone_constant_is_named_by_an_effect_that_makes_it_and_one_beside_effects_is_not() -> None:
    constant = np.broadcast_to(np.eye(COORDINATES), (ROWS, COORDINATES, COORDINATES))
    candidates = [
        candidate("constant", constant, np.inf, kind="constant"),
        candidate("offset", constant @ np.ones((COORDINATES, 1)), effect=ELASTICITY),
        candidate("other", SIMPLE),
    ]
    assert named_members(subset_losses(noise(4) + 3.0, candidates), (0,)) == (1,)
    both = subset_losses(noise(4) + 3.0 + 1.5 * SIMPLE[:, :, 0], candidates)
    assert named_members(both, (2, 0)) == (2, 0)


def test_a_rival_that_needs_the_constant_takes_it_along_or_stays_behind() -> None:
    constant = np.broadcast_to(np.eye(COORDINATES), (ROWS, COORDINATES, COORDINATES))
    y = noise(4) + 3.0 + 1.5 * SIMPLE[:, :, 0]
    offset, simple = candidate("constant", constant, np.inf, kind="constant"), candidate("simple", SIMPLE)
    more = general(constant, columns(6, 5))
    losses = subset_losses(y, [more, simple, offset])
    assert losses.loss((1,)) > 5 * losses.loss((0,))
    assert with_fewest_numbers(losses, (0,)) == (1, 2)
    few = subset_losses(y, [general(constant), simple, offset])
    assert few.candidates[0].parameter_count == 1 + COORDINATES
    assert with_fewest_numbers(few, (0,)) == (0,)
