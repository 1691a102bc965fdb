"""Trends: what each coordinate of a residual follows, in words with numbers, and where it is largest.

For every coordinate y and covariate x a straight line y - mean(y) = b (x - mean(x)) is fitted by least squares. The t
statistic b / std(b) has the cluster-robust standard error of `cluster_std` (neighbouring rows are not independent) and
Student's t distribution with one degree of freedom less than there are blocks. Its two-sided p-value times the number
of tests (coordinates times covariates; Bonferroni) is the trend's p-value. Per coordinate the covariate that explains
most is taken first, its line is subtracted, and the rest is searched once more (forward selection). A first look at
straight lines only: proof is the task of a diagnosis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import betainc

from compd.arrays import BoolArray, FloatArray, IntArray, rms
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.covariate import Covariate, covariates
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.neighbour_block import neighbour_blocks
from compd.comparison.noise_floor import NoiseFloor
from compd.display_unit import format_error
from compd.statistics import cluster_std, filled

ENDS = {
    "x": ("towards -x", "towards +x"),
    "y": ("towards -y", "towards +y"),
    "z": ("at the bottom of the workspace", "at the top of the workspace"),
    "time": ("at the start", "at the end"),
}


@dataclass(frozen=True)
class Trend:
    """One thing that one coordinate of the residual follows.

    coordinate : "x" or "link 2".
    covariate : what it follows; None for a constant offset.  unit : the covariate's.
    slope : um per unit; of a direction, the jump in um; of an offset, um.  residual_unit : in place of um.
    explained : share of the coordinate's variation, 0 to 1 (R^2; of an offset, of its mean square).
    p_value : probability of so strong a trend by noise alone, corrected for the number of tests.
    collinear : other covariates that changed in the same way on these rows.
    largest_at : where the error is largest, "" where it is about the same everywhere.
    """

    coordinate: str
    covariate: str | None
    unit: str
    slope: float
    explained: float
    p_value: float
    collinear: tuple[str, ...] = ()
    largest_at: str = ""
    residual_unit: str = "um"

    @property
    def text(self) -> str:
        """A sentence for a person."""
        slope = ("+" if self.slope >= 0 else "") + format_error(self.slope, self.residual_unit)
        if self.covariate is None:
            sentence = f"{self.coordinate} is off by {slope} everywhere"
        elif self.covariate.startswith("direction"):
            sentence = f"{self.coordinate} error jumps by {slope} with the {self.covariate}"
        else:
            sentence = f"{self.coordinate} error follows {self.covariate}, {slope}/{self.unit}"
        if self.covariate is not None:
            sentence += f" ({100 * self.explained:.0f} % of its variation)"
        if self.collinear:
            sentence += f"; {', '.join(self.collinear)} went the same way"
        return sentence + (f", and is largest {self.largest_at}" if self.largest_at else "")

    def as_json(self) -> dict[str, Any]:
        """Numbers beside the sentence."""
        return {
            "coordinate": self.coordinate,
            "covariate": self.covariate,
            "slope_um_per_unit": self.slope,
            "unit": self.unit,
            "explained_fraction": self.explained,
            "p_adjusted": self.p_value,
            "alike": list(self.collinear),
            "largest": self.largest_at,
            "text": self.text,
        }


def find_trends(
    aligned: AlignedRecording,
    residual_um: FloatArray,
    links_um: FloatArray | None,
    used: BoolArray,
    floor: NoiseFloor,
) -> tuple[Trend, ...]:
    """The trends of all coordinates, the one that explains most (in um^2) first.

    residual_um : (N, m).  links_um : (N, n) the same as errors of link lengths, or None.  used : (N,) rows that count.
    A coordinate at the noise floor has none. A link is named only for what it shows more clearly than the tip does.
    """
    criteria = aligned.criteria
    used = _thinned(used, criteria.max_trend_rows)
    coordinates = [(label, residual_um[:, k], float(floor.by_axis_um[k])) for k, label in enumerate(aligned.labels)]
    if links_um is not None:
        # the floor at a link: noise at the tip, pulled back through the same Jacobian as the residual
        ratio = np.sqrt(np.mean(links_um[used] ** 2, axis=0)) / max(rms(residual_um[used][:, aligned.lengths]), 1e-12)
        coordinates += [(f"link {i + 1}", column, float(ratio[i] * floor.um)) for i, column in enumerate(links_um.T)]
    time_s = aligned.recording.time_s
    all_covariates = [
        covariate._replace(values=filled(covariate.values, time_s, criteria.max_filled_share))
        for covariate in covariates(aligned)
    ]
    block = neighbour_blocks(aligned.recording, criteria.blocks)
    tests = len(coordinates) * len(all_covariates)
    trends: list[tuple[float, Trend]] = []
    for label, values, floor_um in coordinates:
        if np.mean(values[used] ** 2) <= criteria.quiet_floor_ratio * floor_um**2:
            continue
        link = int(label.removeprefix("link ")) if label.startswith("link") else 0
        candidates = [covariate for covariate in all_covariates if not link or covariate.link in (0, link)]
        largest_at = _largest_at(aligned, values, used, aligned.unit_of(label))
        trends += _coordinate_trends(label, values, used, candidates, block, tests, largest_at, criteria)
    trends.sort(key=lambda pair: -pair[0])
    return _without_weaker_links(
        [replace(trend, residual_unit=aligned.unit_of(trend.coordinate)) for _, trend in trends]
    )


def _thinned(used: BoolArray, max_rows: int) -> BoolArray:
    """At most `max_rows` of the rows, evenly spread."""
    rows = np.flatnonzero(used)
    chosen = np.zeros_like(used)
    chosen[rows[np.linspace(0, len(rows) - 1, min(max_rows, len(rows))).astype(np.int64)]] = True
    return chosen


def _without_weaker_links(trends: list[Trend]) -> tuple[Trend, ...]:
    """The trends without those of links that follow what a coordinate of the tip follows more clearly."""
    at_tip: dict[str | None, float] = {}
    for trend in trends:
        if not trend.coordinate.startswith("link"):
            at_tip[trend.covariate] = max(trend.explained, at_tip.get(trend.covariate, 0.0))
    return tuple(
        trend
        for trend in trends
        if not trend.coordinate.startswith("link") or trend.explained > at_tip.get(trend.covariate, 0.0)
    )


def _coordinate_trends(
    label: str,
    values: FloatArray,
    used: BoolArray,
    candidates: list[Covariate],
    block: IntArray,
    tests: int,
    largest_at: str,
    criteria: ComparisonCriteria,
) -> list[tuple[float, Trend]]:
    """One coordinate's offset and trends, each with the squares (um^2) that it explains.

    values : (N,) um.  block : (N,).  tests : how many lines are tried in all.
    """
    trends: list[tuple[float, Trend]] = []
    mean, mean_square = float(values[used].mean()), float(np.mean(values[used] ** 2))
    rest = values - mean
    count = int(used.sum())
    std = cluster_std(np.ones(count), rest[used], block[used], dof=count)
    p = _p_value(mean / std, len(np.unique(block[used])), tests) if std > 0 else 1.0
    if p < criteria.trend_p_value and mean**2 > criteria.trend_share * mean_square:
        trends.append((mean**2, Trend(label, None, "", mean, mean**2 / mean_square, p)))
    total = float(np.mean(rest[used] ** 2))
    for _ in range(criteria.trends_per_coordinate):
        lines = [_fit_line(covariate, rest, used, block, criteria.min_trend_rows) for covariate in candidates]
        best = max(lines, key=lambda line: line.explained, default=None)
        left = float(np.mean(rest[used] ** 2))
        if best is None or best.explained * left < criteria.trend_share * total:
            break
        p = _p_value(best.t, best.clusters, tests)
        if p >= criteria.trend_p_value:
            break
        explained = best.explained * left / total
        covariate = best.covariate
        slope = 2 * best.slope if covariate.name.startswith("direction") else best.slope
        collinear = tuple(
            other.name
            for other in candidates
            if other is not covariate
            and _correlation(covariate, other, used, criteria.min_trend_rows) > criteria.collinear_correlation
        )[: criteria.max_collinear]
        trend = Trend(label, covariate.name, covariate.unit, slope, explained, p, collinear, largest_at)
        trends.append((explained * total, trend))
        largest_at = ""  # once per coordinate is enough
        rest = rest - best.slope * np.nan_to_num(covariate.values - np.nanmean(covariate.values[used]))
    return trends


@dataclass(frozen=True, eq=False)
class _Line:
    """A straight line through a residual: slope in um per unit, R^2, t statistic, blocks that it rests on."""

    covariate: Covariate
    slope: float = 0.0
    explained: float = 0.0
    t: float = 0.0
    clusters: int = 0


def _fit_line(covariate: Covariate, values: FloatArray, used: BoolArray, block: IntArray, min_rows: int) -> _Line:
    """The line through the used rows that have the covariate; slope 0 where it hardly changes or few rows have it."""
    rows = used & np.isfinite(covariate.values)
    if rows.sum() < min_rows:
        return _Line(covariate)
    x = covariate.values[rows] - covariate.values[rows].mean()
    y = values[rows] - values[rows].mean()
    squares = float(x @ x)
    spread = float(np.sqrt(squares / len(x)))
    if spread < 1e-9 * max(1.0, float(np.abs(covariate.values[rows]).max())):
        return _Line(covariate)
    slope = float(x @ y) / squares
    residual = y - slope * x
    explained = 1.0 - float(residual @ residual) / max(float(y @ y), 1e-300)
    std = cluster_std(x, residual, block[rows], dof=max(len(x) - 2, 1))
    t = slope / std if std > 0 else np.inf
    return _Line(covariate, slope, explained, t, len(np.unique(block[rows])))


def _p_value(t: float, clusters: int, tests: int) -> float:
    """Two-sided p-value of a t statistic on so many blocks, times the number of tests (Bonferroni), at most 1."""
    dof = max(clusters - 1, 1)
    # two-sided p-value of Student's t by the incomplete beta function (Abramowitz and Stegun, 26.5.27)
    return float(min(1.0, betainc(dof / 2, 0.5, dof / (dof + t**2)) * tests))


def _correlation(covariate: Covariate, other: Covariate, used: BoolArray, min_rows: int) -> float:
    """Absolute correlation of two covariates, 0 to 1; 0 where one of them does not change."""
    rows = used & np.isfinite(covariate.values) & np.isfinite(other.values)
    a, b = covariate.values[rows], other.values[rows]
    if len(a) < min_rows or np.ptp(a) == 0 or np.ptp(b) == 0:
        return 0.0
    return float(abs(np.corrcoef(a, b)[0, 1]))


def _largest_at(aligned: AlignedRecording, values: FloatArray, used: BoolArray, unit: str) -> str:
    """The third of the workspace, or of the recording, in which the error is much larger than in the opposite third."""
    largest, text = aligned.criteria.location_ratio, ""
    places = {"time": aligned.recording.time_s}
    places |= dict(zip("xyz", aligned.rows.tip_M_mm.T, strict=True))
    for name, place in places.items():
        rows = used & np.isfinite(place)
        if rows.sum() < aligned.criteria.min_rows_of_ends or np.ptp(place[rows]) == 0:
            continue
        low, high = np.quantile(place[rows], [1 / 3, 2 / 3])
        rms_um = [rms(values[rows & (place <= low)]), rms(values[rows & (place >= high)])]
        for end, other in ((0, 1), (1, 0)):
            ratio = rms_um[end] / max(rms_um[other], 1e-12)
            if ratio > largest:
                largest = ratio
                here, there = (format_error(rms_um[k], unit) for k in (end, other))
                text = f"{ENDS[name][end]} ({here} rms, {there} at the other end)"
    return text
