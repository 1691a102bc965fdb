"""Fitting effects: Gauss-Newton on the real forward model, jointly with everything that the model has already."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.aligned_recording import AlignedRecording, added_by
from compd.comparison.noise_floor import outlier_rows, robust_sigma
from compd.errors import CompdError, Problem
from compd.model.effect import ConstantValues, Effect, FittedEffect
from compd.recording.recording import Recording
from compd.units import UM_PER_MM

# The prediction is linear in what effects add to within 1e-5: two steps do, a tenth would mean a defect.
STEPS = 10
ROUNDS = 8
# A step below this share of what the fit leaves is none.
CONVERGED = 1e-6
# Huber's weights: a residual up to this many standard deviations counts in full (95 % efficient at 1.345; here only
# what lies between noise and gross is held back).
HUBER = 2.5
# Columns whose singular value is below this share of the largest cannot be told apart from the others.
INDISTINCT = 1e-6
# Blocks of neighbouring rows for standard errors: enough for 15 % on a standard error, long enough for the weather.
BLOCKS = 24


@dataclass(frozen=True, eq=False)
class FitResult:
    """Effects with their numbers, fitted together on one recording.

    fitted : in order, each with its own covariance.  names : (P,) "link_elasticity.k" ..., over all effects.
    covariance : (P, P) of the fitted numbers, jointly; nan where the data do not determine a number.
    residual_um : (N, m), nan where a row cannot be used.  used : (N,) rows that the fit rests on.
    outlier : (N,) rows beyond all noise, kept out of the fit.  clusters : on how many blocks the errors rest.
    """

    fitted: tuple[FittedEffect, ...]
    names: tuple[str, ...]
    covariance: FloatArray
    residual_um: FloatArray
    used: BoolArray
    outlier: BoolArray
    clusters: int

    @property
    def rms_um(self) -> float:
        """Per coordinate, over the rows used."""
        return float(np.sqrt(np.mean(self.residual_um[self.used] ** 2)))


def start(effect: Effect, shape: ConstantValues, links: int) -> FittedEffect:
    """An effect that does nothing yet: where a fit begins."""
    count = len(effect.columns(links))
    return FittedEffect(effect, np.zeros(count), shape, np.full((count, count), np.nan))


def fit(
    aligned: AlignedRecording, effects: Sequence[FittedEffect], weight_sigma_um: FloatArray | None = None
) -> FitResult:
    """Fit the effects together; with the instrument's frame where it is not known.

    effects : with the numbers to start from; shape constants stay as they are.
    weight_sigma_um : (m,) noise of each coordinate; all alike if None.
    Standard errors are the larger of two: from the scatter of the residual, and from its sums over neighbouring rows
    (sessions where there are many), which grow where residuals hang together.
    (Cameron and Miller, Journal of Human Resources 50 (2015) 317.)

    Raises CompdError where an effect needs what the recording has not, or fewer rows than numbers are usable.
    """
    sigma_um = np.ones(len(aligned.labels)) if weight_sigma_um is None else weight_sigma_um
    usable, _ = aligned.usable
    begun = tuple(effects)
    added_by(begun, aligned.rows)  # refuses here what cannot be fitted
    columns_um = [aligned.columns(one.effect, one.constants) * UM_PER_MM for one in begun]
    ends = np.cumsum([0, *(column.shape[2] for column in columns_um)])
    G_um = np.concatenate([*columns_um, aligned.free_columns * UM_PER_MM], axis=2)
    usable = usable & np.isfinite(G_um).all(axis=(1, 2))
    _check_rows(aligned, usable, G_um.shape[2])

    theta = np.concatenate([np.zeros(0), *(one.theta for one in begun)])
    free = np.zeros(G_um.shape[2] - len(theta))
    outlier = np.zeros(len(usable), dtype=bool)
    seen_before: set[bytes] = set()
    for _ in range(ROUNDS):
        theta, free, residual_um = _gauss_newton(aligned, begun, ends, G_um, theta, free, usable & ~outlier, sigma_um)
        found = outlier_rows(residual_um / sigma_um, usable, aligned.recording.visit)
        if (found == outlier).all() or found.tobytes() in seen_before:
            break
        seen_before.add(outlier.tobytes())
        outlier = found
    residual_um[~usable] = np.nan
    used = usable & ~outlier
    covariance, clusters = _covariance(aligned, G_um, residual_um, used, sigma_um)
    return FitResult(
        tuple(
            replace(one, theta=theta[a:b], covariance=covariance[a:b, a:b])
            for one, a, b in zip(begun, ends[:-1], ends[1:], strict=True)
        ),
        tuple(f"{one.effect.id}.{column.name}" for one in begun for column in one.effect.columns(aligned.rows.links)),
        covariance[: len(theta), : len(theta)],
        residual_um,
        used,
        outlier,
        clusters,
    )


def free_motion_of(aligned: AlignedRecording, residual_um: FloatArray, use: BoolArray) -> FloatArray:
    """(N, m) the part of a residual that a small motion of the instrument's frame explains, robustly; in um."""
    G = aligned.free_columns
    if not G.shape[2] or not use.any():
        return np.zeros_like(residual_um)
    found = np.zeros(G.shape[2])
    weights = np.ones(int(use.sum()))
    for _ in range(ROUNDS):
        found = _solve(G[use], residual_um[use], weights, np.ones(residual_um.shape[1]))
        weights = _weights(residual_um[use] - G[use] @ found)
    return np.asarray(G @ found)


