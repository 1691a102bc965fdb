"""Linear least squares with the tolerance as prior, of several recordings at once, registrations fitted along.

With x the numbers in tolerances, r_k the registration of recording k, J and R their columns, all in standard deviations
of the noise,

    minimise  sum_k | z_k - J_k x - R_k r_k |^2 + sum_b | x_b |^2 / s_b^2,

in which the registrations have no prior and are eliminated. s_b is by which factor the tolerance of block b is scaled:
a tolerance is stated to an order of magnitude, and the poses tell how large the block's numbers really are. It follows
by expectation and maximisation (Dempster, Laird, Rubin, J. R. Statist. Soc. B 39 (1977) 1),

    s_b^2 = (v + sum (x_i^2 + C_ii)) / (v + n_b),   C = (A + S^-1)^-1,  A = J^T (1 - R R^+) J,

with v as if so many numbers at the stated tolerance had been seen before, and s_b from 1 to 100: numbers that look as
drawn do not make those better known that the poses cannot tell.
Where the poses tell nothing of a combination, x stays 0 along it, the drawing, and C keeps the tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.calibration.criteria import CalibrationCriteria
from compd.calibration.jacobian import without
from compd.statistics import determined, solve_least_squares

# Rounds of expectation and maximisation, and a change of a factor that ends them.
_ROUNDS, _SETTLED = 60, 1e-3


class Whitened(NamedTuple):
    """One recording's rows in standard deviations of the noise, each with the root of its weight.

    z : (n,).  J : (n, P), per tolerance.  R : (n, Q).  row : (n,) the recording's row of each.
    """

    z: FloatArray
    J: FloatArray
    R: FloatArray
    row: IntArray

    def of_rows(self, rows: BoolArray) -> Whitened:
        """Those of rows (N,) of the recording."""
        chosen = rows[self.row]
        return Whitened(self.z[chosen], self.J[chosen], self.R[chosen], self.row[chosen])


class Normal(NamedTuple):
    """Of several recordings, the registrations eliminated: A (P, P), b (P,)."""

    A: FloatArray
    b: FloatArray


class PriorFit(NamedTuple):
    """x : (P,) in tolerances, 0 of numbers that are not free.  scale : (B,) of each block's tolerance.
    C : (P, P) covariance in tolerances, 0 of numbers that are not free.
    """

    x: FloatArray
    scale: FloatArray
    C: FloatArray


def normal_equations(parts: Sequence[Whitened]) -> Normal:
    """Summed over recordings."""
    P = parts[0].J.shape[1]
    A, b = np.zeros((P, P)), np.zeros(P)
    for part in parts:
        both = without(np.column_stack([part.J, part.z]), part.R)
        J, z = both[:, :P], both[:, P]
        A += J.T @ J
        b += J.T @ z
    return Normal(A, b)


def fit_with_prior(normal: Normal, block_of: IntArray, free: BoolArray) -> PriorFit:
    """The numbers `free` (P,) of blocks `block_of` (P,), the others at the drawing and known."""
    blocks = int(block_of.max()) + 1
    scale = np.ones(blocks)
    of_free = block_of[free]
    A, b = normal.A[np.ix_(free, free)], normal.b[free]
    present = np.unique(of_free)
    count = np.bincount(of_free, minlength=blocks)
    for _ in range(_ROUNDS if len(present) else 0):
        C = _inverse(A + np.diag(1.0 / scale[of_free] ** 2))
        x = C @ b
        size = np.bincount(of_free, weights=x**2 + np.diag(C), minlength=blocks)
        spread = np.sqrt((CalibrationCriteria.seen_before + size) / (CalibrationCriteria.seen_before + count))
        new = np.clip(spread, 1.0, CalibrationCriteria.largest_scale)[present]
        change = np.abs(new / scale[present] - 1).max()
        scale[present] = new
        if change < _SETTLED:
            break
    C = _inverse(A + np.diag(1.0 / scale[of_free] ** 2))
    x = np.zeros(len(block_of))
    x[free] = C @ b
    whole = np.zeros((len(x), len(x)))
    whole[np.ix_(free, free)] = C
    return PriorFit(x, scale, whole)


def registration_of(part: Whitened, x: FloatArray) -> FloatArray:
    """(Q,) the registration that goes with numbers x (P,)."""
    if not part.R.shape[1]:
        return np.zeros(0)
    return solve_least_squares(part.R, part.z - part.J @ x)


def open_columns(known: FloatArray, tested: FloatArray) -> FloatArray:
    """(n, q) of the registration's columns `tested` (n, Q) those that rows with the columns `known` (m, Q) leave open,
    such as the place of a ball of which no row is known."""
    return np.asarray(tested[:, ~determined(known)]) if len(known) else tested


def _inverse(A: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.inv(A))
