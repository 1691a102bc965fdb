"""Thresholds on which the result of a comparison rests, each with its meaning, its unit and its reason."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


def threshold(value: float, *, unit: str, meaning: str, reason: str) -> Any:
    """A field of a frozen dataclass of thresholds; unit, meaning and reason are its metadata, "1" is no unit."""
    return field(default=value, metadata={"unit": unit, "meaning": meaning, "reason": reason})


@dataclass(frozen=True)
class ComparisonCriteria:
    """Thresholds of a comparison: what counts as an outlier, as the noise floor, and as a trend of the residual.

    Each field's metadata hold `unit`, `meaning` and `reason`::

        for criterion in dataclasses.fields(ComparisonCriteria):
            print(criterion.name, criterion.default, criterion.metadata["unit"], criterion.metadata["reason"])
    """

    outlier_sigmas: float = threshold(
        5.0,
        unit="robust standard deviations",
        meaning="a row with a coordinate farther from the median is an outlier and left out, unless another row of "
        "its visit lies within sqrt(2) times as many standard deviations of the repeats",
        reason="a normal error is as large once in two million: in no recording by chance",
    )
    fewest_pairs: int = threshold(
        8,
        unit="pairs of rows",
        meaning="fewer pairs of repeats do not say what noise is",
        reason="a choice: eight independent pairs know the noise within a quarter",
    )
    declared_dof: float = threshold(
        200.0,
        unit="degrees of freedom",
        meaning="a declared uncertainty weighs as much as so many repeats",
        reason="GUM, G.4.2: 1 / (2 x 0.05^2), a declaration being taken to be right within 5 %",
    )
    contradiction_p_value: float = threshold(
        0.001,
        unit="probability",
        meaning="repeats and a declaration that differ with a smaller p-value (F test, two-sided) contradict each "
        "other, and the repeats alone count",
        reason="a choice: a hundred repeats then overrule a declaration that is wrong by a fifth",
    )
    declared_ratio: float = threshold(
        2.0,
        unit="1",
        meaning="repeats that contradict a declaration and scatter by more than so many times as much, or as little, "
        "get a remark",
        reason="a choice: less is a cautious or an optimistic declaration, more is a fault of the instrument, of the "
        "unit or of the column `visit`",
    )
    at_floor_confidence: float = threshold(
        0.975,
        unit="probability",
        meaning="quantile of the F distribution up to which a floor ratio is at the floor",
        reason="the customary 95 % interval, of which only the upper end matters",
    )
    fewest_rows: int = threshold(
        5,
        unit="rows",
        meaning="fewer rows are not compared",
        reason="a choice: with fewer, neither a median nor a quantile says anything",
    )
    most_gauge_share: float = threshold(
        1.5,
        unit="scatter of the residual within visits",
        meaning="where the gauges' scatter within visits, seen at the tip, is larger, the machine moved within visits "
        "and the gauges' noise is taken from their last digits alone",
        reason="noise of the gauges is a part of the residual's scatter; half as much again allows for few repeats",
    )
    trend_share: float = threshold(
        0.05,
        unit="share of a coordinate's mean square",
        meaning="a trend that explains less is not reported",
        reason="a choice: less would not change what a person does next",
    )
    trend_p_value: float = threshold(
        0.01,
        unit="probability",
        meaning="a trend with a larger p-value, after Bonferroni's correction for all looks, is not reported",
        reason="a choice: one comparison in a hundred reports a trend of pure noise. Stricter than the search for what "
        "a residual follows, because nothing is tried on left-out rows here",
    )
    quiet_floor_ratio: float = threshold(
        1.2,
        unit="squares of the noise floor",
        meaning="a coordinate with a smaller mean square has no trends",
        reason="600 values give 1.0 +- 0.06 by noise alone; the floor itself is known within some per cent",
    )
    collinear_correlation: float = threshold(
        0.95,
        unit="correlation",
        meaning="covariates correlated more with the one that is named are named along",
        reason="a choice: a tenth of the variance (1 - 0.95^2) is too little to tell them apart by a first look",
    )
    location_ratio: float = threshold(
        1.4,
        unit="1",
        meaning="one end of the workspace is named where the error there is so many times that at the other end",
        reason="a choice: twice the mean square",
    )
