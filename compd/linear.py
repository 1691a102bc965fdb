"""Small dense linear algebra for kernels: six or nine unknowns need no LAPACK call."""

from __future__ import annotations

import math

from compd.arrays import FloatArray, IntArray
from compd.jit import helper

# No machine has a coordinate of 1e12 mm: a value beyond is a lost decimal point.
LARGEST = 1e12

# What is factored here holds direction cosines, near 1, or arms in mm: a pivot below this is rounding.
MIN_PIVOT = 1e-12


@helper
def is_finite(value: float) -> bool:
    """Neither nan nor infinite, nor so large that its square soon would be.

    Unlike math.isfinite it raises no floating-point flag, which NumPy would turn into a warning.
    """
    return abs(value) < LARGEST


@helper
def all_finite(x: FloatArray) -> bool:
    """Every entry of x (n,) is finite."""
    result = True
    for i in range(x.shape[0]):
        result = result and is_finite(x[i])
    return result


@helper
def rows_finite(x: FloatArray) -> bool:
    """Every entry of x (n, m) is finite."""
    result = True
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            result = result and is_finite(x[i, j])
    return result


@helper
def max_abs(x: FloatArray) -> float:
    """Greatest absolute value in x (n,); nan if any entry is."""
    result = 0.0
    for i in range(x.shape[0]):
        if not abs(x[i]) <= result:
            result = abs(x[i])
    return result


@helper
def lu_factor(A: FloatArray, pivot: IntArray) -> float:
    """LU with partial pivoting, in place.

    A : (n, n), overwritten by L (below the diagonal, unit diagonal implied) and U.
    pivot : (n,), receives the row exchanged with row k.
    Returns the sign of the determinant, 0.0 if A is singular: then do not `solve`.
    """
    n = A.shape[0]
    sign = 1.0
    for k in range(n):
        row = k
        pivot_size = abs(A[k, k])
        for i in range(k + 1, n):
            if abs(A[i, k]) > pivot_size:
                pivot_size = abs(A[i, k])
                row = i
        if not pivot_size > MIN_PIVOT:
            return 0.0
        pivot[k] = row
        if row != k:
            sign = -sign
            for j in range(n):
                A[k, j], A[row, j] = A[row, j], A[k, j]
        if A[k, k] < 0.0:
            sign = -sign
        reciprocal = 1.0 / A[k, k]
        for i in range(k + 1, n):
            factor_ = A[i, k] * reciprocal
            A[i, k] = factor_
            if factor_ != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= factor_ * A[k, j]
    return sign


@helper
def lu_solve(LU: FloatArray, pivot: IntArray, x: FloatArray) -> None:
    """Solve A x = b with A factored; x (n,) holds b on entry."""
    n = LU.shape[0]
    for k in range(n):
        row = pivot[k]
        if row != k:
            x[k], x[row] = x[row], x[k]
    for k in range(n):
        for i in range(k + 1, n):
            x[i] -= LU[i, k] * x[k]
    for k in range(n - 1, -1, -1):
        x[k] /= LU[k, k]
        for i in range(k):
            x[i] -= LU[i, k] * x[k]


@helper
def inverse_norm(LU: FloatArray, X: FloatArray) -> float:
    """Frobenius norm of the inverse of a factored matrix.

    The norm needs no pivots: exchanging rows of A exchanges columns of its inverse. All columns are solved
    together, so that the innermost loop runs along rows.
    X : (n, n), scratch.
    """
    n = LU.shape[0]
    for i in range(n):
        for j in range(n):
            X[i, j] = 0.0
        X[i, i] = 1.0
        for k in range(i):
            for j in range(k + 1):
                X[i, j] -= LU[i, k] * X[k, j]
    total = 0.0
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            for j in range(n):
                X[i, j] -= LU[i, k] * X[k, j]
        for j in range(n):
            X[i, j] /= LU[i, i]
            total += X[i, j] * X[i, j]
    return math.sqrt(total)
