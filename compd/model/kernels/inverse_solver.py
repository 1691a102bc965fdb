"""Inverse kinematics as a kernel: from the place of the tip to the pose and the link lengths.

The hexapod's attitude R is chosen, so that p = tip_M - R tip_P and l_i = |p + R c_i - a_i| follow at once. The tripod's
attitude follows from the tip: three equations d_i . R e_i = 0 in three angles, by Newton's method.
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
def _attitude_from(
    base_joints_M: FloatArray,
    platform_joints_P: FloatArray,
    revolute_axes_P: FloatArray,
    tip_M: FloatArray,
    tip_P: FloatArray,
    R: FloatArray,
    iterations: IntArray,
) -> int:
    """The tripod's attitude at a tip: Newton in three angles, from the guess in `R`, in place; returns the reason.

    With p = tip_M - R tip_P the equations are d_i . R e_i = (tip_M - a_i) . R e_i + (c_i - tip_P) . e_i = 0; their
    derivative by a rotation w about {M}'s axes is (R e_i x (tip_M - a_i)) . w.
    """
    J = np.empty((3, 3))
    x = np.empty(3)
    pivot = np.empty(3, np.int64)
    first_sign = 0.0
    sign = 0.0
    step = math.inf
    while step > 0.0:
        if iterations[0] == ITERATION_LIMIT:
            return NO_CONVERGENCE
        reach_mm = 0.0
        for i in range(3):
            ex, ey, ez = revolute_axes_P[i, 0], revolute_axes_P[i, 1], revolute_axes_P[i, 2]
            ax = R[0, 0] * ex + R[0, 1] * ey + R[0, 2] * ez
            ay = R[1, 0] * ex + R[1, 1] * ey + R[1, 2] * ez
            az = R[2, 0] * ex + R[2, 1] * ey + R[2, 2] * ez
            vx = tip_M[0] - base_joints_M[i, 0]
            vy = tip_M[1] - base_joints_M[i, 1]
            vz = tip_M[2] - base_joints_M[i, 2]
            reach_mm = max(reach_mm, math.sqrt(vx * vx + vy * vy + vz * vz))
            J[i, 0], J[i, 1], J[i, 2] = ay * vz - az * vy, az * vx - ax * vz, ax * vy - ay * vx
            x[i] = -(vx * ax + vy * ay + vz * az)
            for j in range(3):
                x[i] -= (platform_joints_P[i, j] - tip_P[j]) * revolute_axes_P[i, j]
        sign = lu_factor(J, pivot)
        if sign == 0.0:
            return NEAR_SINGULAR
        if iterations[0] == 0:
            first_sign = sign
        lu_solve(J, pivot, x)
        step = max_abs(x)
        shortened = STEP_LIMIT / max(step, STEP_LIMIT)
        rotate_in_place(R, shortened * x[0], shortened * x[1], shortened * x[2])
        iterations[0] += 1
        if step * reach_mm <= STEP_TOLERANCE_MM:
            step = 0.0
    orthonormalise(R)
    return OK if sign == first_sign else OTHER_ASSEMBLY


@helper
def _lengths_at(
    base_joints_M: FloatArray,
    platform_joints_P: FloatArray,
    revolute_axes_P: FloatArray,
    hinges: IntArray,
    origin_M: FloatArray,
    R: FloatArray,
    lengths_mm: FloatArray,
    residual_mm: FloatArray,
) -> int:
    """Link lengths at a pose, and whether the pose can be held there; returns the reason."""
    n = lengths_mm.shape[0]
    radius_mm = platform_radius(platform_joints_P)
    J = np.empty((6, 6))
    x = np.empty(6)
    pivot = np.empty(6, np.int64)
    if not radius_mm > 0.0:
        return NEAR_SINGULAR
    if not evaluate_closure(origin_M, R, base_joints_M, platform_joints_P, revolute_axes_P, hinges, radius_mm, x, J):
        return UNREACHABLE
    for i in range(n):
        lengths_mm[i] = x[i]
    residual_mm[0] = 0.0
    for i in range(n, 6):
        residual_mm[0] = max(residual_mm[0], abs(x[i]))
    if residual_mm[0] > RESIDUAL_TOLERANCE_MM:
        return NO_CONVERGENCE
    if lu_factor(J, pivot) == 0.0 or inverse_norm(J, np.empty((6, 6))) > AMPLIFICATION_LIMIT:
        return NEAR_SINGULAR
    return OK


@helper
def solve_inverse(
    base_joints_M: FloatArray,
    platform_joints_P: FloatArray,
    revolute_axes_P: FloatArray,
    hinges: IntArray,
    tip_M: FloatArray,
    tip_P: FloatArray,
    attitude_R: FloatArray,
    origin_M: FloatArray,
    R: FloatArray,
    lengths_mm: FloatArray,
    iterations: IntArray,
    residual_mm: FloatArray,
    reason: IntArray,
) -> None:
    """See `compd.model.kinematics.link_kinematics.inverse_kinematics`."""
    for i in range(3):
        for j in range(3):
            R[i, j] = attitude_R[i, j]
    iterations[0] = 0
    residual_mm[0] = math.nan
    reason[0] = OK
    if not (pose_is_finite(base_joints_M, platform_joints_P, revolute_axes_P, tip_M, R) and all_finite(tip_P)):
        reason[0] = NOT_FINITE
    elif revolute_axes_P.shape[0] == 3:
        reason[0] = _attitude_from(base_joints_M, platform_joints_P, revolute_axes_P, tip_M, tip_P, R, iterations)
        if reason[0] == OK and is_turned_over(R, attitude_R):
            reason[0] = OTHER_ASSEMBLY
    if reason[0] == OK:
        for i in range(3):
            origin_M[i] = tip_M[i] - (R[i, 0] * tip_P[0] + R[i, 1] * tip_P[1] + R[i, 2] * tip_P[2])
        reason[0] = _lengths_at(
            base_joints_M, platform_joints_P, revolute_axes_P, hinges, origin_M, R, lengths_mm, residual_mm
        )
    if reason[0] != OK:
        origin_M[:] = math.nan
        R[:, :] = math.nan
        lengths_mm[:] = math.nan


inverse = kernel(
    [MATRIX, MATRIX, MATRIX, INTEGER_ROWS, VECTOR, VECTOR, MATRIX, VECTOR, MATRIX, VECTOR, INTEGERS, VECTOR, INTEGERS],
    "(n,d),(n,d),(k,d),(k,c),(d),(d),(d,d)->(d),(d,d),(n),(),(),()",
)(solve_inverse)
