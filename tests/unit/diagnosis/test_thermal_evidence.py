"""How often a temperature went up and down: one warm-up proves no thermal cause."""

from __future__ import annotations

import numpy as np
import pytest

from compd.diagnosis.thermal_evidence import has_cycled, swings


@pytest.mark.parametrize(
    ("values", "count"),
    [
        ([20.0, 20.0, 20.0], 0),
        ([20.0, 22.0, 25.0, 30.0], 1),
        ([20.0, 30.0, 21.0], 2),
        ([20.0, 30.0, 20.5, 29.0], 3),
        ([30.0, 20.0, 29.0, 21.0], 3),
        ([20.0, 30.0, 28.5, 30.0, 29.0], 1),
    ],
    ids=["still", "a warm-up", "up and down", "up again", "down first", "a heater that is controlled"],
)
def test_swings_are_counted_between_turns_of_a_third_of_the_range(values: list[float], count: int) -> None:
    assert swings(np.array(values), 0.3) == count


def test_a_noisy_warm_up_is_one() -> None:
    rng = np.random.default_rng(3)
    assert swings(20.0 + 10.0 * (1 - np.exp(-np.linspace(0, 5, 400))) + rng.normal(0, 0.3, 400), 0.3) == 1


def test_a_thermometer_that_only_shows_its_noise_has_not_cycled() -> None:
    rng = np.random.default_rng(4)
    warm_up = 20.0 + 10.0 * (1 - np.exp(-np.linspace(0, 5, 400)))
    still = rng.normal(23.0, 0.03, 400)
    assert swings(still, 0.3) > 2
    assert not has_cycled([warm_up, still], 0.3)
    assert has_cycled([warm_up, 20.0 + 5.0 * np.sin(np.linspace(0, 12, 400))], 0.3)
    assert not has_cycled([], 0.3)
