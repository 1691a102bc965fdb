"""What is uneven from place to place is chance, however often the places are visited."""

from __future__ import annotations

import numpy as np

from compd.diagnosis.search.place_significance import place_p_value

PLACES, VISITS = 9, 10
PLACE = np.tile(np.arange(PLACES), VISITS)
X = (PLACE / PLACES - 0.5)[:, None, None]
CONSTANT = np.ones((len(PLACE), 1, 1))
RNG = np.random.default_rng(5)


def uneven(rng: np.random.Generator, size: float = 1.0) -> np.ndarray:
    """Deviations (R, 1) of the places, the same at every visit, and a tenth of them as noise."""
    return np.asarray(size * rng.normal(0, 1, PLACES)[PLACE][:, None] + rng.normal(0, 0.1, (len(PLACE), 1)))


def test_unevenness_alone_is_uniform_by_chance() -> None:
    found = np.array([place_p_value(uneven(RNG), CONSTANT, [X], 1, PLACE) for _ in range(400)])
    assert abs((found < 0.05).mean() - 0.05) < 0.033  # three standard deviations of 400 cases
    assert abs((found < 0.5).mean() - 0.5) < 0.075


def test_the_best_of_many_counts_as_many() -> None:
    variants = [RNG.normal(0, 1, PLACES)[PLACE][:, None, None] for _ in range(20)]
    found = np.array([place_p_value(uneven(RNG), CONSTANT, variants, 20, PLACE) for _ in range(200)])
    assert (found < 0.05).mean() < 0.1


def test_what_is_far_above_the_unevenness_is_found() -> None:
    assert place_p_value(20.0 * X[:, :, 0] + uneven(RNG), CONSTANT, [X], 50, PLACE) < 0.001


def test_what_changes_within_places_is_not_compared_with_them() -> None:
    direction = np.repeat([1.0, -1.0], len(PLACE) // 2)[:, None, None]
    assert place_p_value(uneven(RNG), CONSTANT, [direction], 1, PLACE) == 0.0


def test_as_many_places_as_numbers_say_nothing() -> None:
    two = np.arange(len(PLACE)) % 2
    assert place_p_value(uneven(RNG), CONSTANT, [two[:, None, None].astype(float)], 1, two) == 1.0
