"""Gross poses of a calibration: poses with an error that neither the noise nor numbers of the machine explain.

With e_i the w weighed coordinates of pose i that a fit leaves, in standard deviations of the noise, D_i its columns of
numbers and registration, and C the covariance of these,

    t_i^2 = e_i^T (1 - D_i C D_i^T)^-1 e_i,

with a plus where the fit leaves the pose out. t_i^2 is chi-squared with w degrees of freedom, or w times an F where the
noise is estimated; the limit is Bonferroni's over all poses. Several gross poses hide each other in a fit of all. So
poses are left out one after the other, the farthest first, up to `gross_share` of them, and the fit is repeated each
time. The poses that agree with the rest come back, the nearest first (A. S. Hadi, J. R. Statist. Soc. B 54 (1992) 761).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import chdtr, chdtri, fdtri

from compd.arrays import BoolArray, FloatArray
from compd.calibration.criteria import CalibrationCriteria
from compd.calibration.prior_fit import Normal

# Share of the poses left out or taken back in one step.
_STEP = 0.02
# Variance of a residual, in variances of the noise, below which the pose alone determines a number: it is not judged.
_LEAST_VARIANCE = 1e-6
# Precision of a registration number, in that of all poses, where no pose is left that shows it.
_OPEN = 1e-8


class PoseRows(NamedTuple):
    """Poses of one recording, each coordinate in standard deviations of the noise assumed so far.

    z : (N, w) measured less drawn.  J : (N, w, P) per number.  R : (N, w, Q) per registration number.
    use : (N,) poses with every value.  sections : coordinates with one scatter each.
    declared : (S,) declared standard deviation of each section over the one assumed; nan where none is declared.
    """

    z: FloatArray
    J: FloatArray
    R: FloatArray
    use: BoolArray
    sections: tuple[slice, ...]
    declared: FloatArray


class _Distances(NamedTuple):
    """square : (N,) t^2.  sigma : (S,) of each section, in the noise assumed.  dof : of sigma, inf if declared."""

    square: FloatArray
    sigma: FloatArray
    dof: float


def gross_poses(rows: Sequence[PoseRows], precision: Callable[[Normal], FloatArray]) -> list[BoolArray]:
    """(N,) gross poses of each recording.

    precision : (P, P) of the numbers before these poses, from the normal equations of the poses kept.
    """
    spanned = [one._replace(R=_orthonormal(one.R, one.use)) for one in rows]
    kept = [one.use.copy() for one in rows]
    sigma = [np.ones(len(one.sections)) for one in rows]
    share = CalibrationCriteria.gross_share
    fewest = [int(np.ceil((1 - share) * one.use.sum())) for one in rows]
    while any(own.sum() > least for own, least in zip(kept, fewest, strict=True)):
        distances = _distances(spanned, kept, sigma, precision)
        sigma = [one.sigma for one in distances]
        for own, one, least in zip(kept, distances, fewest, strict=True):
            step = min(int(np.ceil(_STEP * own.sum())), int(own.sum()) - least)
            own[np.argsort(np.where(own, -one.square, np.inf))[:step]] = False
    while True:
        distances = _distances(spanned, kept, sigma, precision)
        sigma = [one.sigma for one in distances]
        came = False
        for poses, own, one in zip(rows, kept, distances, strict=True):
            near = poses.use & ~own & (one.square <= _limit(poses, one.dof))
            step = int(np.ceil(_STEP * own.sum()))
            back = np.argsort(np.where(near, one.square, np.inf))[: min(step, int(near.sum()))]
            own[back] = True
            came |= len(back) > 0
        if not came:
            return [poses.use & ~own for poses, own in zip(rows, kept, strict=True)]


def _limit(poses: PoseRows, dof: float) -> float:
    """Of t^2 that good poses exceed in one recording of 1 / `gross_chance`."""
    chance = CalibrationCriteria.gross_chance / max(int(poses.use.sum()), 1)
    w = poses.z.shape[1]
    return float(w * fdtri(w, dof, 1 - chance) if np.isfinite(dof) else chdtri(w, chance))


def _orthonormal(R: FloatArray, use: BoolArray) -> FloatArray:
    """(N, w, q) columns of the registration, orthonormal over the poses `use`."""
    if not R.shape[2]:
        return R
    _, sizes, V = np.linalg.svd(R[use].reshape(-1, R.shape[2]), full_matrices=False)
    told = sizes > 1e-9 * sizes[0]
    return np.asarray(R @ (V[told].T / sizes[told]))


def _distances(
    rows: Sequence[PoseRows],
    kept: Sequence[BoolArray],
    sigma: Sequence[FloatArray],
    precision: Callable[[Normal], FloatArray],
) -> list[_Distances]:
    """Of all poses from the fit of those kept. sigma : (S,) of each recording's sections, that its weights assume."""
    P = rows[0].J.shape[2]
    Q = [one.R.shape[2] for one in rows]
    ends = P + np.cumsum([0, *Q])
    A, b = np.zeros((ends[-1], ends[-1])), np.zeros(ends[-1])
    columns, values = [], []
    for one, own, scale, first in zip(rows, kept, sigma, ends, strict=False):
        weight = np.ones(one.z.shape[1])
        for part, size in zip(one.sections, scale, strict=True):
            weight[part] = 1 / size
        D = np.zeros((*one.z.shape, ends[-1]))
        D[:, :, :P] = one.J * weight[:, None]
        D[:, :, first : first + one.R.shape[2]] = one.R * weight[:, None]
        z = one.z * weight
        flat = D[own].reshape(int(own.sum()) * len(weight), ends[-1])
        A += flat.T @ flat
        b += flat.T @ z[own].ravel()
        columns.append(D)
        values.append(z)
    A[range(P, ends[-1]), range(P, ends[-1])] += _OPEN
    if P:
        to_R = np.linalg.solve(A[P:, P:], np.column_stack([A[P:, :P], b[P:]])) if ends[-1] > P else np.zeros((0, P + 1))
        reduced = np.column_stack([A[:P, :P], b[:P]]) - A[:P, P:] @ to_R
        A[:P, :P] += precision(Normal(reduced[:, :P], reduced[:, P]))
    C = np.linalg.inv(A)
    y = C @ b
    return [
        _distances_of(one, own, scale, D, z - D @ y, C)
        for one, own, scale, D, z in zip(rows, kept, sigma, columns, values, strict=True)
    ]


