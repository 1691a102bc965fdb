"""The numbers that make a probability of the held-out scores."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ProbabilityCriteria:
    """From the expected number N of better sets to the probability p that the named set is right::

        log(p / (1 - p)) = certain - per_better log((N + unseen) / unseen) - per_told log M - above_noise a

    M is the number of sets that the verdict tells as possible, with its rivals; a is 1 where a part of the error above
    the noise has neither name nor description, else 0.
    """

    certain: float = 3.5
    """logarithm of odds | where no other set that was seen may be better, and only noise is left | fitted to simulated
    cases by `python -m tests.scoreboard.calibrate_probability`; decision 16 has the trial"""
    per_better: float = 0.42
    """logarithm of odds | what each factor e of N + unseen takes off | fitted to simulated cases by `python -m
    tests.scoreboard.calibrate_probability`; decision 16 has the trial"""
    per_told: float = 1.1
    """logarithm of odds | what each factor e of the number of sets takes off that rivals make | fitted to simulated
    cases by `python -m tests.scoreboard.calibrate_probability`; decision 16 has the trial"""
    above_noise: float = 0.9
    """logarithm of odds | what an error above the noise takes off that nothing describes | fitted to simulated cases by
    `python -m tests.scoreboard.calibrate_probability`; decision 16 has the trial"""
    unseen: float = 0.01
    """sets | so many that were never seen may be better | a choice: a number of better sets below it counts as none"""
    max_compared: int = 40
    """sets | so many that name something else, the best first, are compared with the named one | a choice: it bounds
    the time; those that may be better are among the first"""
    constant_share: float = 0.94
    """share of the squares of what an effect may do | an effect of which the constant makes as much is one with all
    others of which it does | a choice: a quarter of the error that it makes is not the constant's (root of 0.06)"""
    identified_from: float = 0.7
    """probability | a set that is less probable is called likely, not identified | a choice: of verdicts with so small
    a probability three of ten or more are wrong"""
