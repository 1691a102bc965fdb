"""The thresholds of a planned measurement."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PlanningCriteria:
    """Which rows are worth proposing to be measured next."""

    min_separation: float = 3.0
    """standard deviations of the noise | by so much two effects have to differ for rows to tell them apart | at three
    the wrong one fits better in 7 of 100 measurements, Phi(-3/2) for Gaussian noise"""
    min_gain: float = 1.0
    """standard deviations of the noise | by so much the rows have to add to the difference on what was measured | the
    noise itself moves the difference by one"""
    rows: int = 12
    """rows | a diagnosis proposes so many of itself | a choice: half an hour of work; `compd plan` gives as many as are
    wanted"""
    expected_share: float = 0.5
    """share of the largest plausible size | so large an effect that cannot be tested yet is expected to be | a choice:
    the middle of its range"""
