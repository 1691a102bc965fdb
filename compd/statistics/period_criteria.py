"""The thresholds of the search for periods."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PeriodCriteria:
    """The search for the period of an effect in a residual."""

    peaks: int = 5
    """periods | so many of the strongest periods of a residual are tried with an effect's own columns | a choice: more
    would be chance"""
    trials: int = 3
    """values | so many of the tried values of an effect's constants, the best ones, become candidates | a choice: the
    period, its double, and one more peak"""
    min_rows: int = 12
    """rows | in fewer rows no period is looked for | a choice: a sine beside a parabola has five numbers and its
    period, and twice as many rows test them"""
    min_turns: float = 2.0
    """turns | a period must fit so many times into the range of its quantity to be found in a residual | a choice: over
    less, a sine is hardly told from what is slow along the quantity"""
    max_turns: float = 5000.0
    """turns | and not more often | a choice: it bounds the search; 5000 turns are a pitch of 0.1 mm on 500 mm"""
    neighbour_turns: float = 0.25
    """turns over the range of the quantity | periods that differ by so much are neighbours, between which a period is
    refined; and the rows must cover a turn but for so much of it, or the effect cannot be tested | at a quarter of a
    turn a period fits half as well at best"""
    slow_degree: int = 2
    """degree of a polynomial | what is slow along the quantity is taken away before periods are looked for | a choice:
    a slope and a bend are another cause's"""
    outlier_sigmas: float = 4.0
    """robust standard deviations | a value farther out counts as one there: it would be noise at every frequency | a
    normal error is as large once in 16,000"""
    image_window: float = 0.9
    """spectral window, rms over the series | from here on frequencies are images of one another, and those above half
    of it are not searched | a choice: 0.81 of the square of a sine shows at its image"""
    image_multiples: int = 5
    """multiples | so many multiples of an image's frequency must be images, too, for an even grid of values | a choice:
    images of a few sessions, far apart, fade before"""
    chance: float = 0.01
    """probability | by less chance than this a searched period may contradict the period of the machine's description |
    a choice: the description is right in most cases"""
