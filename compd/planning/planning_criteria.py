"""The thresholds of a planned measurement."""

from __future__ import annotations

from dataclasses import dataclass

from compd.threshold import threshold


@dataclass(frozen=True)
class PlanningCriteria:
    """Which rows are worth proposing to be measured next."""

    min_separation: float = threshold(
        3.0,
        unit="standard deviations of the noise",
        meaning="by so much two effects have to differ for rows to tell them apart",
        reason="at three the wrong one fits better in 7 of 100 measurements, Phi(-3/2) for Gaussian noise",
    )
    min_gain: float = threshold(
        1.0,
        unit="standard deviations of the noise",
        meaning="by so much the rows have to add to the difference on what was measured",
        reason="the noise itself moves the difference by one",
    )
    rows: int = threshold(
        12,
        unit="rows",
        meaning="a diagnosis proposes so many of itself",
        reason="a choice: half an hour of work; `compd plan` gives as many as are wanted",
    )
    expected_share: float = threshold(
        0.5,
        unit="share of the largest plausible size",
        meaning="so large an effect that cannot be tested yet is expected to be",
        reason="a choice: the middle of its range",
    )
