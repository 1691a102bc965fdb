"""What a machine's small disturbances, too small to be named, do to fitted numbers: a part of their standard errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from compd.arrays import FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.fit import FitResult
from compd.diagnosis.candidates import Candidate
from compd.units import UM_PER_MM

# Always there, in standard deviations of the noise, rms per coordinate: two of a fifth of the floor.
DISTURBANCE = 0.2
DISTURBANCES = 2
# Columns that differ from others by less than this share of their size are the same.
INDISTINCT = 1e-10


def with_disturbances(
    found: FitResult, aligned: AlignedRecording, sigma_um: FloatArray, candidates: Sequence[Candidate]
) -> FitResult:
    """The fit with wider standard errors: by how much its numbers move when two other effects act a little.

    sigma_um : (m,) noise.  candidates : the library.
    Every other effect is as likely, and every of its columns in equal parts; a number's error by the noise alone
    would be too small where an unnamed disturbance looks like the effect. (GUM, 4.3: an error of which only the
    size is known is an uncertainty all the same.)
    """
    taken = {one.effect.id for one in found.fitted}
    others: dict[str, FloatArray] = {}
    for one in candidates:
        if one.name not in taken and one.name not in others:
            others[one.name] = _whitened(one.columns_um, found, sigma_um)
    if not others or not found.fitted:
        return found
    own = [aligned.columns(one.effect, one.constants) * UM_PER_MM for one in found.fitted]
    G = _whitened(np.concatenate([*own, aligned.free_columns * UM_PER_MM], axis=2), found, sigma_um)
    size = np.linalg.norm(G, axis=0)
    size[size == 0] = 1.0
    inverse = np.linalg.pinv((G / size).T @ (G / size), rcond=INDISTINCT, hermitian=True)
    total = np.zeros((G.shape[1], G.shape[1]))
    for columns in others.values():
        rms = np.sqrt(np.mean(columns**2, axis=0))
        acting = columns[:, rms > 0] / rms[rms > 0]
        moved = inverse @ ((G / size).T @ acting) / size[:, None]
        total += moved @ moved.T * (DISTURBANCE**2 * DISTURBANCES / max(acting.shape[1], 1) / len(others))
    ends = np.cumsum([0, *(column.shape[2] for column in own)])
    covariance = found.covariance + total[: ends[-1], : ends[-1]]
    fitted = tuple(
        replace(one, covariance=covariance[a:b, a:b]) for one, (a, b) in zip(found.fitted, pairwise(ends), strict=True)
    )
    return replace(found, fitted=fitted, covariance=covariance)


def _whitened(columns_um: FloatArray, found: FitResult, sigma_um: FloatArray) -> FloatArray:
    """(rows used x m, P); 0 where a candidate knows nothing."""
    used = np.nan_to_num(columns_um[found.used] / sigma_um[:, None])
    return used.reshape(-1, columns_um.shape[2])
