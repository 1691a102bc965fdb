"""Which rows count: outliers found beside everything that could explain them, before anything is chosen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.outliers import outlier_rows
from compd.comparison.robust import robust_sigma

ROUNDS = 12
# Huber's constant, as in `fit`.
HUBER = 2.5
RIDGE = 1e-4


def outliers(y: FloatArray, columns: Sequence[FloatArray], use: BoolArray, visit: IntArray | None) -> BoolArray:
    """(N,) gross rows of the residual y (N, m), whitened, beside all `columns` (N, m, P) at once.

    What any candidate could explain does not make a row gross, and hides no gross row either: an error of six times
    the noise would hide outliers of twenty. Huber's weights keep the outliers from bending this fit.
    """
    everything = np.concatenate([np.broadcast_to(np.eye(y.shape[1]), (*y.shape, y.shape[1])), *columns], axis=2)
    A = everything[use].reshape(-1, everything.shape[2])
    size = np.linalg.norm(A, axis=0)
    A = A / np.where(size > 0, size, 1.0)
    weights = np.ones(int(use.sum()))
    left = y[use]
    for _ in range(ROUNDS):
        root = np.repeat(np.sqrt(weights), y.shape[1])
        weighted = A * root[:, None]
        normal = weighted.T @ weighted + RIDGE * np.eye(A.shape[1])
        theta = np.linalg.solve(normal, weighted.T @ (y[use].ravel() * root))
        left = (y[use].ravel() - A @ theta).reshape(-1, y.shape[1])
        distance = (np.abs(left) / np.maximum(robust_sigma(left), 1e-9)).max(axis=1)
        weights = np.minimum(1.0, (HUBER / np.maximum(distance, HUBER)) ** 2)
    residual = np.full(y.shape, np.nan)
    residual[use] = left
    return outlier_rows(residual, use, visit)
