"""Unmodelled disturbances as a part of standard errors: effects too small to be named still move fitted parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from compd.arrays import FloatArray
from compd.comparison import AlignedRecording, FitResult, nuisance_beside
from compd.diagnosis.candidates.candidates import Candidate
from compd.diagnosis.criteria import Criteria
from compd.statistics import normal_inverse
from compd.units import UM_PER_MM

# Combinations of scaled columns with a smaller singular value are undetermined: conditioning alone.
RANK_CUT = 1e-5


def with_disturbances(
    result: FitResult,
    aligned: AlignedRecording,
    sigma_um: FloatArray,
    candidates: Sequence[Candidate],
    criteria: Criteria,
) -> FitResult:
    """The fit with the covariance that unnamed effects of the library add to its parameters.

    A residual at the noise floor still hides effects that are too small to be found. One that looks like a fitted
    effect moves its parameters, and the noise alone says nothing of that. An error of which only the size is known is
    an uncertainty all the same (GUM, 4.3: type B). Unnamed effects, equally likely to be any of the K that are not
    fitted, act with an rms of `disturbance` standard deviations of the noise in all, spread evenly and independently
    over their own columns. With the whitened columns A of the fit and B_k of effect k, each of its p_k
    columns scaled to an rms of 1, the added covariance is::

        disturbance^2 / K  sum_k  A^+ B_k B_k^T A^+T / p_k

    where A^+ = (A^T A)^-1 A^T is what least squares makes of an error of the prediction (GUM, 5.1.2).

    sigma_um : (m,) standard deviation of the noise.  candidates : the library's, of which the first variant of each
    effect counts.

    Example: where the only other effect has the same form as the fitted one, the standard error grows by as much of
    the parameter as moves the prediction by 0.28 standard deviations of the noise (rms), however many
    rows there are.
    """
    fitted_ids = {fitted.effect.id for fitted in result.fitted}
    others: dict[str, FloatArray] = {}
    for candidate in candidates:
        if candidate.name not in fitted_ids and candidate.name not in others:
            others[candidate.name] = _whitened(candidate.columns_um, result, sigma_um)
    if not others or not result.fitted:
        return result
    own_um = [aligned.columns(fitted.effect, fitted.constants) * UM_PER_MM for fitted in result.fitted]
    own = np.concatenate(own_um, axis=2)
    nuisance = nuisance_beside(aligned, result.fitted, own, result.used)
    A = _whitened(np.concatenate([own, nuisance], axis=2), result, sigma_um)
    inverse = normal_inverse(A, RANK_CUT)
    added = np.zeros((A.shape[1], A.shape[1]))
    variance = criteria.disturbance**2
    for columns in others.values():
        rms = np.sqrt(np.mean(columns**2, axis=0))
        unit_columns = columns[:, rms > 0] / rms[rms > 0]
        moved = inverse @ (A.T @ unit_columns)
        added += moved @ moved.T * (variance / max(unit_columns.shape[1], 1) / len(others))
    ends = np.cumsum([0, *(columns.shape[2] for columns in own_um)])
    covariance = result.covariance + added[: ends[-1], : ends[-1]]
    fitted = tuple(
        replace(effect, covariance=covariance[begin:end, begin:end])
        for effect, (begin, end) in zip(result.fitted, pairwise(ends), strict=True)
    )
    return replace(result, fitted=fitted, covariance=covariance)


def _whitened(columns_um: FloatArray, result: FitResult, sigma_um: FloatArray) -> FloatArray:
    """(rows used x m, P) columns (N, m, P) in standard deviations of the noise; 0 where an effect is not known."""
    used = np.nan_to_num(columns_um[result.used] / sigma_um[:, None])
    return used.reshape(-1, columns_um.shape[2])
