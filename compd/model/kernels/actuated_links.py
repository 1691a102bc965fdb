"""Actuators that extend links or move base joints, and the inverse kinematics of a machine with them.

With q the place of an actuator in mm and u, v unit vectors in {M}, the base joint and the length of its links are

    EXTENDS    a = a0,                                            l = l0 + q
    SLIDES     a = a0 + q u,                                      l = l0
    TURNS      a = a0 + radius (cos(q/radius) u + sin(q/radius) v),   l = l0

(q of a turning actuator is the arc, radius times the angle). The inverse solves the closure for the m actuators and the
6 - m coordinates of the platform that the target leaves free, by Newton's method: six equations for six unknowns. Where
each link has an actuator of its own that extends it, the actuators follow from each pose: a hexapod takes no step.
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

EXTENDS, SLIDES, TURNS = range(3)


@helper
def place_links(
    kinds: IntArray,
    cosine_M: FloatArray,
    sine_M: FloatArray,
    radius_mm: FloatArray,
    actuator_of_link: IntArray,
    base_joints_M: FloatArray,
    rod_length_mm: FloatArray,
    actuator_mm: FloatArray,
    joints_M: FloatArray,
    lengths_mm: FloatArray,
) -> None:
    """Base joints (n, 3) and link lengths (n,) with the actuators at actuator_mm (m,); base_joints_M : at q = 0.

    See `compd.model.kinematics.actuators.links_at`.
    """
    for i in range(actuator_of_link.shape[0]):
        a = actuator_of_link[i]
        q = actuator_mm[a]
        lengths_mm[i] = rod_length_mm[i] + (q if kinds[a] == EXTENDS else 0.0)
        for j in range(3):
            joints_M[i, j] = base_joints_M[i, j]
            if kinds[a] == SLIDES:
                joints_M[i, j] += q * cosine_M[a, j]
            elif kinds[a] == TURNS:
                angle = q / radius_mm[a]
                joints_M[i, j] += radius_mm[a] * (math.cos(angle) * cosine_M[a, j] + math.sin(angle) * sine_M[a, j])


@helper
def closure_by_actuators(
    kinds: IntArray,
    cosine_M: FloatArray,
    sine_M: FloatArray,
    radius_mm: FloatArray,
    actuator_of_link: IntArray,
    hinges: IntArray,
    actuator_mm: FloatArray,
    J: FloatArray,
    by_actuator: FloatArray,
) -> None:
    """Derivatives (6, m) of the closure's rows, |d_i| - l_i and the offsets of the hinges, by the actuators.

    J : (6, 6) of `evaluate_closure`; its first three columns are the rows' directions.
    """
    n = actuator_of_link.shape[0]
    by_actuator[:, :] = 0.0
    for row in range(6):
        a = actuator_of_link[row] if row < n else actuator_of_link[hinges[row - n, 0]]
        if kinds[a] == EXTENDS:
            by_actuator[row, a] = -1.0 if row < n else 0.0
            continue
        angle = actuator_mm[a] / radius_mm[a] if kinds[a] == TURNS else 0.0
        for j in range(3):
            along = cosine_M[a, j]
            if kinds[a] == TURNS:
                along = math.cos(angle) * sine_M[a, j] - math.sin(angle) * cosine_M[a, j]
            by_actuator[row, a] -= J[row, j] * along


@helper
def _rows_by_tip(J: FloatArray, R: FloatArray, tip_P: FloatArray, radius_mm: float) -> None:
    """J (6, 6) by the displacement of the tip and the rotation about it, in place of those of the origin of {P}."""
    rx = (R[0, 0] * tip_P[0] + R[0, 1] * tip_P[1] + R[0, 2] * tip_P[2]) / radius_mm
    ry = (R[1, 0] * tip_P[0] + R[1, 1] * tip_P[1] + R[1, 2] * tip_P[2]) / radius_mm
    rz = (R[2, 0] * tip_P[0] + R[2, 1] * tip_P[1] + R[2, 2] * tip_P[2]) / radius_mm
    for i in range(6):
        J[i, 3] -= ry * J[i, 2] - rz * J[i, 1]
        J[i, 4] -= rz * J[i, 0] - rx * J[i, 2]
        J[i, 5] -= rx * J[i, 1] - ry * J[i, 0]


@helper
def _origin_at(tip_M: FloatArray, R: FloatArray, tip_P: FloatArray, origin_M: FloatArray) -> None:
    for i in range(3):
        origin_M[i] = tip_M[i] - (R[i, 0] * tip_P[0] + R[i, 1] * tip_P[1] + R[i, 2] * tip_P[2])


@helper
def _free_step(J: FloatArray, fixed: IntArray, M: FloatArray, pivot: IntArray, x: FloatArray) -> float:
    """Solve the last rows for the free coordinates and, where M has all rows, for the actuators.

    M : (size, size), that has the derivatives by the actuators behind.  x (6,) : the rows, in place the step by the
    coordinates, and then by the actuators.  Returns the determinant's sign.
    """
    first, column = 6 - M.shape[0], 0
    for i in range(6):
        x[i] = -x[first + i] if first + i < 6 else 0.0
    for c in range(6):
        if fixed[c] == 0:
            for i in range(M.shape[0]):
                M[i, column] = J[first + i, c]
            column += 1
    sign = lu_factor(M, pivot)
    if sign != 0.0:
        lu_solve(M, pivot, x)
    return sign


@helper
def _move_freely(
    fixed: IntArray,
    x: FloatArray,
    size_mm: float,
    place: FloatArray,
    R: FloatArray,
    actuator_mm: FloatArray,
    moved: FloatArray,
) -> float:
    """Take the step x of `_free_step`, a long one shortened; returns its length.  moved (1, 6) : room."""
    step = max_abs(x)
    share = STEP_LIMIT * size_mm / max(step, STEP_LIMIT * size_mm)
    column = 0
    for c in range(6):
        moved[0, c] = 0.0
        if fixed[c] == 0:
            moved[0, c] = share * x[column]
            column += 1
    for c in range(3):
        place[c] += moved[0, c]
    rotate_in_place(R, moved[0, 3] / size_mm, moved[0, 4] / size_mm, moved[0, 5] / size_mm)
    for i in range(column, 6):
        actuator_mm[i - column] += share * x[i]
    return step


@helper
def extend(
    actuator_of_link: IntArray, rod_length_mm: FloatArray, lengths_mm: FloatArray, actuator_mm: FloatArray
) -> None:
    """Set actuators that each extend one link of their own to the links' lengths."""
    for i in range(actuator_of_link.shape[0]):
        actuator_mm[actuator_of_link[i]] = lengths_mm[i] - rod_length_mm[i]


