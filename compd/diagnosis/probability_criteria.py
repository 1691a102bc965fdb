"""The numbers that make a probability of the held-out scores."""

from __future__ import annotations

from dataclasses import dataclass

from compd.threshold import threshold

_FITTED = "fitted to simulated cases by `python -m tests.scoreboard.calibrate_probability`; decision 16 has the trial"


@dataclass(frozen=True)
class ProbabilityCriteria:
    """From the expected number N of better sets to the probability p that the named set is right::

        log(p / (1 - p)) = certain - per_better log((N + unseen) / unseen) - per_told log M - above_noise a

    M is the number of sets that the verdict tells as possible, with its rivals; a is 1 where a part of the error above
    the noise has neither name nor description, else 0.
    """

    certain: float = threshold(
        3.5,
        unit="logarithm of odds",
        meaning="where no other set that was seen may be better, and only noise is left",
        reason=_FITTED,
    )
    per_better: float = threshold(
        0.42,
        unit="logarithm of odds",
        meaning="what each factor e of N + unseen takes off",
        reason=_FITTED,
    )
    per_told: float = threshold(
        1.1,
        unit="logarithm of odds",
        meaning="what each factor e of the number of sets takes off that rivals make",
        reason=_FITTED,
    )
    above_noise: float = threshold(
        0.9,
        unit="logarithm of odds",
        meaning="what an error above the noise takes off that nothing describes",
        reason=_FITTED,
    )
    unseen: float = threshold(
        0.01,
        unit="sets",
        meaning="so many that were never seen may be better",
        reason="a choice: a number of better sets below it counts as none",
    )
    max_compared: int = threshold(
        40,
        unit="sets",
        meaning="so many that name something else, the best first, are compared with the named one",
        reason="a choice: it bounds the time; those that may be better are among the first",
    )
    constant_share: float = threshold(
        0.94,
        unit="share of the squares of what an effect may do",
        meaning="an effect of which the constant makes as much is one with all others of which it does",
        reason="a choice: a quarter of the error that it makes is not the constant's (root of 0.06)",
    )
    identified_from: float = threshold(
        0.7,
        unit="probability",
        meaning="a set that is less probable is called likely, not identified",
        reason="a choice: of verdicts with so small a probability three of ten or more are wrong",
    )
