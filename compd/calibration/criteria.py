"""The thresholds of a calibration: what is taken, claimed, warned of, and told of another day."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CalibrationCriteria:
    """Every number that decides what a calibration says; the same for all calibrations."""

    told_share: float = 0.5
    """1 | a number is claimed if its standard error after the poses is at most this share of that before | a tolerance
    that is wrong by a factor of two moves such a number by less than its standard error"""
    held_share: float = 0.7
    """1 | a combination of numbers is listed as held from this share of its standard error before on | half of its
    variance is left"""
    least_fall: float = 0.02
    """1 | a block is needed if the logarithms of the two held-out mean squares rise by more without it, in sum | half a
    percent of the error in each; a block of no use moves the errors of some hundred values by less"""
    most_times: float = 3.0
    """1 | a block is refused that changes the tip so many times as much away from the poses as at them | a choice: an
    error of the block then spoils other poses more than its benefit here"""
    thin_share: float = 0.05
    """1 | a direction in which the poses spread by less than this share of the widest is not varied | a choice:
    held-out regions along it would be neighbours of those that stay"""
    farthest_turn: float = 0.15
    """rad | away from poses without turns, the prediction is looked at with a turn of no more than this | a choice: 9
    deg, which joints of most machines allow"""
    off: float = 0.75
    """1 | probability before the poses that a block is off which the drawing states with a tolerance | a choice: parts
    differ from a drawing, but rarely in all of its kinds of numbers"""
    off_undrawn: float = 0.25
    """1 | the same of a block that no drawing states | a choice: the odds of the other, turned over"""
    likely_share: float = 0.01
    """1 | sets of blocks below this share of the likeliest one's probability are left out of the result | a choice: a
    block that the poses show as drawn stays exactly as drawn"""
    seen_before: float = 2.0
    """numbers | a block's factor of its tolerance is found as if so many numbers at it had been seen before | a choice:
    the tolerance counts little beside six joints"""
    largest_scale: float = 100.0
    """1 | a block's factor of the tolerance is no larger | a tolerance is wrong by a hundred at most; numbers that
    stand for what was left out grow for ever"""
    contradicts: float = 0.99
    """1 | what is left takes the place of the declared noise where it contradicts it with this confidence | one
    recording in a hundred that is as noisy as declared is weighed by its own scatter"""
    gross_chance: float = 0.001
    """1 | probability that a recording with normal noise has a pose that is left out as gross | a good pose in a
    thousand recordings is lost; for 40 poses the limit is near five standard deviations"""
    gross_share: float = 0.2
    """1 | share of the poses that may be gross | a choice: where more poses disagree, the machine has something that
    its numbers lack"""
    much_left: float = 3.0
    """1 | a warning is given from so many times the declared noise on | a choice: nine tenths of the variance then have
    another cause"""
    left_over: float = 2.0
    """1 | variance of held-out errors over that of the noise from which on a diagnosis is to go on | half of it has a
    cause"""
    check_confidence: float = 0.999
    """1 | another day's misfit, and a change of a number among all numbers, are told with this confidence | two false
    alarms in a thousand checks at most"""
