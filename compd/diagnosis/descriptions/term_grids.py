"""The values of nonlinear constants that empirical terms try: time constants, times of steps, knees and periods."""

from __future__ import annotations

import math

import numpy as np

from compd.arrays import FloatArray
from compd.diagnosis.descriptions.search_covariates import SearchCovariate, round_within
from compd.statistics import PeriodLimits, strongest_periods
from compd.units import unit_of

# Time constants of a lag, s: from a fan's minutes to a granite plate's morning.
LAGS_S = (120.0, 300.0, 700.0, 1700.0, 4000.0, 10000.0)
# Times at which a step is looked for first; then between the best one's neighbours.
STEP_TIMES = 24
# Values of a covariate at which a slope may change: a cable comes taut, a stop is reached, a preload is used up.
KNEES = 8
# A period must span so many different values of the covariate on average, and fit into its range so many times; more
# turns than the most would be a search for needles without a cause to look for.
VALUES_PER_PERIOD = 6
FEWEST_TURNS, MOST_TURNS = 2, 80
# Periods that are tried, of those that a residual suggests.
PERIODS = 5
# A period found beside other causes is that far off at most: what they leave moves a peak.
REFINED_TURNS = 0.25
# Harmonics of a turn: eccentricity, ellipticity or a tilted axis, three points of support.
HARMONICS = (1, 2, 3)
TURN = {"deg": 360.0, "rad": 2 * math.pi}
# Over less of a period a sine is a parabola within 0.3 % of its size: the third term of its series, (pi/8)^3 / 24.
LEAST_OF_PERIOD = 1 / 8
# Steps and knees are round numbers to within this share of the covariate's range, periods to within this share of a
# turn over the range.
ROUNDING = 1e-3


def step_times_s(time_s: FloatArray) -> tuple[float, ...]:
    """Times that divide the rows (R,) evenly."""
    return _quantiles(time_s, STEP_TIMES)


def knees(covariate: SearchCovariate) -> tuple[float, ...]:
    """Values of a covariate that divide its rows evenly."""
    return _quantiles(covariate.values, KNEES)


def periods(covariate: SearchCovariate, residual_um: FloatArray) -> tuple[float, ...]:
    """Periods of a covariate to try: harmonics of a turn, for an angle, and the strongest in a residual (R, m)."""
    turn = TURN.get(unit_of(covariate.name), 0.0)
    harmonics = [turn / n for n in HARMONICS if turn and covariate.span >= LEAST_OF_PERIOD * turn / n]
    shortest = VALUES_PER_PERIOD * covariate.span / covariate.distinct
    limits = PeriodLimits(shortest, covariate.span, FEWEST_TURNS, MOST_TURNS)
    search = strongest_periods(covariate.values[:, None], residual_um, limits, PERIODS)
    found = [_round_period(period, covariate.span) for period in search.periods]
    new = [period for period in found if not any(_fit_alike(period, known, covariate.span) for known in harmonics)]
    return (*harmonics, *new)


def refined_periods(period: float, unit: str, span: float, count: int) -> list[float]:
    """`count` periods within REFINED_TURNS of one over the span of its covariate; of a harmonic of a turn, itself."""
    if harmonic(period, unit):
        return [period]
    turns = span / period
    return [
        _round_period(span / turn, span)
        for turn in np.linspace(turns - REFINED_TURNS, turns + REFINED_TURNS, count).tolist()
    ]


def harmonic(period: float, unit: str) -> int:
    """How often a period of an angle repeats in a turn, of HARMONICS; 0 for any other period."""
    return next((n for n in HARMONICS if unit in TURN and math.isclose(period * n, TURN[unit])), 0)


def _round_period(period: float, span: float) -> float:
    """The roundest period within ROUNDING turns over the range of its covariate."""
    return round_within(period, ROUNDING * period**2 / span)


def _fit_alike(period: float, other: float, span: float) -> bool:
    """Whether two periods differ by less than a quarter of a turn over the range."""
    return abs(span / period - span / other) < 0.25


def _quantiles(values: FloatArray, count: int) -> tuple[float, ...]:
    places = np.quantile(values, np.linspace(0, 1, count + 2)[1:-1])
    tolerance = ROUNDING * float(np.ptp(values))
    return tuple(dict.fromkeys(round_within(place, tolerance) for place in places.tolist()))
