"""Linear least squares: one solver that cuts the rank, one that holds every parameter by a ridge.

Both scale the columns to length 1 before they form normal equations, because parameters here have units as far apart
as um/K and N/um: without scaling a rank cut would depend on the choice of units. A small design, solved by rank cut::

    >>> A = np.array([[1.0, 0.0], [1.0, 1.0], [1.0, 2.0]])
    >>> solve_least_squares(A, np.array([1.0, 3.0, 5.0]))
    array([1., 2.])

Which one to use: `solve_least_squares` states parameters (what the data do not determine stays 0 and gets no standard
error, see `determined`); `solve_ridge` scores many candidates, each with a plausible range that bounds it.

Source: C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, SIAM 1995, chapter 25 (row weights, column
scaling, singular value analysis, ridge).
"""

from __future__ import annotations

import numpy as np

from compd.arrays import BoolArray, FloatArray

# Combinations of scaled columns with a singular value below this share of the largest count as undetermined. Normal
# equations square it: 1e-12 is still well above the rounding of double precision, 2e-16.
RANK_CUT = 1e-6
# Added to the diagonal of scaled normal equations (which is 1), so that copies of a column can be solved.
DIAGONAL_GUARD = 1e-11
# A parameter belongs to an undetermined combination if its share of the unit vector is at least this.
SHARE_OF_COMBINATION = 1e-3


def column_norms(A: FloatArray) -> FloatArray:
    """(P,) Euclidean norm of each column of A (n, P); 1 for a column of zeros, so that one can divide by it."""
    norms = np.linalg.norm(A, axis=0)
    return np.asarray(np.where(norms > 0, norms, 1.0))


def normal_inverse(A: FloatArray, rank_cut: float = RANK_CUT) -> FloatArray:
    """(P, P) pseudo-inverse of A^T A for A (n, P), undetermined combinations of columns left out.

    With D = diag(column norms) and the scaled matrix C = A D^-1 it is D^-1 (C^T C)^+ D^-1, where ^+ treats singular
    values of C below `rank_cut` times the largest as zero. Times the variance of one row it is the covariance of the
    parameters.
    """
    norms = column_norms(A)
    scaled = A / norms
    return np.asarray(_scaled_inverse(scaled, rank_cut) / np.outer(norms, norms))


def solve_least_squares(A: FloatArray, y: FloatArray, weights: FloatArray | None = None) -> FloatArray:
    """(P,) or (P, K) parameters theta that minimise sum_i w_i (y_i - A_i theta)^2.

    A : (n, P).  y : (n,), or (n, K) for K right-hand sides at once.  weights : (n,) w_i, 1 if None.
    Of all solutions that fit equally well, the one with the smallest scaled parameters.
    """
    if weights is not None:
        root = np.sqrt(weights)
        A = A * root[:, None]
        y = (y.T * root).T
    norms = column_norms(A)
    scaled = A / norms
    return np.asarray(((_scaled_inverse(scaled, RANK_CUT) @ (scaled.T @ y)).T / norms).T)


def determined(A: FloatArray, rank_cut: float = RANK_CUT) -> BoolArray:
    """(P,) parameters that the rows of A (n, P) determine.

    A parameter is not determined where its column is zero, or where it takes part in a combination of columns that
    the rank cut removes: a fit can then shift it against others without any change of the residual.
    """
    if not A.shape[1]:
        return np.zeros(0, dtype=bool)
    norms = column_norms(A)
    scaled = A / norms
    return np.asarray((A != 0).any(axis=0) & _in_no_combination(scaled.T @ scaled, rank_cut))


def normal_norms(normal: FloatArray) -> FloatArray:
    """(P,) `column_norms` of the A of which this is A^T A (P, P)."""
    norms = np.sqrt(np.diag(normal))
    return np.asarray(np.where(norms > 0, norms, 1.0))


def solve_normal(normal: FloatArray, right: FloatArray) -> FloatArray:
    """(P,) or (P, K) what `solve_least_squares` gives, from A^T W A (P, P) and A^T W y."""
    norms = normal_norms(normal)
    inverse = np.linalg.pinv(normal / np.outer(norms, norms), rcond=RANK_CUT**2, hermitian=True)
    return np.asarray(((inverse @ (right.T / norms).T).T / norms).T)


def determined_by_normal(normal: FloatArray) -> BoolArray:
    """(P,) as `determined`, from A^T A (P, P)."""
    norms = normal_norms(normal)
    return np.asarray((np.diag(normal) > 0) & _in_no_combination(normal / np.outer(norms, norms), RANK_CUT))


def solve_ridge(normal: FloatArray, right: FloatArray, ridge: FloatArray) -> FloatArray:
    """(..., P) theta = (N + diag(ridge))^-1 r, for many small systems at once.

    normal : (..., P, P) N = A^T W A.  right : (..., P) r = A^T W y.
    ridge : (..., P) one over the variance of a prior measurement of 0 for each parameter; it bounds what the rows do
    not determine, and is not felt where they do.
    """
    if normal.shape[-1] == 0:
        return right
    scaled, norms = _held_by_ridge(normal, ridge)
    return np.asarray(np.linalg.solve(scaled, (right / norms)[..., None])[..., 0] / norms)


def ridge_inverse(normal: FloatArray, ridge: FloatArray) -> FloatArray:
    """(..., P, P) inverse of N + diag(ridge), with normal (..., P, P) and ridge (..., P): covariance at unit noise."""
    scaled, norms = _held_by_ridge(normal, ridge)
    return np.asarray(np.linalg.inv(scaled) / (norms[..., :, None] * norms[..., None, :]))


def _in_no_combination(scaled: FloatArray, rank_cut: float) -> BoolArray:
    """(P,) parameters that are in no combination which the rank cut removes from a scaled normal matrix (P, P)."""
    values, vectors = np.linalg.eigh(scaled)
    undetermined = vectors[:, values < rank_cut**2 * values.max()]
    return np.asarray((np.abs(undetermined) < SHARE_OF_COMBINATION).all(axis=1))


def _scaled_inverse(scaled: FloatArray, rank_cut: float) -> FloatArray:
    """(P, P) pseudo-inverse of the normal matrix of columns of length 1."""
    return np.asarray(np.linalg.pinv(scaled.T @ scaled, rcond=rank_cut**2, hermitian=True))


def _held_by_ridge(normal: FloatArray, ridge: FloatArray) -> tuple[FloatArray, FloatArray]:
    """N + diag(ridge) scaled to a diagonal of 1 (..., P, P), and the norms (..., P) by which it was scaled."""
    identity = np.eye(normal.shape[-1])
    held = normal + ridge[..., None] * identity
    norms = np.sqrt(np.diagonal(held, axis1=-2, axis2=-1))
    return held / (norms[..., :, None] * norms[..., None, :]) + DIAGONAL_GUARD * identity, norms
