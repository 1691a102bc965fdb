"""Compiled parts of `compd.simulation.truth.closure`: Newton's method, and the constraints' multipliers.

Twelve unknowns, the platform's origin and axes, and twelve equations: link lengths or the place of the tip, links
square to the revolute axes, rigidity. The matrices are so small that NumPy's calls would take most of the time.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from compd.arrays import FloatArray
from compd.jit import INDICES, NUMBERS, ROWS, helper, loop

# Tolerance: far below every physical cause (nm), far above rounding at 1 m (1e-13 mm).
CLOSED_MM = 1e-11
MAX_ITERATIONS = 25
# Newton's method has diverged.
LOST_MM = 1e5
# Weights errors of the axes: as the millimetres that they displace at this radius.
PLATFORM_RADIUS_MM = 100.0
_UNKNOWNS = 12


@helper
def _equations(
    rows: FloatArray,
    axes: FloatArray,
    fixed_M: FloatArray,
    link_of_axis: NDArray[np.intp],
    base_M: FloatArray,
    tip_row: FloatArray,
    posture: FloatArray,
    value: FloatArray,
    gradient: FloatArray,
) -> None:
    """The left sides (12,), mm, and their gradient (12, 12) by the posture's numbers."""
    value[:], gradient[:] = 0.0, 0.0
    links_M = _product(rows, posture) - base_M
    if len(tip_row):
        first = _tip_equations(tip_row, posture, value, gradient)
    else:
        first = _length_equations(rows, links_M, value, gradient)
    axes_M = _product(axes, posture) + fixed_M
    for a in range(len(axes)):
        link, row = link_of_axis[a], first + a
        for d in range(3):
            value[row] += links_M[link, d] * axes_M[a, d]
            for k in range(4):
                gradient[row, 3 * k + d] = rows[link, k] * axes_M[a, d] + axes[a, k] * links_M[link, d]
    _rigidity_equations(posture, value, gradient)


@helper
def _product(rows: FloatArray, posture: FloatArray) -> FloatArray:
    """(k, 3) of rows (k, 4)."""
    product = np.zeros((len(rows), 3))
    for i in range(len(rows)):
        for k in range(4):
            for d in range(3):
                product[i, d] += rows[i, k] * posture[k, d]
    return product


@helper
def _tip_equations(tip_row: FloatArray, posture: FloatArray, value: FloatArray, gradient: FloatArray) -> int:
    """The first three equations; returns their number."""
    for d in range(3):
        for k in range(4):
            value[d] += tip_row[k] * posture[k, d]
            gradient[d, 3 * k + d] = tip_row[k]
    return 3


@helper
def _length_equations(rows: FloatArray, links_M: FloatArray, value: FloatArray, gradient: FloatArray) -> int:
    """The first equations, one for each link; returns their number."""
    for i in range(len(rows)):
        value[i] = math.sqrt(links_M[i, 0] ** 2 + links_M[i, 1] ** 2 + links_M[i, 2] ** 2)
        for k in range(4):
            for d in range(3):
                gradient[i, 3 * k + d] = rows[i, k] * links_M[i, d] / value[i]
    return len(rows)


@helper
def _rigidity_equations(posture: FloatArray, value: FloatArray, gradient: FloatArray) -> None:
    """The last six equations: products of the axes, as mm at the platform's radius."""
    row = 6
    for i in range(1, 4):
        for j in range(i, 4):
            for d in range(3):
                value[row] += PLATFORM_RADIUS_MM * posture[i, d] * posture[j, d]
                gradient[row, 3 * i + d] += PLATFORM_RADIUS_MM * posture[j, d]
                gradient[row, 3 * j + d] += PLATFORM_RADIUS_MM * posture[i, d]
            row += 1


@helper
def _solve(matrix: FloatArray, right: FloatArray) -> bool:
    """Solve in place: `right` becomes the solution, by elimination with the largest pivot of each column.

    False where the matrix is singular.
    """
    n = len(right)
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if not abs(matrix[pivot, k]) > 0.0:
            return False
        if pivot != k:
            for j in range(k, n):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
            right[k], right[pivot] = right[pivot], right[k]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            if factor != 0.0:
                for j in range(k + 1, n):
                    matrix[i, j] -= factor * matrix[k, j]
                right[i] -= factor * right[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]
    return True


@helper
def _is_right_handed(posture: FloatArray) -> bool:
    """Whether it is no mirror image, which a rigid platform cannot reach."""
    x, y, z = posture[1], posture[2], posture[3]
    volume = (
        x[0] * (y[1] * z[2] - y[2] * z[1]) + x[1] * (y[2] * z[0] - y[0] * z[2]) + x[2] * (y[0] * z[1] - y[1] * z[0])
    )
    return bool(volume > 0.0)


@loop([ROWS, ROWS, ROWS, INDICES, ROWS, NUMBERS, NUMBERS, ROWS])
def close(
    rows: FloatArray,
    axes: FloatArray,
    fixed_M: FloatArray,
    link_of_axis: NDArray[np.intp],
    base_M: FloatArray,
    tip_row: FloatArray,
    wanted_mm: FloatArray,
    posture: FloatArray,
) -> bool:
    """Move `posture`, a guess, to where the equations hold; False where that cannot be.

    Parameters
    ----------
    rows : (n, 4) platform joints, homogeneous. axes, fixed_M, link_of_axis : (r, 4), (r, 3), (r,) as of `Closure`.
    base_M : (n, 3) base joints, mm. tip_row : (4,) the tip, or (0,) where lengths are wanted.
    wanted_mm : (n,) lengths, or (3,) the tip's place in {M}. posture : (4, 3), changed.
    """
    residual, gradient = np.empty(_UNKNOWNS), np.empty((_UNKNOWNS, _UNKNOWNS))
    for _ in range(MAX_ITERATIONS):
        _equations(rows, axes, fixed_M, link_of_axis, base_M, tip_row, posture, residual, gradient)
        for i in range(len(wanted_mm)):
            residual[i] -= wanted_mm[i]
        for i in (6, 9, 11):  # the axes' products with themselves
            residual[i] -= PLATFORM_RADIUS_MM
        largest_mm = np.abs(residual).max()
        if not largest_mm <= LOST_MM:
            return False
        if largest_mm < CLOSED_MM:
            return _is_right_handed(posture)
        if not _solve(gradient, residual):
            return False
        for i in range(_UNKNOWNS):
            posture[i // 3, i % 3] -= residual[i]
    return False


@loop([ROWS, ROWS, ROWS, INDICES, ROWS, ROWS, NUMBERS, ROWS])
def find_forces(
    rows: FloatArray,
    axes: FloatArray,
    fixed_M: FloatArray,
    link_of_axis: NDArray[np.intp],
    base_M: FloatArray,
    posture: FloatArray,
    load: FloatArray,
    lateral_M: FloatArray,
) -> bool:
    """The multipliers of the equations for `load` (12,), N, into its place; False where there are none.

    lateral_M : (n, 3) that of each link's revolute joint along its axis, N, is added.
    """
    value, gradient = np.empty(_UNKNOWNS), np.empty((_UNKNOWNS, _UNKNOWNS))
    _equations(rows, axes, fixed_M, link_of_axis, base_M, load[:0], posture, value, gradient)
    if not _solve(gradient.T.copy(), load):
        return False
    axes_M = _product(axes, posture) + fixed_M
    for a in range(len(axes)):
        for d in range(3):
            lateral_M[link_of_axis[a], d] += load[len(rows) + a] * axes_M[a, d]
    return True
