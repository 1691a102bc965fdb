"""Every threshold on which the verdict of a diagnosis rests, each with its meaning, its unit and its reason."""

from __future__ import annotations

from dataclasses import dataclass, field

from compd.comparison.criteria import ComparisonCriteria, threshold

_FLOOR = "squares of the noise floor"


@dataclass(frozen=True)
class Criteria:
    """Thresholds of a verdict, handed from `diagnose` to whatever decides by them.

    Losses are mean squares per measured value divided by the variance of the noise, so that 1.0 is the noise floor
    and a difference of losses is in squares of the noise floor. Each field's metadata hold `unit`, `meaning` and
    `reason`; a reason that begins with "a choice" has no derivation.

    A stricter diagnosis, for example::

        diagnose(aligned, (), None, effects, criteria=Criteria(p_value=0.01, least_gain=0.5))
    """

    # What an effect has to explain
    least_gain: float = threshold(
        0.2,
        unit=_FLOOR,
        meaning="by how much a named effect must at least lower the cross-validated loss",
        reason="an error of 0.45 of the floor is not worth a name; the disturbances that a machine always has, a fifth "
        "of the floor (0.04) each, may add up to as much",
    )
    form_error: float = threshold(
        0.005,
        unit="share of the explained mean square",
        meaning="what an effect of nearly the right form may leave of what it explains; an effect must gain more, and "
        "a residual is at the floor within it",
        reason="no effect's form is true to better than some per cent of its size: 7 % of the size is 0.5 % of the "
        "square",
    )
    gain_per_parameter: float = threshold(
        0.005,
        unit=_FLOOR,
        meaning="for each parameter that is saved a simpler explanation may leave so much more",
        reason="a choice: 600 values give 1/600 = 0.002 per parameter by noise alone, and a flexible effect also "
        "describes a part of the machine's disturbances",
    )
    description_factor: float = threshold(
        2.5,
        unit="1",
        meaning="an empirical term must gain so many times what an effect of the library must",
        reason="a choice: a description fits anything a little, and with a searched constant it does two things at "
        "once",
    )
    contradiction_factor: float = threshold(
        1.5,
        unit="1",
        meaning="an effect that contradicts what the sidecar declares must gain so many times what another must",
        reason="a choice: a declaration is evidence, but people err",
    )
    most_at_floor: float = threshold(
        1.25,
        unit=_FLOOR,
        meaning="up to this loss nothing worth a name is left",
        reason="chance, as the floor is known within 5 % and 600 rows give 3 %, and two disturbances of a fifth of the "
        "floor (0.08)",
    )
    most_unexplained: float = threshold(
        0.2,
        unit="share of the mean square above the floor",
        meaning="effects that leave more, where nothing that was measured describes the rest, are not named",
        reason="a choice: what leaves a fifth resembles the cause rather than being it",
    )
    least_removed: float = threshold(
        0.6,
        unit="share of the mean square above the floor",
        meaning="what each member of a set of effects must take away of the loss without it",
        reason="a choice: the rest of an effect of a wrong form is taken away piece by piece by flexible effects, a "
        "cause that is really there takes away most of it",
    )

    # What a fitted parameter may be
    range_sigmas: float = threshold(
        3.0,
        unit="standard errors",
        meaning="a parameter farther outside its plausible range is implausible",
        reason="by noise alone once in 370 parameters (normal distribution, two-sided)",
    )
    range_slack: float = threshold(
        0.1,
        unit="width of the plausible range",
        meaning="nor is a parameter implausible that is outside by less, unless the range ends at zero there",
        reason="a choice: ranges are from handbooks and round; beyond zero is the wrong sign",
    )

    # Which candidates these rows can test
    most_empty: float = threshold(
        0.1,
        unit="share of the rows",
        meaning="an effect or covariate that is not known in more rows is not tried",
        reason="a choice: only rows in which every candidate is known are used, so that it would cost all others those "
        "rows",
    )
    least_motion_um: float = threshold(
        1e-3,
        unit="um",
        meaning="an effect that moves no row by more at the end of its plausible range does nothing on these rows",
        reason="a nanometre is below every reference that this is made for",
    )
    searched_constant_parameters: int = threshold(
        2,
        unit="parameters",
        meaning="what the search for a nonlinear constant counts for",
        reason="the best of ten values fits noise about as two parameters do (log 10 = 2.3)",
    )
    choice_parameters: int = threshold(
        1,
        unit="parameters",
        meaning="what the choice between two values of a constant counts for",
        reason="the better of two values fits noise about as one parameter does (log 2 = 0.7)",
    )

    # How rows are left out
    fewest_sessions: int = threshold(
        3,
        unit="sessions",
        meaning="with fewer sessions blocks of time are left out in their place",
        reason="of two, one would have to predict the other: too little weather to learn from",
    )
    sectors: int = threshold(
        5,
        unit="sectors",
        meaning="into how many sectors about the vertical the workspace is divided",
        reason="a choice, as is usual in cross-validation: a fifth left out leaves four fifths to learn from",
    )
    most_in_one_fold: float = threshold(
        0.9,
        unit="share of a candidate's sum of squares",
        meaning="a split in which one fold holds more of what a candidate does cannot test it",
        reason="a choice: what is left in the other folds determines no parameter",
    )

    # Which effects these rows cannot tell apart
    rival_sigmas: float = threshold(
        2.0,
        unit="standard errors of the difference",
        meaning="losses that differ by less are the same: the other effect is a rival",
        reason="the customary 95 %",
    )
    rival_loss: float = threshold(
        0.1,
        unit=_FLOOR,
        meaning="nor do losses differ that lie closer than this",
        reason="two disturbances of a fifth of the floor on either side (0.08), and the form of an effect",
    )
    rival_share: float = threshold(
        0.3,
        unit="share of what the effect in its place explains",
        meaning="a candidate that misses more is no rival, whatever the errors",
        reason="a choice: rows that can tell so much can decide",
    )
    simpler_sigmas: float = threshold(
        1.0,
        unit="standard errors of the difference",
        meaning="within this an effect with fewer parameters is preferred",
        reason="the one-standard-error rule: Breiman, Friedman, Olshen, Stone, Classification and Regression Trees "
        "(1984), 3.4.3",
    )

    # What a residual without a cause follows
    p_value: float = threshold(
        0.05,
        unit="probability",
        meaning="an empirical term with a larger p-value, corrected for all that were tried, is not reported",
        reason="the customary level; it comes on top of a gain on left-out rows, hence less strict than that of trends",
    )
    term_share: float = threshold(
        0.01,
        unit="share of the mean square above the floor",
        meaning="what each parameter of a term must explain when covariates are compared",
        reason="a choice: a curve fits a line's noise a little better, and that of a covariate which only goes along",
    )
    form_share: float = threshold(
        0.002,
        unit="share of the mean square above the floor",
        meaning="what each parameter of a term must explain when forms of one covariate are compared",
        reason="a choice: less than between covariates, as none can go along with itself",
    )
    pair_share: float = threshold(
        0.5,
        unit="share of the mean square above the floor",
        meaning="what a second covariate must take away of what the best one leaves",
        reason="a choice: two covariates are reported where one alone misses half",
    )
    direction_share: float = threshold(
        0.03,
        unit="share of the explained mean square",
        meaning="a direction in which a term explains less is left out of the proposed formulas",
        reason="a choice: it would be a formula for noise",
    )

    # What acts without a name
    disturbance: float = threshold(
        0.2,
        unit="standard deviations of the noise, rms per coordinate",
        meaning="size of each unnamed disturbance in the standard errors of parameters",
        reason="a choice: what remains of causes too small to be found (`least_gain` is the square of 0.45)",
    )
    disturbances: int = threshold(
        2,
        unit="disturbances",
        meaning="how many unnamed disturbances act at once",
        reason="a choice",
    )

    comparison: ComparisonCriteria = field(
        default_factory=ComparisonCriteria,
        metadata={
            "unit": "1",
            "meaning": "thresholds of the comparisons that a diagnosis rests on",
            "reason": "the noise floor and the outliers are the comparison's",
        },
    )
