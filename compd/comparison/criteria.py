"""The numbers on which the result of a comparison rests, each with its meaning, its unit and its reason.

`compd.diagnosis.criteria` states which numbers are criteria and which are not.
"""

from __future__ import annotations

from dataclasses import dataclass

from compd.statistics import PeriodCriteria


@dataclass(frozen=True)
class SpeedCriteria:
    """From which rows the speed of a gauge is known, where it was not recorded."""

    near_s: float = 3.0
    """s | rows farther apart tell nothing of each other's speed | a choice: between two dwells lies a whole move"""
    close_s: float = 0.25
    """s | rows so close follow any motion of a machine | a choice: a machine takes a few tenths of a second to reach
    its speed"""
    still_mm_per_s: float = 0.005
    """mm/s | slower is standing still | a gauge of 50 ms latency would be 0.25 um late"""
    steady_share: float = 0.1
    """share of the larger speed | speeds before and after a row that differ by less are one steady speed | a choice"""


@dataclass(frozen=True)
class ComparisonCriteria:
    """Thresholds of a comparison: what counts as an outlier, as the noise floor, and as a trend of the residual.

    They travel with the recording (`AlignedRecording.criteria`). Each has a unit, a meaning and a
    reason::

        for name, criterion in thresholds(ComparisonCriteria).items():
            print(name, criterion.default, criterion.unit, criterion.reason)
    """

    outlier_sigmas: float = 5.0
    """robust standard deviations | a row with a coordinate farther from the median is an outlier and left out, unless
    another row of its visit lies within sqrt(2) times as many standard deviations of the repeats | a normal error is as
    large once in two million: in no recording by chance"""
    lone_ratio: float = 6.0
    """1 | a visit is an outlier as a whole, whatever its repeats say, where it lies so many times as far off as the
    next, and nothing that was recorded is different there | a choice: of twenty visits under one cause the largest is
    seldom twice the next, and what is thirty standard deviations off is worth a look in any case"""
    max_lone_share: float = 0.1
    """share of the visits | more visits that lie far off together are something to be explained | a choice: one mistake
    in ten visits is a careless measurement, more is a cause"""
    outside_share: float = 0.1
    """share of the range of all other rows | a visit with a place or a quantity so far beyond all others is not an
    outlier as a whole | a choice: what happens in a single visit under load, or in a corner, is to be explained"""
    slope_share: float = 0.05
    """share of the slope | a column of the reference seems to be in another unit where its slope against the model
    differs from that unit's by less | a choice: a model that is wrong by more is looked at for other reasons"""
    most_beside_slope: float = 0.1
    """share of a coordinate's median distance from its middle | a coordinate that leaves more beside a line against the
    model has no slope | a choice: what a reversed sign or another unit leaves is the error of the machine"""
    min_slope_rows: int = 8
    """rows | fewer rows have no slope | a choice: a line through fewer is chance"""
    min_slope_spread: float = 0.05
    """share of the largest singular value | points nearer to a plane tell no mirror image | a choice: in a plane half a
    turn mirrors"""
    fewest_visits: int = 10
    """visits | of fewer none is an outlier as a whole | a choice: with fewer, one may be the only one under a condition
    that nobody recorded"""
    disagreement_sigmas: float = 15.0
    """standard deviations of the difference of two repeats | repeats of a visit that differ by more are told, where few
    visits do | a choice: the largest of a thousand normal differences is four, of a heavy-tailed one eight"""
    fewest_pairs: int = 8
    """pairs of rows | fewer pairs of repeats do not say what noise is | a choice: eight independent pairs know the
    noise within a quarter"""
    min_target_motion: float = 0.02
    """mm per mm | the place of an instrument's target on the platform is fitted along directions in which it moves the
    measured coordinates by more, rms, otherwise than the instrument's frame does | a choice: attitudes that vary by a
    degree; a target mounted 1 mm elsewhere then shows as 20 um"""
    declared_dof: float = 200.0
    """degrees of freedom | a declared uncertainty weighs as much as so many repeats | GUM, G.4.2: 1 / (2 x 0.05^2), a
    declaration being taken to be right within 5 %"""
    contradiction_p_value: float = 0.001
    """probability | repeats and a declaration that differ with a smaller p-value (F test, two-sided) contradict each
    other, and the repeats alone count | a choice: a hundred repeats then overrule a declaration that is wrong by a
    fifth"""
    declared_ratio: float = 2.0
    """1 | repeats that contradict a declaration and scatter by more than so many times as much, or as little, get a
    remark | a choice: less is a cautious or an optimistic declaration, more is a fault of the instrument, of the unit
    or of the column `visit`"""
    at_floor_confidence: float = 0.975
    """probability | quantile of the F distribution up to which a floor ratio is at the floor | the customary 95 %
    interval, of which only the upper end matters"""
    fewest_rows: int = 5
    """rows | fewer rows are not compared | a choice: with fewer, neither a median nor a quantile says anything"""
    most_gauge_share: float = 1.5
    """scatter of the residual within visits | where the gauges' scatter within visits, seen at the tip, is larger, the
    machine moved within visits and the gauges' noise is taken from their last digits alone | noise of the gauges is a
    part of the residual's scatter; half as much again allows for few repeats"""
    trend_share: float = 0.05
    """share of a coordinate's mean square | a trend that explains less is not reported | a choice: less would not
    change what a person does next"""
    trend_p_value: float = 0.01
    """probability | a trend with a larger p-value, after Bonferroni's correction for all looks, is not reported | a
    choice: one comparison in a hundred reports a trend of pure noise. Stricter than the search for what a residual
    follows, because nothing is tried on left-out rows here"""
    white_share: float = 0.1
    """share of a coordinate's scatter | a residual of which no more follows the order of time, of a place or of a
    quantity is taken for white | two disturbances of a fifth of the noise are 0.07 of the whole"""
    neighbours_share: float = 0.5
    """share of a coordinate's scatter | where more of what is left follows an order, or neighbouring rows differ more
    than others by `white_share`, the scatter of neighbouring rows is not set against a smaller declaration | a choice:
    most of what is left is the same in any order"""
    quiet_floor_ratio: float = 1.2
    """squares of the noise floor | a coordinate with a smaller mean square has no trends | 600 values give 1.0 +- 0.06
    by noise alone; the floor itself is known within some per cent"""
    collinear_correlation: float = 0.95
    """correlation | covariates correlated more with the one that is named are named along | a choice: a tenth of the
    variance (1 - 0.95^2) is too little to tell them apart by a first look"""
    location_ratio: float = 1.4
    """1 | one end of the workspace is named where the error there is so many times that at the other end | a choice:
    twice the mean square"""
    huber_sigmas: float = 2.5
    """robust standard deviations | in a fit a row farther off counts less, by the inverse of its distance | Huber,
    Robust Statistics (1981), chapter 7: 1.345 is 95 % efficient on normal noise; at 2.5 nearly nothing of the noise is
    held back, only what lies between noise and outliers"""
    blocks: int = 24
    """blocks of neighbouring rows | fewer sessions are cut into so many blocks, on which standard errors and p-values
    rest | enough for 15 % on a standard error, and long enough for temperatures to change in between"""
    max_rows_of_visit: int = 12
    """rows | of a longer visit so many rows, evenly spread, are compared in pairs | 66 pairs know the scatter of a
    visit; a point that was watched for an hour would have millions"""
    max_filled_share: float = 0.1
    """share of the rows | up to so many empty cells of a quantity are filled with the nearest row's value, so that it
    can be followed; no effect is computed from them | a choice: beyond it too little of what a residual follows would
    be measured"""
    sample_rows: int = 20_000
    """rows | so many rows of a recording that is too long for the memory are compared | they know a standard deviation
    within 0.5 %, and a comparison of them takes 0.2 GB"""
    trends_per_coordinate: int = 2
    """trends | so many trends of each coordinate are reported at most | a choice: more are noise in a report"""
    max_collinear: int = 4
    """covariates | so many collinear covariates are named along with a trend at most | a choice: more are noise in a
    report"""
    max_trend_rows: int = 10_000
    """rows | so many rows, evenly spread, are searched for trends at most | more rows would not change what the
    sentences say"""
    min_trend_rows: int = 10
    """rows | fewer rows that have a covariate show no trend | a choice: a line through fewer rows says nothing"""
    min_rows_of_ends: int = 30
    """rows | with fewer rows the ends of the workspace are not compared | a choice: ten rows in each third"""
    periods: PeriodCriteria = PeriodCriteria()
    speeds: SpeedCriteria = SpeedCriteria()
