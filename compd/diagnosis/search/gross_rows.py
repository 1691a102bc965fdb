"""Gross rows, which neither noise nor any candidate explains, and the weight of the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.special import chdtr, chdtrc, gammaln

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison import ComparisonCriteria
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.findings import GrossRows
from compd.diagnosis.search_criteria import GrossCriteria
from compd.statistics import MIN_SIGMA, robust_regression, trimmed_scale

# Rounds of reweighting: with the exponent of the criteria the weights settle in about ten.
ROUNDS = 12


class RowWeights(NamedTuple):
    """What each of N rows counts.

    gross : (N,) rows that do not.  weight : (N,) of the others, so scaled that the mean square of normal noise is not
    changed; 0 for rows that are gross, or that the fit does not rest on.
    fit : (m + P,) the constant of each coordinate and the parameters of the robust fit beside which they were weighed.
    """

    gross: BoolArray
    weight: FloatArray
    fit: FloatArray


def weigh_rows(
    columns: Sequence[FloatArray],
    residual: FloatArray,
    known: BoolArray,
    visit: IntArray | None,
    noise: float,
    criteria: Criteria,
    huber: float = ComparisonCriteria.huber_sigmas,
    least: FloatArray | float = 0.0,
    lone_distance: Callable[[FloatArray, BoolArray], float] | None = None,
) -> RowWeights:
    """Weigh rows by what a robust fit of some columns and a constant leaves of them.

    columns : each (N, m, P), whitened.  residual : (N, m), whitened; nan where it is not known.
    known : (N,) rows that the fit rests on. Others are judged by it where the residual and the columns are known.
    visit : (N,) number of the visit, negative for none.
    noise : standard deviation of the noise, 1 of a whitened residual; 0 where it is not known. A row that another one
        of its visit confirms within 5 sqrt(2) of it is not gross: the machine really was there. A lone visit is.
    huber : of the robust fit, as of `huber_weights`.
    least : (m,) below which no robust standard deviation is taken: where most rows are alike to the last digit, a
        difference of one digit is not gross.
    lone_distance : beyond which the repeats of a visit do not confirm each other, `AlignedRecording.lone_distance`.

    With d the rms over the coordinates of a row's residual in robust standard deviations, its weight is
    min(1, 2 / d) (Huber, Robust Statistics (1981), chapter 7), over the mean of min(d^2, 2 d) for normal noise. Rows
    that follow one another are no chance: a run of them counts in full, since it is what the machine did.
    """
    m = residual.shape[1]
    constant = np.broadcast_to(np.eye(m), (*residual.shape, m))
    G = np.concatenate([constant, *columns], axis=2)
    if G.shape[2] > criteria.gross.max_columns_share * known.sum() * m:
        G = G[:, :, :m]
    theta = robust_regression(
        G[known],
        residual[known],
        ridge=criteria.gross.ridge,
        exponent=criteria.gross.exponent,
        rounds=ROUNDS,
        scale=lambda rest: np.maximum(trimmed_scale(rest), least),
        huber=huber,
    )
    left = residual - G @ theta
    judged: BoolArray = np.asarray(np.isfinite(left).all(axis=1))
    scale = np.maximum(trimmed_scale(left[known]), np.maximum(least, MIN_SIGMA))
    distance = np.where(judged[:, None], np.abs(left) / scale, 0.0)
    far = (distance > criteria.gross_sigmas).any(axis=1)
    gross = far & ~_confirmed(left, judged, visit, criteria.gross_sigmas * np.sqrt(2.0) * (noise or scale))
    farthest = distance.max(axis=1)
    if lone_distance is not None:
        gross |= farthest > lone_distance(farthest, judged)
    size = np.sqrt(np.mean(distance**2, axis=1))
    full = criteria.full_weight_sigmas
    weight = np.minimum(1.0, full / np.maximum(size, full))
    # a row that is not known, as a copy, lies between no others
    weight[known] = np.where(_in_runs(((size > full) & ~gross)[known], criteria.gross.min_in_run), 1.0, weight[known])
    weight /= consistency(m, full)
    return RowWeights(gross, np.where(known & ~gross, weight, 0.0), theta)


def _in_runs(far: BoolArray, least: int) -> BoolArray:
    """(N,) rows among `least` or more far rows (N,) without another between them."""
    edges = np.flatnonzero(np.diff(far.astype(np.int8), prepend=0, append=0))
    runs = np.zeros(len(far), dtype=bool)
    for begin, end in edges.reshape(-1, 2):
        runs[begin:end] = end - begin >= least
    return runs


def consistency(m: int, full: float) -> float:
    """Mean of min(d^2, full d) for m coordinates of normal noise, m d^2 being distributed as chi-squared.

    >>> round(consistency(1, 2.0), 3), round(consistency(3, 2.0), 3)
    (0.954, 0.999)
    """
    within = chdtr(m + 2, m * full**2)  # E[d^2; d <= full]
    beyond = np.exp(_log_mean_chi(m)) / np.sqrt(m) * chdtrc(m + 1, m * full**2)  # E[d; d > full]
    return float(within + full * beyond)


def _log_mean_chi(m: int) -> float:
    """Logarithm of the mean of a chi variable with m degrees of freedom."""
    return float(0.5 * np.log(2.0) + gammaln((m + 1) / 2) - gammaln(m / 2))


def _confirmed(left: FloatArray, known: BoolArray, visit: IntArray | None, limit: FloatArray) -> BoolArray:
    """(N,) rows with another row of the same visit within a limit (m,) on every coordinate."""
    confirmed = np.zeros(len(left), dtype=bool)
    if visit is None:
        return confirmed
    rows = np.flatnonzero(known & (visit >= 0))
    rows = rows[np.argsort(visit[rows], kind="stable")]
    bounds = np.flatnonzero(np.diff(visit[rows], prepend=-1, append=-1))
    for begin, end in pairwise(bounds):
        of_visit = rows[begin:end]
        if len(of_visit) < 2:
            continue
        near = (np.abs(left[of_visit][:, None] - left[of_visit][None]) <= limit).all(axis=2)
        confirmed[of_visit] = near.sum(axis=1) > 1
    return confirmed


def gross_rows(gross: BoolArray, row: IntArray, criteria: GrossCriteria = GrossCriteria()) -> GrossRows:
    """The gross rows as a person finds them; row : (N,) their numbers in a spreadsheet."""
    indices = np.flatnonzero(gross)
    if not len(indices):
        return GrossRows()
    stretches = np.split(indices, np.flatnonzero(np.diff(indices) > criteria.max_gap) + 1)
    runs = [(int(row[s[0]]), int(row[s[-1]])) for s in stretches if len(s) >= criteria.min_in_run]
    return GrossRows(tuple(int(number) for number in row[indices]), tuple(runs))
