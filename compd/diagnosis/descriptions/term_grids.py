"""The values of nonlinear constants that empirical terms try: time constants, times of steps, knees and periods."""

from __future__ import annotations

import math

import numpy as np

from compd.arrays import FloatArray
from compd.diagnosis.candidate_criteria import DescriptionCriteria
from compd.diagnosis.descriptions.search_covariates import SearchCovariate, round_within
from compd.statistics import PeriodCriteria, PeriodLimits, strongest_periods
from compd.units import unit_of

TURN = {"deg": 360.0, "rad": 2 * math.pi}
# Steps and knees are round numbers to within this share of the covariate's range, periods to within this share of a
# turn over the range.
ROUNDING = 1e-3


def step_times_s(time_s: FloatArray, criteria: DescriptionCriteria) -> tuple[float, ...]:
    """Times that divide the rows (R,) evenly."""
    return _quantiles(time_s, criteria.step_times)


def knees(covariate: SearchCovariate, criteria: DescriptionCriteria) -> tuple[float, ...]:
    """Values of a covariate that divide its rows evenly."""
    return _quantiles(covariate.values, criteria.knees)


def periods(
    covariate: SearchCovariate, residual_um: FloatArray, criteria: DescriptionCriteria, spectrum: PeriodCriteria
) -> tuple[float, ...]:
    """Periods of a covariate to try: harmonics of a turn, for an angle, and the strongest in a residual (R, m)."""
    turn = TURN.get(unit_of(covariate.name), 0.0)
    harmonics = [
        turn / n for n in criteria.harmonics if turn and covariate.span >= criteria.min_period_share * turn / n
    ]
    shortest = criteria.values_per_period * covariate.span / covariate.distinct
    limits = PeriodLimits(shortest, covariate.span, criteria.min_turns, criteria.max_turns)
    search = strongest_periods(covariate.values[:, None], residual_um, limits, criteria.periods, spectrum)
    found = [_round_period(period, covariate.span) for period in search.periods]
    new = [
        period
        for period in found
        if not any(_turns_apart(period, known, covariate.span) < criteria.alike_turns for known in harmonics)
    ]
    return (*harmonics, *new)


def refined_periods(period: float, unit: str, span: float, count: int, criteria: DescriptionCriteria) -> list[float]:
    """`count` periods within `refined_turns` of one over the span of its covariate; of a harmonic of a turn, itself."""
    if harmonic(period, unit) in criteria.harmonics:
        return [period]
    turns = span / period
    return [
        _round_period(span / turn, span)
        for turn in np.linspace(turns - criteria.refined_turns, turns + criteria.refined_turns, count).tolist()
    ]


def harmonic(period: float, unit: str) -> int:
    """How often a period of an angle repeats in a turn; 0 where it does not, and of no angle."""
    count = round(TURN.get(unit, 0.0) / period)
    return count if count and math.isclose(period * count, TURN[unit]) else 0


def _round_period(period: float, span: float) -> float:
    """The roundest period within ROUNDING turns over the range of its covariate."""
    return round_within(period, ROUNDING * period**2 / span)


def _turns_apart(period: float, other: float, span: float) -> float:
    """By how many turns over the range two periods differ."""
    return abs(span / period - span / other)


def _quantiles(values: FloatArray, count: int) -> tuple[float, ...]:
    places = np.quantile(values, np.linspace(0, 1, count + 2)[1:-1])
    tolerance = ROUNDING * float(np.ptp(values))
    return tuple(dict.fromkeys(round_within(place, tolerance) for place in places.tolist()))
