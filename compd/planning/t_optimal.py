"""The T-optimal choice of rows to measure: those on which an effect differs from what its rival can imitate.

With the prediction eta of one effect as the truth, the rival's columns A and the noise sigma, the criterion is the sum
of squares that the rival leaves with its best parameters, in variances of the noise::

    T = min_theta  sum_i |eta_i - A_i theta|^2 / sigma^2

Rows that were measured count, and A has columns for everything else that is fitted along: a row on which a constant or
another effect of the model makes up for the difference gains nothing. Where a D-optimal design would make the
parameters of one effect most precise, this one makes the wrong effect fail.

Source: A. C. Atkinson, V. V. Fedorov, Biometrika 62 (1975) 57. Programmes of rows are added one at a time, the
sequential construction of optimal designs: V. V. Fedorov, Theory of Optimal Experiments (1972).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.statistics import solve_ridge

# Ridge of the rival's refit, as a share of the diagonal of its normal equations: conditioning alone.
RIDGE = 1e-9
# Keeps the normal equations solvable where no row moves a column; far below one variance of the noise.
MIN_RIDGE = 1e-12


class Predictions(NamedTuple):
    """What an effect predicts and what its rival can do on r rows with m coordinates, in standard deviations of noise.

    effect : (r, m) the prediction.  rival : (r, m, p) columns of the rival, and of all that is fitted along.
    """

    effect: FloatArray
    rival: FloatArray


class RivalRefit:
    """Least squares of an effect's prediction by its rival's columns, on rows that grow by programmes.

    Kept are A^T A, A^T e and e^T e over the rows so far, and the same sums for each of K programmes.
    """

    def __init__(self, recorded: Predictions, possible: Predictions, ends: IntArray) -> None:
        """recorded : on the rows measured so far.  possible : on R rows of K programmes.  ends : (K + 1,)."""
        rows, axes, count = recorded.rival.shape
        A, y = recorded.rival.reshape(rows * axes, count), recorded.effect.ravel()
        self._normal = A.T @ A
        # what the rival imitates on the recording is subtracted everywhere: sums of large squares would cancel digits
        theta = self._solve(self._normal, A.T @ y)
        e = y - A @ theta
        self._score, self._square = A.T @ e, float(e @ e)
        new_e = possible.effect - possible.rival @ theta
        transposed = possible.rival.transpose(0, 2, 1)
        self._normals = _sums(transposed @ possible.rival, ends)
        self._scores = _sums((transposed @ new_e[:, :, None])[:, :, 0], ends)
        self._squares = _sums((new_e**2).sum(axis=1), ends)

    @property
    def discrepancy(self) -> float:
        """T on the rows so far: the sum of squares that the rival cannot imitate."""
        return self._square - float(self._score @ self._solve(self._normal, self._score))

    def discrepancies_with_each(self) -> FloatArray:
        """(K,) T after adding each of the programmes."""
        normal, score = self._normal + self._normals, self._score + self._scores
        return np.asarray(self._square + self._squares - (score * self._solve(normal, score)).sum(axis=-1))

    def add(self, k: int) -> None:
        """Add the rows of programme k."""
        self._normal = self._normal + self._normals[k]
        self._score = self._score + self._scores[k]
        self._square = self._square + float(self._squares[k])

    @staticmethod
    def _solve(normal: FloatArray, score: FloatArray) -> FloatArray:
        ridge = RIDGE * np.diagonal(normal, axis1=-2, axis2=-1) + MIN_RIDGE
        return solve_ridge(normal, score, ridge)


class Choice(NamedTuple):
    """Programmes by number, as they were chosen, with repeats; the smallest T before and after."""

    programmes: tuple[int, ...]
    before: float
    after: float


def choose_programmes(refits: Sequence[RivalRefit], lengths: IntArray, most_rows: int) -> Choice:
    """Programmes that raise the smallest T of all `refits`, one at a time, each the best per row.

    lengths : (K,) rows of each programme.  What a programme that was chosen n times already adds counts 1 / (n + 1) of
    it, so that different programmes are taken. `refits` are used up.
    """
    chosen: list[int] = []
    reached = np.array([refit.discrepancy for refit in refits])
    before = float(reached.min())
    rows_left = most_rows
    while len(lengths) and lengths.min() <= rows_left:
        discrepancies = np.stack([refit.discrepancies_with_each() for refit in refits])
        gain_per_row = (discrepancies - reached[:, None])[int(np.argmin(reached))] / lengths
        gain_per_row[lengths > rows_left] = -np.inf
        gain_per_row[chosen] /= 1.0 + np.array([chosen.count(k) for k in chosen])
        best = int(np.argmax(gain_per_row))
        chosen.append(best)
        rows_left -= int(lengths[best])
        for refit in refits:
            refit.add(best)
        reached = discrepancies[:, best]
    return Choice(tuple(chosen), before, float(reached.min()))


def _sums(values: FloatArray, ends: IntArray) -> FloatArray:
    """(K, ...) sums of values (R, ...) over the rows of each programme."""
    return np.asarray(np.add.reduceat(values, ends[:-1], axis=0))