def _check_rows(aligned: AlignedRecording, usable: BoolArray, numbers: int) -> None:
    measured = int(usable.sum()) * len(aligned.labels)
    if measured <= numbers:
        raise CompdError(
            Problem(
                where=str(aligned.recording.path),
                what=f"{measured} measured values for {numbers} numbers to fit",
                value=f"{int(usable.sum())} rows of {aligned.recording.rows} are usable",
                allowed="more values than numbers",
                next_step="`compd recording check` says which rows are left out",
            )
        )


def _gauss_newton(
    aligned: AlignedRecording,
    begun: Sequence[FittedEffect],
    ends: IntArray,
    G_um: FloatArray,
    theta: FloatArray,
    free: FloatArray,
    use: BoolArray,
    sigma_um: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Numbers, frame and residual (N, m) where the steps have become nothing."""
    G = G_um[use]
    for _ in range(STEPS):
        now = [replace(one, theta=theta[a:b]) for one, a, b in zip(begun, ends[:-1], ends[1:], strict=True)]
        _, added = added_by(now, aligned.rows)
        residual_um = (aligned.measured_mm - aligned.predicted_mm(added)) * UM_PER_MM - G_um[:, :, len(theta) :] @ free
        weights = _weights(residual_um[use] / sigma_um)
        step = _solve(G, residual_um[use], weights, sigma_um)
        theta, free = theta + step[: len(theta)], free + step[len(theta) :]
        moved_um = float(np.sqrt(np.mean((G @ step) ** 2)))
        if moved_um <= CONVERGED * max(float(np.sqrt(np.mean(residual_um[use] ** 2))), 1e-9):
            break
    return theta, free, residual_um


def _weights(scaled: FloatArray) -> FloatArray:
    """(N,) Huber's weight of each row by its worst coordinate."""
    size = (np.abs(scaled) / np.maximum(robust_sigma(scaled), 1e-9)).max(axis=1)
    return np.asarray(np.minimum(1.0, HUBER / np.maximum(size, HUBER)))


def _solve(G: FloatArray, residual: FloatArray, weights: FloatArray, sigma: FloatArray) -> FloatArray:
    """(P,) weighted least squares; of what the data cannot tell apart, the smallest numbers."""
    if not G.shape[2]:
        return np.zeros(0)
    root = np.sqrt(weights)[:, None] / sigma
    A = (G * root[:, :, None]).reshape(-1, G.shape[2])
    size = np.linalg.norm(A, axis=0)
    size[size == 0] = 1.0
    normal = (A / size).T @ (A / size)
    return np.asarray(_inverse(normal) @ ((A / size).T @ (residual * root).ravel()) / size)


def _inverse(normal: FloatArray) -> FloatArray:
    """Of a scaled normal matrix, without what is indistinct."""
    return np.asarray(np.linalg.pinv(normal, rcond=INDISTINCT**2, hermitian=True))


def _covariance(
    aligned: AlignedRecording, G_um: FloatArray, residual_um: FloatArray, used: BoolArray, sigma_um: FloatArray
) -> tuple[FloatArray, int]:
    """(P, P) of all fitted numbers, the frame's last; and the number of blocks."""
    group = blocks_of(aligned.recording)[used]
    clusters = len(np.unique(group))
    numbers = G_um.shape[2]
    if not numbers:
        return np.zeros((0, 0)), clusters
    A = (G_um[used] / sigma_um[:, None]).reshape(-1, numbers)
    scaled = residual_um[used] / sigma_um
    count = len(A)
    size = np.linalg.norm(A, axis=0)
    acts = size > 0
    size[~acts] = 1.0
    inverse = _inverse((A / size).T @ (A / size))
    variance = float((scaled**2).sum()) / (count - numbers)
    scores = np.stack(
        [
            np.bincount(group, column)
            for column in (A / size * scaled.reshape(-1, 1)).reshape(len(group), -1, numbers).sum(axis=1).T
        ],
        axis=1,
    )
    small = clusters / max(clusters - 1, 1) * (count - 1) / (count - numbers)
    clustered = inverse @ (scores.T @ scores) @ inverse * small
    naive = inverse * variance
    larger = np.sqrt(np.maximum(np.diag(clustered), np.diag(naive)))
    naive_std = np.sqrt(np.diag(naive))
    naive_std[naive_std == 0] = 1.0
    covariance = naive / np.outer(naive_std, naive_std) * np.outer(larger, larger) / np.outer(size, size)
    lost = ~acts | ~_determined(A / size)
    covariance[lost] = np.nan
    covariance[:, lost] = np.nan
    return covariance, clusters


def _determined(A: FloatArray) -> BoolArray:
    """(P,) numbers that take no part in a combination which the data do not see."""
    values, vectors = np.linalg.eigh(A.T @ A)
    blind = vectors[:, values < INDISTINCT**2 * values.max()]
    return np.asarray((np.abs(blind) < 1e-3).all(axis=1))


def blocks_of(recording: Recording) -> IntArray:
    """(N,) blocks of neighbouring rows within which residuals may hang together; sessions where there are many."""
    fold = recording.fold
    names, inverse = np.unique(fold, return_inverse=True)
    if len(names) >= BLOCKS:
        return np.asarray(inverse, dtype=np.int64)
    blocks = -(-BLOCKS // len(names))
    place = np.zeros(len(fold), dtype=np.int64)
    for k in range(len(names)):
        rows = np.flatnonzero(inverse == k)
        place[rows] = k * blocks + np.arange(len(rows)) * blocks // len(rows)
    return place
