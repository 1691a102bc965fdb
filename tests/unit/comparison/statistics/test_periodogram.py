"""The least-squares spectrum: exact, and what its limits are."""

from __future__ import annotations

import numpy as np
import pytest

from compd.statistics import PeriodLimits, shortest_period, strongest_periods

RNG = np.random.default_rng(4)
PLACES_MM = RNG.uniform(-60, 60, (300, 3))


def waves(period: float, size: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """A wave in each of three series with phases of their own, and noise of 1."""
    return np.asarray(size * np.sin(2 * np.pi * PLACES_MM / period + np.arange(3)) + RNG.normal(0, 1, (300, 3)))


@pytest.mark.parametrize("period", [0.113, 1.37, 20.0])
def test_a_period_is_found_from_a_fraction_of_the_mean_spacing_to_half_the_range(period: float) -> None:
    search = strongest_periods(PLACES_MM, waves(period, 1.0), PeriodLimits(0.001, 60.0))
    # a quarter of a turn over 120 mm is the width of the peak
    assert search.periods[0] == pytest.approx(period, abs=0.1 * period**2 / 120)
    assert search.explained[0] == pytest.approx(3 * 0.5, rel=0.3)
    assert len(search.periods) == 5
    # 5000 turns in 120 mm: the most that are searched
    assert search.independent == pytest.approx(5000, rel=0.01)


def test_it_explains_what_a_fit_of_sine_cosine_and_constant_explains() -> None:
    y, q = waves(7.0, 0.5)[:, 0], PLACES_MM[:, 0]
    # without a parabola already, and about its mean
    y = y - np.polyval(np.polyfit(q, y, 2), q)
    search = strongest_periods(q[:, None], y[:, None], PeriodLimits(1.0, 60.0), count=2)
    for period, explained in zip(search.periods, search.explained, strict=True):
        A = np.stack([np.sin(2 * np.pi * q / period), np.cos(2 * np.pi * q / period), np.ones_like(q)], axis=1)
        rest = y - A @ np.linalg.lstsq(A, y, rcond=None)[0]
        assert explained == pytest.approx(np.mean(y**2) - np.mean(rest**2), abs=2e-3)


def test_even_places_resolve_nothing_below_twice_their_distance() -> None:
    places_mm = np.tile(np.arange(40) * 5.0, 4)[:, None]
    wave = np.sin(2 * np.pi * places_mm / 17.0) + RNG.normal(0, 0.2, places_mm.shape)
    search = strongest_periods(places_mm, wave, PeriodLimits(0.01, 100.0))
    assert search.periods[0] == pytest.approx(17.0, abs=0.1)
    assert min(search.periods) >= 10.0
    # 195 mm / 10 mm, less two turns at the long end
    assert search.independent == pytest.approx(17.5, abs=1.0)


@pytest.mark.parametrize("distance_mm", [3.0, 5.0, 20.0])
def test_even_places_tell_no_period_below_twice_their_distance(distance_mm: float) -> None:
    places_mm = np.tile(np.arange(10) * distance_mm, 4)[:, None]
    assert shortest_period(places_mm, 0.2) == pytest.approx(2 * distance_mm, rel=0.01)


def test_uneven_places_tell_every_period() -> None:
    assert shortest_period(PLACES_MM, 0.01) == 0.0
    assert shortest_period(np.ones((9, 1)), 0.1) == 0.0


def test_two_places_have_no_period() -> None:
    places_mm = RNG.choice([-1.0, 1.0], (100, 1))
    assert strongest_periods(places_mm, places_mm, PeriodLimits(1e-6, 1e6)).periods == ()
    assert strongest_periods(np.ones((9, 1)), np.ones((9, 1)), PeriodLimits(0.1, 1.0)).periods == ()


def test_a_trend_and_gross_values_hide_no_period() -> None:
    y = waves(1.37, 1.0) + 0.01 * (PLACES_MM + 20.0) ** 2
    y[::50] += 4000.0
    search = strongest_periods(PLACES_MM, y, PeriodLimits(0.01, 60.0))
    assert search.periods[0] == pytest.approx(1.37, abs=0.003)
