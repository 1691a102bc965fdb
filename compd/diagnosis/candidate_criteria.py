"""The numbers by which candidates and descriptions are made, each with its meaning, its unit and its reason."""

from __future__ import annotations

from dataclasses import dataclass

from compd.threshold import threshold


@dataclass(frozen=True)
class CandidateCriteria:
    """Which effects of the library are tried, at which values of their constants, and which changes in time."""

    max_empty_share: float = threshold(
        0.1,
        unit="share of the rows",
        meaning="an effect whose quantities are empty in more rows cannot be tested",
        reason="a choice: only rows in which every candidate is known count, so that one that is known in fewer "
        "would cost all others those rows",
    )
    min_motion_um: float = threshold(
        1e-3,
        unit="um",
        meaning="an effect that moves no row by more, at the end of its plausible range, cannot be tested",
        reason="below the resolution of every reference",
    )
    searched_constant: int = threshold(
        2,
        unit="parameters",
        meaning="so many the search for a continuous constant counts for",
        reason="the best of ten values fits noise about as two parameters do: log 10 = 2.3",
    )
    searched_choice: int = threshold(
        1,
        unit="parameters",
        meaning="so many the search among the choices of a constant counts for",
        reason="the better of two fits noise about as one parameter does: log 2 = 0.7",
    )
    coldest_K: float = threshold(
        200.0,
        unit="K",
        meaning="a column in kelvin with smaller values is a difference, which stands for no thermometer",
        reason="no machine is measured at -73 degC",
    )
    moments: int = threshold(
        8,
        unit="moments",
        meaning="so many moments, evenly over the rows, are tried for a change beside the starts of sessions",
        reason="a choice: what changed between two of them is found when the moment is refined",
    )
    max_session_starts: int = threshold(
        24,
        unit="starts of sessions",
        meaning="so many are tried for a change at most, evenly chosen",
        reason="a choice: what changed between two of them is found when the moment is refined",
    )
    moments_between: int = threshold(
        9,
        unit="moments",
        meaning="so many are tried between the moment of a change and each neighbour",
        reason="with 8 moments it is then found to about a hundredth of the recording",
    )
    constants_between: int = threshold(
        4,
        unit="values",
        meaning="so many values of a constant are tried between the one that was found and each neighbour",
        reason="a grid of time constants a factor of two apart becomes one of 1.15",
    )


@dataclass(frozen=True)
class DescriptionCriteria:
    """Which descriptions without a cause are tried beside effects, and which of them compete."""

    lags_s: tuple[float, ...] = threshold(
        (120.0, 300.0, 700.0, 1700.0, 4000.0, 10000.0),
        unit="s",
        meaning="time constants that are tried for a lag",
        reason="from a fan's minutes to a granite plate's morning, a factor of 2.4 apart",
    )
    constant_share: float = threshold(
        0.3,
        unit="share of the prediction's scatter",
        meaning="a coordinate of which the reference scatters by less has a constant reference, as a straight edge is",
        reason="a choice: a reference that follows the machine scatters as the prediction does",
    )
    copy_correlation: float = threshold(
        0.99,
        unit="correlation",
        meaning="a column that goes with the prediction so well is its copy, and describes nothing of a residual "
        "against a constant reference",
        reason="a choice: a seventh of it (sin of the angle) is its own",
    )
    step_times: int = threshold(
        24,
        unit="times",
        meaning="so many times, evenly over the rows, are tried for a step, then some between the best one's "
        "neighbours",
        reason="a choice: a step between two of them still shows at the nearer",
    )
    knees: int = threshold(
        8,
        unit="values",
        meaning="so many values of a covariate, evenly over the rows, are tried for a change of slope",
        reason="a choice: a cable comes taut, a stop is reached, a preload is used up",
    )
    values_per_period: float = threshold(
        6.0,
        unit="different values of the covariate",
        meaning="a period must span so many on average",
        reason="a choice: fewer describe noise by a sine",
    )
    min_turns: float = threshold(
        2.0,
        unit="turns",
        meaning="a period must fit so many times into the range of its covariate",
        reason="a choice: what does not repeat is no period",
    )
    max_turns: float = threshold(
        80.0,
        unit="turns",
        meaning="and not more often",
        reason="a choice: more would be a search for needles without a cause to look for",
    )
    periods: int = threshold(
        5,
        unit="periods",
        meaning="so many of those that a residual suggests are tried",
        reason="a choice: more would be chance",
    )
    alike_turns: float = threshold(
        0.25,
        unit="turns over the range of the covariate",
        meaning="a period that a residual suggests is not tried where it differs by less from a harmonic of a turn",
        reason="at a quarter of a turn a period fits half as well at best",
    )
    refined_turns: float = threshold(
        0.25,
        unit="turns over the range of the covariate",
        meaning="within so much of a period that was found it is refined",
        reason="what other causes leave moves a peak by less",
    )
    harmonics: tuple[int, ...] = threshold(
        (1, 2, 3),
        unit="periods in a turn",
        meaning="of an angle these are tried in any case",
        reason="eccentricity; ellipticity or a tilted axis; three points of support",
    )
    min_period_share: float = threshold(
        1 / 8,
        unit="share of the period",
        meaning="over less of a period its harmonic is not tried",
        reason="a sine is a parabola there within 0.3 % of its size: the third term of its series, (pi/8)^3 / 24",
    )
    refined_values: int = threshold(
        9,
        unit="values",
        meaning="so many are tried about the best step, knee or period",
        reason="a choice: a quarter of the space between neighbours",
    )
    promising: int = threshold(
        14,
        unit="descriptions",
        meaning="so many of those that explain most where they were fitted compete with effects",
        reason="a choice: a residual has few causes",
    )
    max_per_covariate: int = threshold(
        3,
        unit="descriptions",
        meaning="so many of one covariate compete at most",
        reason="a choice: else forms of the first would leave no place for the second",
    )
    squares_per_number: float = threshold(
        2.0,
        unit="variances of the noise",
        meaning="descriptions are ordered by what they explain less so much for each of their numbers",
        reason="Akaike: twice what a number explains of pure noise",
    )
    screened_rows: int = threshold(
        1500,
        unit="rows",
        meaning="on about so many rows, evenly spread, descriptions are ordered",
        reason="a choice: which are promising shows on few",
    )
    min_direction_share: float = threshold(
        0.03,
        unit="share of a description's squares",
        meaning="a direction in which it explains less is left out of the proposed formulas",
        reason="a choice: it would be a formula for noise",
    )
