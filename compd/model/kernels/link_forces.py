"""Link forces as a kernel: equilibrium of the moving platform by virtual work; see `compd.model.kinematics.statics`."""

from __future__ import annotations

import math

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.jit import INTEGER_ROWS, INTEGERS, MATRIX, VECTOR, helper, kernel
from compd.linear import all_finite, inverse_norm, lu_factor, lu_solve
from compd.model.kernels.loop_closure import evaluate_closure, platform_radius, pose_is_finite
from compd.model.kernels.reason_codes import NEAR_SINGULAR, NOT_FINITE, OK
from compd.model.kernels.solve_status import AMPLIFICATION_LIMIT
from compd.model.structures import EffectMachine, EffectRow


@helper
def solve_forces(
    base_joints_M: FloatArray,
    platform_joints_P: FloatArray,
    revolute_axes: FloatArray,
    hinges: IntArray,
    origin_M: FloatArray,
    R: FloatArray,
    force_M: FloatArray,
    at_M: FloatArray,
    weight_N: FloatArray,
    weight_at_P: FloatArray,
    axial_N: FloatArray,
    lateral_N: FloatArray,
    reason: IntArray,
) -> None:
    """See `compd.model.kinematics.statics.link_forces`.

    The lateral force is that on the platform, which the constraint's multiplier opposes.
    """
    n = axial_N.shape[0]
    axial_N[:] = math.nan
    lateral_N[:] = math.nan
    radius_mm = platform_radius(platform_joints_P)
    load = all_finite(force_M) and all_finite(at_M) and all_finite(weight_N) and all_finite(weight_at_P)
    if not (load and pose_is_finite(base_joints_M, platform_joints_P, revolute_axes, origin_M, R)):
        reason[0] = NOT_FINITE
        return
    J = np.empty((6, 6))
    x = np.empty(6)
    pivot = np.empty(6, np.int64)
    reason[0] = NEAR_SINGULAR
    if not radius_mm > 0.0:
        return
    if not evaluate_closure(origin_M, R, base_joints_M, platform_joints_P, revolute_axes, hinges, radius_mm, x, J):
        return
    for i in range(6):  # J^T
        for j in range(i):
            J[i, j], J[j, i] = J[j, i], J[i, j]
    if lu_factor(J, pivot) == 0.0 or inverse_norm(J, np.empty((6, 6))) > AMPLIFICATION_LIMIT:
        return
    # arms of the load and of the weight about the origin of {P}, along {M}'s axes
    rx, ry, rz = at_M[0] - origin_M[0], at_M[1] - origin_M[1], at_M[2] - origin_M[2]
    wx = R[0, 0] * weight_at_P[0] + R[0, 1] * weight_at_P[1] + R[0, 2] * weight_at_P[2]
    wy = R[1, 0] * weight_at_P[0] + R[1, 1] * weight_at_P[1] + R[1, 2] * weight_at_P[2]
    x[0], x[1], x[2] = force_M[0], force_M[1], force_M[2] - weight_N[0]
    x[3] = (ry * force_M[2] - rz * force_M[1] - wy * weight_N[0]) / radius_mm
    x[4] = (rz * force_M[0] - rx * force_M[2] + wx * weight_N[0]) / radius_mm
    x[5] = (rx * force_M[1] - ry * force_M[0]) / radius_mm
    lu_solve(J, pivot, x)
    for i in range(n):
        axial_N[i] = x[i]
    for i in range(n, 6):
        lateral_N[i - n] = -x[i]
    reason[0] = OK


forces = kernel(
    [MATRIX, MATRIX, MATRIX, INTEGER_ROWS, VECTOR, MATRIX, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, INTEGERS],
    "(n,d),(n,d),(k,d),(k,c),(d),(d,d),(d),(d),(),(d)->(n),(k),()",
)(solve_forces)


@helper
def axial_force_at_zero(machine: EffectMachine, force_M_N: FloatArray, i: int) -> float:
    """Axial force in link i at machine zero, from the platform's weight and the external force (3,) there."""
    by_force = machine.zero_axial_per_force[i]
    of_force_N = by_force[0] * force_M_N[0] + by_force[1] * force_M_N[1] + by_force[2] * force_M_N[2]
    return machine.zero_axial_force_N[i] + of_force_N  # type: ignore[no-any-return]


@helper
def set_axial_forces(row: EffectRow, machine: EffectMachine, force_M_N: FloatArray, axial_N: FloatArray) -> None:
    """Axial link forces (n,) from the external force at the tip and the platform's weight; nan where none hold it."""
    weight_N = np.full(1, machine.weight_N)
    lateral_N = np.empty(machine.axes)
    reason = np.empty(1, np.int64)
    solve_forces(
        row.base_joints_M_mm[: machine.links],
        machine.platform_joints_P_mm[: machine.links],
        machine.revolute_axes_P[: machine.axes],
        machine.hinges[: machine.axes],
        row.origin_M_mm,
        row.rotation_M_P,
        force_M_N,
        row.tip_M_mm,
        weight_N,
        machine.weight_at_P_mm,
        axial_N,
        lateral_N,
        reason,
    )
