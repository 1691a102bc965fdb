"""Inverse kinematics: from the place of the tip to the pose and the actuators, of every machine.

The inverse solves the closure for the m actuators and the 6 - m coordinates of the platform that the target leaves
free, by Newton's method: six equations for six unknowns. Where each link has an actuator of its own that extends it,
the actuators follow from each pose: a hexapod takes no step.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.jit import INTEGER_ROWS, INTEGERS, MATRIX, VECTOR, helper, kernel
from compd.linear import all_finite, inverse_norm, lu_factor, lu_solve, max_abs
from compd.model.kernels.actuated_links import closure_by_actuators
from compd.model.kernels.loop_closure import evaluate_closure, is_turned_over, platform_radius, pose_is_finite
from compd.model.kernels.reason_codes import NEAR_SINGULAR, NO_CONVERGENCE, NOT_FINITE, OK, OTHER_ASSEMBLY, UNREACHABLE
from compd.model.kernels.solve_status import (
    AMPLIFICATION_LIMIT,
    ITERATION_LIMIT,
    RESIDUAL_TOLERANCE_MM,
    STEP_LIMIT,
    STEP_TOLERANCE_MM,
)
from compd.model.kernels.standing_machine import place_with_added
from compd.model.structures import INVERSE
from compd.rotation import orthonormalise, rotate_in_place


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
def inverse_standing(
    model: Any,
    machine: Any,
    tip_M_mm: FloatArray,
    tip_P_mm: FloatArray,
    attitude_M_P: FloatArray,
    same_pose: bool,
    pose: Any,
) -> None:
    """The pose and the actuators that bring the tip to its target; pose.actuator_mm : where they are about.

    same_pose : `pose` reaches this target on a machine that differs in nothing but its links' lengths.
    """
    if not (same_pose and model.extends_each):
        _solve(model, machine, tip_M_mm, tip_P_mm, attitude_M_P, pose)
    for i in range(model.links if model.extends_each else 0):
        rod_length_mm = model.rod_length_mm[i] + machine.reading_to_length_mm[i] - machine.joint_shortening_mm[i]
        pose.actuator_mm[model.of_link[i]] = pose.link_length_mm[i] - rod_length_mm


@helper
def _solve(model: Any, machine: Any, tip_M: FloatArray, tip_P: FloatArray, attitude_R: FloatArray, pose: Any) -> None:
    """As `inverse_standing`, but for the actuators that each extend a link of their own."""
    n, m, k, extends_each = model.links, model.scales, model.axes, model.extends_each == 1
    base_joints_M, platform_joints_P = pose.base_joints_M_mm[:n], machine.platform_joints_P_mm[:n]
    axes, hinges, lengths_mm = machine.revolute_axes_P[:k], model.hinges[:k], pose.link_length_mm
    origin_M, R, iterations, reason = pose.origin_M_mm, pose.rotation_M_P, pose.iterations, pose.reason
    R[:, :] = attitude_R
    iterations[0], pose.residual_mm[0] = 0, math.nan
    size_mm, size = platform_radius(platform_joints_P), 6 - n if extends_each else 6
    place, value, pivot = machine.place_M_mm, machine.closure_mm[:], machine.pivot[:]
    J, X, M = machine.jacobian[:], machine.factored[:], machine.factored[:size, :size]
    place[:] = tip_M
    place_with_added(model, machine, pose)
    finite = pose_is_finite(base_joints_M, platform_joints_P, axes, tip_M, R)
    finite &= all_finite(tip_P) and all_finite(pose.actuator_mm[:m]) and all_finite(lengths_mm[:n])
    reason[0] = (OK if size_mm > 0.0 else NEAR_SINGULAR) if finite else NOT_FINITE
    step, sign, first_sign = math.inf if size > 0 else 0.0, 0.0, 0.0
    while reason[0] == OK:
        _origin_at(place, R, tip_P, origin_M)
        if not evaluate_closure(origin_M, R, base_joints_M, platform_joints_P, axes, hinges, size_mm, value, J):
            reason[0] = UNREACHABLE
            break
        for i in range(n):
            lengths_mm[i] = value[i] if extends_each else lengths_mm[i]
            value[i] -= lengths_mm[i]
        if step <= STEP_TOLERANCE_MM:
            break
        if not extends_each:
            closure_by_actuators(model, machine, pose.actuator_mm, J, M[:, 6 - m :])
        _rows_by_tip(J, R, tip_P, size_mm)
        sign = _free_step(J, model.fixed, M, pivot, value)
        first_sign = sign if iterations[0] == 0 else first_sign
        step = _move_freely(model.fixed, value, size_mm, place, R, pose.actuator_mm, J)
        if not extends_each:
            place_with_added(model, machine, pose)
        iterations[0] += 1
        if sign == 0.0 or (iterations[0] == ITERATION_LIMIT and step > STEP_TOLERANCE_MM):
            reason[0] = NEAR_SINGULAR if sign == 0.0 else NO_CONVERGENCE
    if reason[0] == OK:
        if iterations[0] > 0:
            orthonormalise(R)
        pose.residual_mm[0] = max_abs(value)
        held = lu_factor(J, pivot) != 0.0 and inverse_norm(J, X) <= AMPLIFICATION_LIMIT
        same = sign == first_sign and not is_turned_over(R, attitude_R)
        reason[0] = (OK if same else OTHER_ASSEMBLY) if held else NEAR_SINGULAR
        reason[0] = reason[0] if pose.residual_mm[0] <= RESIDUAL_TOLERANCE_MM else NO_CONVERGENCE
    if reason[0] != OK:
        origin_M[:] = pose.actuator_mm[:] = lengths_mm[:] = math.nan
        R[:, :] = pose.base_joints_M_mm[:, :] = math.nan


@kernel(
    [
        *[MATRIX, MATRIX, MATRIX, INTEGER_ROWS, INTEGERS, MATRIX, MATRIX, VECTOR, INTEGERS, VECTOR, INTEGERS],
        *[VECTOR, VECTOR, MATRIX, VECTOR, VECTOR, MATRIX, VECTOR, VECTOR, MATRIX, INTEGERS, VECTOR, INTEGERS],
    ],
    "(n,d),(n,d),(k,d),(k,c),(m),(m,d),(m,d),(m),(n),(n),(s),(d),(d),(d,d),(m)->(d),(d,d),(m),(n),(n,d),(),(),()",
)
def inverse(
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
    n, m, k = actuator_of_link.shape[0], kinds.shape[0], revolute_axes.shape[0]
    rooms: Any = np.empty(1, INVERSE)
    for room in rooms:  # which keeps the array
        model, machine, pose = room.model, room.machine, room.pose
        model.links, model.scales, model.axes = n, m, k
        model.extends_each = 1 if n == m and not kinds.any() else 0
        model.hinges[:k] = hinges
        model.kinds[:m] = kinds
        model.radius_mm[:m] = radius_mm
        model.of_link[:n] = actuator_of_link
        model.rod_length_mm[:n] = rod_length_mm
        model.fixed[:] = fixed
        machine.base_joints_M_mm[:n] = base_joints_M
        machine.platform_joints_P_mm[:n] = platform_joints_P
        machine.revolute_axes_P[:k] = revolute_axes
        machine.cosine_M[:m] = cosine_M
        machine.sine_M[:m] = sine_M
        machine.reading_to_length_mm[:] = machine.joint_shortening_mm[:] = 0.0
        pose.actuator_mm[:m] = guess_mm
        inverse_standing(model, machine, tip_M, tip_P, attitude_R, False, pose)
        origin_M[:] = pose.origin_M_mm
        R[:, :] = pose.rotation_M_P
        actuator_mm[:] = pose.actuator_mm[:m]
        lengths_mm[:] = pose.link_length_mm[:n]
        joints_M[:, :] = pose.base_joints_M_mm[:n]
        iterations[0], residual_mm[0], reason[0] = pose.iterations[0], pose.residual_mm[0], pose.reason[0]
