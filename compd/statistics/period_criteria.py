"""The thresholds of the search for periods."""

from __future__ import annotations

from dataclasses import dataclass

from compd.threshold import threshold


@dataclass(frozen=True)
class PeriodCriteria:
    """The search for the period of an effect in a residual."""

    peaks: int = threshold(
        5,
        unit="periods",
        meaning="so many of the strongest periods of a residual are tried with an effect's own columns",
        reason="a choice: more would be chance",
    )
    trials: int = threshold(
        3,
        unit="values",
        meaning="so many of the tried values of an effect's constants, the best ones, become candidates",
        reason="a choice: the period, its double, and one more peak",
    )
    min_rows: int = threshold(
        12,
        unit="rows",
        meaning="in fewer rows no period is looked for",
        reason="a choice: a sine beside a parabola has five numbers and its period, and twice as many rows test them",
    )
    min_turns: float = threshold(
        2.0,
        unit="turns",
        meaning="a period must fit so many times into the range of its quantity to be found in a residual",
        reason="a choice: over less, a sine is hardly told from what is slow along the quantity",
    )
    max_turns: float = threshold(
        5000.0,
        unit="turns",
        meaning="and not more often",
        reason="a choice: it bounds the search; 5000 turns are a pitch of 0.1 mm on 500 mm",
    )
    neighbour_turns: float = threshold(
        0.25,
        unit="turns over the range of the quantity",
        meaning="periods that differ by so much are neighbours, between which a period is refined; and the rows must "
        "cover a turn but for so much of it, or the effect cannot be tested",
        reason="at a quarter of a turn a period fits half as well at best",
    )
    slow_degree: int = threshold(
        2,
        unit="degree of a polynomial",
        meaning="what is slow along the quantity is taken away before periods are looked for",
        reason="a choice: a slope and a bend are another cause's",
    )
    outlier_sigmas: float = threshold(
        4.0,
        unit="robust standard deviations",
        meaning="a value farther out counts as one there: it would be noise at every frequency",
        reason="a normal error is as large once in 16,000",
    )
    image_window: float = threshold(
        0.9,
        unit="spectral window, rms over the series",
        meaning="from here on frequencies are images of one another, and those above half of it are not searched",
        reason="a choice: 0.81 of the square of a sine shows at its image",
    )
    image_multiples: int = threshold(
        5,
        unit="multiples",
        meaning="so many multiples of an image's frequency must be images, too, for an even grid of values",
        reason="a choice: images of a few sessions, far apart, fade before",
    )
    chance: float = threshold(
        0.01,
        unit="probability",
        meaning="by less chance than this a searched period may contradict the period of the machine's description",
        reason="a choice: the description is right in most cases",
    )
