"""The thresholds of a calibration: what is taken, claimed, warned of, and told of another day."""

from __future__ import annotations

from dataclasses import dataclass

from compd.threshold import threshold


@dataclass(frozen=True)
class CalibrationCriteria:
    """Every number that decides what a calibration says; the same for all calibrations."""

    told_share: float = threshold(
        0.5,
        unit="1",
        meaning="a number is claimed if its standard error after the poses is at most this share of that before",
        reason="a tolerance that is wrong by a factor of two moves such a number by less than its standard error",
    )
    held_share: float = threshold(
        0.7,
        unit="1",
        meaning="a combination of numbers is listed as held from this share of its standard error before on",
        reason="half of its variance is left",
    )
    least_fall: float = threshold(
        0.02,
        unit="1",
        meaning="a block is needed if the logarithms of the two held-out mean squares rise by more without it, in sum",
        reason="half a percent of the error in each; a block of no use moves the errors of some hundred values by less",
    )
    most_times: float = threshold(
        3.0,
        unit="1",
        meaning="a block is refused that changes the tip so many times as much away from the poses as at them",
        reason="a choice: an error of the block then spoils other poses more than its benefit here",
    )
    thin_share: float = threshold(
        0.05,
        unit="1",
        meaning="a direction in which the poses spread by less than this share of the widest is not varied",
        reason="a choice: held-out regions along it would be neighbours of those that stay",
    )
    farthest_turn: float = threshold(
        0.15,
        unit="rad",
        meaning="away from poses without turns, the prediction is looked at with a turn of no more than this",
        reason="a choice: 9 deg, which joints of most machines allow",
    )
    off: float = threshold(
        0.75,
        unit="1",
        meaning="probability before the poses that a block is off which the drawing states with a tolerance",
        reason="a choice: parts differ from a drawing, but rarely in all of its kinds of numbers",
    )
    off_undrawn: float = threshold(
        0.25,
        unit="1",
        meaning="the same of a block that no drawing states",
        reason="a choice: the odds of the other, turned over",
    )
    likely_share: float = threshold(
        0.01,
        unit="1",
        meaning="sets of blocks below this share of the likeliest one's probability are left out of the result",
        reason="a choice: a block that the poses show as drawn stays exactly as drawn",
    )
    seen_before: float = threshold(
        2.0,
        unit="numbers",
        meaning="a block's factor of its tolerance is found as if so many numbers at it had been seen before",
        reason="a choice: the tolerance counts little beside six joints",
    )
    largest_scale: float = threshold(
        100.0,
        unit="1",
        meaning="a block's factor of the tolerance is no larger",
        reason="a tolerance is wrong by a hundred at most; numbers that stand for what was left out grow for ever",
    )
    contradicts: float = threshold(
        0.99,
        unit="1",
        meaning="what is left takes the place of the declared noise where it contradicts it with this confidence",
        reason="one recording in a hundred that is as noisy as declared is weighed by its own scatter",
    )
    gross_chance: float = threshold(
        0.001,
        unit="1",
        meaning="probability that a recording with normal noise has a pose that is left out as gross",
        reason="a good pose in a thousand recordings is lost; for 40 poses the limit is near five standard deviations",
    )
    gross_share: float = threshold(
        0.2,
        unit="1",
        meaning="share of the poses that may be gross",
        reason="a choice: where more poses disagree, the machine has something that its numbers lack",
    )
    much_left: float = threshold(
        3.0,
        unit="1",
        meaning="a warning is given from so many times the declared noise on",
        reason="a choice: nine tenths of the variance then have another cause",
    )
    left_over: float = threshold(
        2.0,
        unit="1",
        meaning="variance of held-out errors over that of the noise from which on a diagnosis is to go on",
        reason="half of it has a cause",
    )
    check_confidence: float = threshold(
        0.999,
        unit="1",
        meaning="another day's misfit, and a change of a number among all numbers, are told with this confidence",
        reason="two false alarms in a thousand checks at most",
    )