def _distances_of(
    poses: PoseRows, kept: BoolArray, assumed: FloatArray, D: FloatArray, left: FloatArray, C: FloatArray
) -> _Distances:
    """left : (N, w) of the fit, in the standard deviations `assumed` (S,)."""
    spread = D @ C @ D.transpose(0, 2, 1)
    w = left.shape[1]
    # the mean square of poses of which the farthest are left out is less than the noise
    share = kept.sum() / max(int(poses.use.sum()), 1)
    fall = float(chdtr(w + 2, chdtri(w, 1 - share)) / share) if 0 < share < 1 else 1.0
    sigma, dofs = np.empty(len(assumed)), []
    for k, part in enumerate(poses.sections):
        own = left[kept][:, part]
        dof = max(own.size - float(np.einsum("nii->ni", spread[kept])[:, part].sum()), 1.0)
        found = float(np.sqrt((own**2).sum() / dof / fall)) * assumed[k]
        declared = poses.declared[k]
        most = np.sqrt(float(fdtri(dof, 1e9, CalibrationCriteria.contradicts))) * declared
        told = np.isfinite(declared) and found <= most
        sigma[k] = max(declared if told else found, 1e-12)
        dofs.append(np.inf if told else dof)
    weight = np.ones(w)
    for part, size, before in zip(poses.sections, sigma, assumed, strict=True):
        weight[part] = before / size
    variance = np.where(kept[:, None, None], np.eye(w) - spread, np.eye(w) + spread)
    square = np.full(len(left), np.inf)
    known = poses.use
    sizes, axes = np.linalg.eigh(variance[known])
    along = (axes.transpose(0, 2, 1) @ (left * weight)[known][:, :, None])[:, :, 0]
    judged = sizes > _LEAST_VARIANCE
    square[known] = np.where(judged, along**2 / np.where(judged, sizes, 1.0), 0.0).sum(axis=1)
    return _Distances(square, sigma, min(dofs))