@helper
def solve_inverse(
    base_joints_M: FloatArray,
    platform_joints_P: FloatArray,
    revolute_axes: FloatArray,
    hinges: IntArray,
    kinds: IntArray,
    cosine_M: FloatArray,
    sine_M: FloatArray,
    radius_mm: FloatArray,
    actuator_of_link: IntArray,
    rod_length_mm: FloatArray,
    fixed: IntArray,
    tip_M: FloatArray,
    tip_P: FloatArray,
    attitude_R: FloatArray,
    guess_mm: FloatArray,
    origin_M: FloatArray,
    R: FloatArray,
    actuator_mm: FloatArray,
    lengths_mm: FloatArray,
    joints_M: FloatArray,
    iterations: IntArray,
    residual_mm: FloatArray,
    reason: IntArray,
) -> None:
    """See `compd.model.kinematics.actuators.inverse_kinematics`."""
    n, m = actuator_of_link.shape[0], kinds.shape[0]
    extends_each = n == m
    for a in range(m):
        actuator_mm[a] = guess_mm[a]
        extends_each &= kinds[a] == EXTENDS
    R[:, :] = attitude_R
    iterations[0], residual_mm[0] = 0, math.nan
    size_mm = platform_radius(platform_joints_P)
    place, value, pivot = tip_M.copy(), np.empty(6), np.empty(6, np.int64)
    J, size = np.empty((6, 6)), 6 - n if extends_each else 6
    M = np.empty((size, size))
    finite = pose_is_finite(base_joints_M, platform_joints_P, revolute_axes, tip_M, R)
    finite &= all_finite(tip_P) and all_finite(guess_mm) and all_finite(rod_length_mm)
    reason[0] = (OK if size_mm > 0.0 else NEAR_SINGULAR) if finite else NOT_FINITE
    step, sign, first_sign = math.inf if size > 0 else 0.0, 0.0, 0.0
    while reason[0] == OK:
        _origin_at(place, R, tip_P, origin_M)
        if iterations[0] == 0 or not extends_each:
            place_links(
                kinds, cosine_M, sine_M, radius_mm, actuator_of_link, base_joints_M, rod_length_mm, actuator_mm,
                joints_M, lengths_mm,
            )  # fmt: skip
        if not evaluate_closure(origin_M, R, joints_M, platform_joints_P, revolute_axes, hinges, size_mm, value, J):
            reason[0] = UNREACHABLE
            break
        for i in range(n):
            lengths_mm[i] = value[i] if extends_each else lengths_mm[i]
            value[i] -= lengths_mm[i]
        if step <= STEP_TOLERANCE_MM:
            break
        if not extends_each:
            free = 6 - m
            closure_by_actuators(
                kinds, cosine_M, sine_M, radius_mm, actuator_of_link, hinges, actuator_mm, J, M[:, free:]
            )
        _rows_by_tip(J, R, tip_P, size_mm)
        sign = _free_step(J, fixed, M, pivot, value)
        first_sign = sign if iterations[0] == 0 else first_sign
        step = _move_freely(fixed, value, size_mm, place, R, actuator_mm, J)
        iterations[0] += 1
        if sign == 0.0 or (iterations[0] == ITERATION_LIMIT and step > STEP_TOLERANCE_MM):
            reason[0] = NEAR_SINGULAR if sign == 0.0 else NO_CONVERGENCE
    if reason[0] == OK:
        if extends_each:
            extend(actuator_of_link, rod_length_mm, lengths_mm, actuator_mm)
        if iterations[0] > 0:
            orthonormalise(R)
        residual_mm[0] = max_abs(value)
        held = lu_factor(J, pivot) != 0.0 and inverse_norm(J, np.empty((6, 6))) <= AMPLIFICATION_LIMIT
        same = sign == first_sign and not is_turned_over(R, attitude_R)
        reason[0] = (OK if same else OTHER_ASSEMBLY) if held else NEAR_SINGULAR
        reason[0] = reason[0] if residual_mm[0] <= RESIDUAL_TOLERANCE_MM else NO_CONVERGENCE
    if reason[0] != OK:
        origin_M[:] = actuator_mm[:] = lengths_mm[:] = math.nan
        R[:, :] = joints_M[:, :] = math.nan


inverse = kernel(
    [
        *[MATRIX, MATRIX, MATRIX, INTEGER_ROWS, INTEGERS, MATRIX, MATRIX, VECTOR, INTEGERS, VECTOR, INTEGERS],
        *[VECTOR, VECTOR, MATRIX, VECTOR, VECTOR, MATRIX, VECTOR, VECTOR, MATRIX, INTEGERS, VECTOR, INTEGERS],
    ],
    "(n,d),(n,d),(k,d),(k,c),(m),(m,d),(m,d),(m),(n),(n),(s),(d),(d),(d,d),(m)->(d),(d,d),(m),(n),(n,d),(),(),()",
)(solve_inverse)


placed_links = kernel(
    [INTEGERS, MATRIX, MATRIX, VECTOR, INTEGERS, MATRIX, VECTOR, VECTOR, MATRIX, VECTOR],
    "(m),(m,d),(m,d),(m),(n),(n,d),(n),(m)->(n,d),(n)",
)(place_links)
