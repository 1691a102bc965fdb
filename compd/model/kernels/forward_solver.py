"""Forward kinematics as a kernel: from link lengths to the pose of the moving platform.

Newton's method in the six coordinates of the pose, v in mm and w in rad times the platform's radius,

    (v, w) = J^-1 (l - |d_i|, -d_i . e_h),   p <- p + v,   R <- R(w) R,

with the closure and its derivatives J from `kernels.closure`. A step longer than STEP_LIMIT times the platform's radius
is shortened to that.
"""

from __future__ import annotations

import math

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.jit import INTEGER_ROWS, INTEGERS, MATRIX, VECTOR, helper, kernel
from compd.linear import all_finite, inverse_norm, lu_factor, lu_solve, max_abs
from compd.model.kernels.loop_closure import evaluate_closure, is_turned_over, platform_radius, pose_is_finite
from compd.model.kernels.reason_codes import NEAR_SINGULAR, NO_CONVERGENCE, NOT_FINITE, OK, OTHER_ASSEMBLY, UNREACHABLE
from compd.model.kernels.solve_status import (
    AMPLIFICATION_LIMIT,
    ITERATION_LIMIT,
    RESIDUAL_TOLERANCE_MM,
    STEP_LIMIT,
    STEP_TOLERANCE_MM,
)
from compd.rotation import orthonormalise, rotate_in_place


@helper
def _distance(points: FloatArray, i: int, j: int) -> float:
    x, y, z = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1], points[i, 2] - points[j, 2]
    return math.sqrt(x * x + y * y + z * z)


@helper
def _links_can_close(lengths_mm: FloatArray, base_joints_M: FloatArray, platform_joints_P: FloatArray) -> bool:
    """Any two links close a quadrilateral with base and platform: no side longer than the other three."""
    n = lengths_mm.shape[0]
    for i in range(n):
        for j in range(i):
            base = _distance(base_joints_M, i, j)
            platform = _distance(platform_joints_P, i, j)
            total = base + platform + lengths_mm[i] + lengths_mm[j]
            if 2.0 * max(base, platform, lengths_mm[i], lengths_mm[j]) > total:
                return False
    return True


@helper
def _newton(
    base_joints_M: FloatArray,
    platform_joints_P: FloatArray,
    revolute_axes: FloatArray,
    hinges: IntArray,
    lengths_mm: FloatArray,
    origin_M: FloatArray,
    R: FloatArray,
    radius_mm: float,
    iterations: IntArray,
    J: FloatArray,
) -> int:
    """Newton in the six coordinates of the pose, from the guess in `origin_M` and `R`, in place; leaves J factored."""
    n = lengths_mm.shape[0]
    limit_mm = STEP_LIMIT * radius_mm
    x = np.empty(6)
    pivot = np.empty(6, np.int64)
    first_sign = 0.0
    sign = 0.0
    step = math.inf
    while step > STEP_TOLERANCE_MM:
        if iterations[0] == ITERATION_LIMIT:
            return NO_CONVERGENCE
        if not evaluate_closure(origin_M, R, base_joints_M, platform_joints_P, revolute_axes, hinges, radius_mm, x, J):
            return NEAR_SINGULAR
        for i in range(6):
            x[i] = lengths_mm[i] - x[i] if i < n else -x[i]
        sign = lu_factor(J, pivot)
        if iterations[0] == 0:
            first_sign = sign
        if sign == 0.0:
            return NEAR_SINGULAR
        lu_solve(J, pivot, x)
        step = max_abs(x)
        shortened = limit_mm / max(step, limit_mm)
        for i in range(3):
            origin_M[i] += shortened * x[i]
        shortened /= radius_mm
        rotate_in_place(R, shortened * x[3], shortened * x[4], shortened * x[5])
        iterations[0] += 1
    orthonormalise(R)
    # between two assemblies lies a singular one, where the determinant changes its sign
    return OK if sign == first_sign else OTHER_ASSEMBLY


@helper
def _pose_from(
    base_joints_M: FloatArray,
    platform_joints_P: FloatArray,
    revolute_axes: FloatArray,
    hinges: IntArray,
    lengths_mm: FloatArray,
    origin_M: FloatArray,
    R: FloatArray,
    iterations: IntArray,
    residual_mm: FloatArray,
) -> int:
    """Solve from the guess in `origin_M` and `R`, in place, and check the solution; returns the reason."""
    n = lengths_mm.shape[0]
    radius_mm = platform_radius(platform_joints_P)
    J = np.empty((6, 6))
    X = np.empty((6, 6))
    reason = NEAR_SINGULAR
    if radius_mm > 0.0:
        reason = _newton(
            base_joints_M, platform_joints_P, revolute_axes, hinges, lengths_mm, origin_M, R, radius_mm, iterations, J
        )
    if reason in (NO_CONVERGENCE, NEAR_SINGULAR):
        return reason if _links_can_close(lengths_mm, base_joints_M, platform_joints_P) else UNREACHABLE
    if inverse_norm(J, X) > AMPLIFICATION_LIMIT:
        return NEAR_SINGULAR
    x = X[0]
    if not evaluate_closure(origin_M, R, base_joints_M, platform_joints_P, revolute_axes, hinges, radius_mm, x, J):
        return NEAR_SINGULAR
    for i in range(n):
        x[i] -= lengths_mm[i]
    residual_mm[0] = max_abs(x)
    return NO_CONVERGENCE if residual_mm[0] > RESIDUAL_TOLERANCE_MM else reason


@helper
def solve_forward(
    base_joints_M: FloatArray,
    platform_joints_P: FloatArray,
    revolute_axes: FloatArray,
    hinges: IntArray,
    lengths_mm: FloatArray,
    guess_origin_M: FloatArray,
    guess_R: FloatArray,
    origin_M: FloatArray,
    R: FloatArray,
    closed_lengths_mm: FloatArray,
    iterations: IntArray,
    residual_mm: FloatArray,
    reason: IntArray,
) -> None:
    """See `compd.model.kinematics.link_kinematics.forward_kinematics`."""
    for i in range(3):
        origin_M[i] = guess_origin_M[i]
        for j in range(3):
            R[i, j] = guess_R[i, j]
    closed_lengths_mm[:] = lengths_mm
    iterations[0] = 0
    residual_mm[0] = math.nan
    if not pose_is_finite(base_joints_M, platform_joints_P, revolute_axes, origin_M, R) or not all_finite(lengths_mm):
        reason[0] = NOT_FINITE
    elif np.min(lengths_mm) <= 0.0:
        reason[0] = UNREACHABLE
    else:
        reason[0] = _pose_from(
            base_joints_M, platform_joints_P, revolute_axes, hinges, lengths_mm, origin_M, R, iterations, residual_mm
        )
    if reason[0] == OK and is_turned_over(R, guess_R):
        reason[0] = OTHER_ASSEMBLY
    if reason[0] != OK:
        origin_M[:] = math.nan
        R[:, :] = math.nan
        closed_lengths_mm[:] = math.nan


forward = kernel(
    [MATRIX, MATRIX, MATRIX, INTEGER_ROWS, VECTOR, VECTOR, MATRIX, VECTOR, MATRIX, VECTOR, INTEGERS, VECTOR, INTEGERS],
    "(n,d),(n,d),(k,d),(k,c),(n),(d),(d,d)->(d),(d,d),(n),(),(),()",
)(solve_forward)
