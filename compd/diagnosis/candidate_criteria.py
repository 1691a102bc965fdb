"""The numbers by which candidates and descriptions are made, each with its meaning, its unit and its reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CandidateCriteria:
    """Which effects of the library are tried, at which values of their constants, and which changes in time."""

    max_empty_share: float = 0.1
    """share of the rows | an effect whose quantities are empty in more rows cannot be tested | a choice: only rows in
    which every candidate is known count, so that one that is known in fewer would cost all others those rows"""
    min_motion_um: float = 1e-3
    """um | an effect that moves no row by more, at the end of its plausible range, cannot be tested | below the
    resolution of every reference"""
    searched_constant: int = 2
    """parameters | so many the search for a continuous constant counts for | the best of ten values fits noise about as
    two parameters do: log 10 = 2.3"""
    searched_choice: int = 1
    """parameters | so many the search among the choices of a constant counts for | the better of two fits noise about
    as one parameter does: log 2 = 0.7"""
    coldest_K: float = 200.0
    """K | a column in kelvin with smaller values is a difference, which stands for no thermometer | no machine is
    measured at -73 degC"""
    moments: int = 8
    """moments | so many moments, evenly over the rows, are tried for a change beside the starts of sessions | a choice:
    what changed between two of them is found when the moment is refined"""
    max_session_starts: int = 24
    """starts of sessions | so many are tried for a change at most, evenly chosen | a choice: what changed between two
    of them is found when the moment is refined"""
    moments_between: int = 9
    """moments | so many are tried between the moment of a change and each neighbour | with 8 moments it is then found
    to about a hundredth of the recording"""
    constants_between: int = 4
    """values | so many values of a constant are tried between the one that was found and each neighbour | a grid of
    time constants a factor of two apart becomes one of 1.15"""


@dataclass(frozen=True)
class DescriptionCriteria:
    """Which descriptions without a cause are tried beside effects, and which of them compete."""

    lags_s: tuple[float, ...] = (120.0, 300.0, 700.0, 1700.0, 4000.0, 10000.0)
    """s | time constants that are tried for a lag | from a fan's minutes to a granite plate's morning, a factor of 2.4
    apart"""
    constant_share: float = 0.3
    """share of the prediction's scatter | a coordinate of which the reference scatters by less has a constant
    reference, as a straight edge is | a choice: a reference that follows the machine scatters as the prediction does"""
    copy_correlation: float = 0.99
    """correlation | a column that goes with the prediction so well is its copy, and describes nothing of a residual
    against a constant reference | a choice: a seventh of it (sin of the angle) is its own"""
    step_times: int = 24
    """times | so many times, evenly over the rows, are tried for a step, then some between the best one's neighbours |
    a choice: a step between two of them still shows at the nearer"""
    knees: int = 8
    """values | so many values of a covariate, evenly over the rows, are tried for a change of slope | a choice: a cable
    comes taut, a stop is reached, a preload is used up"""
    values_per_period: float = 6.0
    """different values of the covariate | a period must span so many on average | a choice: fewer describe noise by a
    sine"""
    min_turns: float = 2.0
    """turns | a period must fit so many times into the range of its covariate | a choice: what does not repeat is no
    period"""
    max_turns: float = 80.0
    """turns | and not more often | a choice: more would be a search for needles without a cause to look for"""
    periods: int = 5
    """periods | so many of those that a residual suggests are tried | a choice: more would be chance"""
    alike_turns: float = 0.25
    """turns over the range of the covariate | a period that a residual suggests is not tried where it differs by less
    from a harmonic of a turn | at a quarter of a turn a period fits half as well at best"""
    refined_turns: float = 0.25
    """turns over the range of the covariate | within so much of a period that was found it is refined | what other
    causes leave moves a peak by less"""
    harmonics: tuple[int, ...] = (1, 2, 3)
    """periods in a turn | of an angle these are tried in any case | eccentricity; ellipticity or a tilted axis; three
    points of support"""
    min_period_share: float = 1 / 8
    """share of the period | over less of a period its harmonic is not tried | a sine is a parabola there within 0.3 %
    of its size: the third term of its series, (pi/8)^3 / 24"""
    refined_values: int = 9
    """values | so many are tried about the best step, knee or period | a choice: a quarter of the space between
    neighbours"""
    promising: int = 14
    """descriptions | so many of those that explain most where they were fitted compete with effects | a choice: a
    residual has few causes"""
    max_per_covariate: int = 3
    """descriptions | so many of one covariate compete at most | a choice: else forms of the first would leave no place
    for the second"""
    squares_per_number: float = 2.0
    """variances of the noise | descriptions are ordered by what they explain less so much for each of their numbers |
    Akaike: twice what a number explains of pure noise"""
    screened_rows: int = 1500
    """rows | on about so many rows, evenly spread, descriptions are ordered | a choice: which are promising shows on
    few"""
    min_direction_share: float = 0.03
    """share of a description's squares | a direction in which it explains less is left out of the proposed formulas | a
    choice: it would be a formula for noise"""
