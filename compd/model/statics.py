"""Forces in the links, for a load and the platform's weight, by virtual work.

With x the pose and J = d(l, o)/dx the closure's derivatives (`kernels.closure`), l the link lengths and o the offsets
of the revolute axes, a virtual displacement dx lets the load do the work W . dx and the links take J dx times their
forces. Equilibrium for every dx is

    J^T (axial, -lateral) = W,   W = (force, moment about the origin of {P}).

It is solved with moments divided by the platform's radius, so that all entries of J are pure numbers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from compd.arrays import FloatArray, IntArray
from compd.model.kernels.closure import evaluate_closure, platform_radius, pose_is_finite
from compd.model.kernels.jit import INTEGERS, MATRIX, VECTOR, kernel
from compd.model.kernels.linear import all_finite, inverse_norm, lu_factor, lu_solve
from compd.model.kernels.reason_codes import NEAR_SINGULAR, NOT_FINITE, OK
from compd.model.kinematics import Mechanism, check_mechanism
from compd.model.solve_status import AMPLIFICATION_LIMIT


class LinkForces(NamedTuple):
    """What the links carry.

    axial_N : (..., n), positive in tension.
    lateral_N : (..., k), along the revolute axis of link i, on the platform; empty for a hexapod.
    reason : (...), a Reason; where it is not OK the forces are nan.
    """

    axial_N: FloatArray
    lateral_N: FloatArray
    reason: IntArray


@kernel(
    [MATRIX, MATRIX, MATRIX, VECTOR, MATRIX, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR, INTEGERS],
    "(n,d),(n,d),(k,d),(d),(d,d),(d),(d),(),(d)->(n),(k),()",
)
def _forces(
    base_joints_M: FloatArray,
    platform_joints_P: FloatArray,
    revolute_axes_P: FloatArray,
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
    """See `link_forces`. The lateral force is that on the platform, which the constraint's multiplier opposes."""
    n = axial_N.shape[0]
    axial_N[:] = math.nan
    lateral_N[:] = math.nan
    radius_mm = platform_radius(platform_joints_P)
    load = all_finite(force_M) and all_finite(at_M) and all_finite(weight_N) and all_finite(weight_at_P)
    if not (load and pose_is_finite(base_joints_M, platform_joints_P, revolute_axes_P, origin_M, R)):
        reason[0] = NOT_FINITE
        return
    J = np.empty((6, 6))
    x = np.empty(6)
    pivot = np.empty(6, np.int64)
    reason[0] = NEAR_SINGULAR
    if not radius_mm > 0.0:
        return
    if not evaluate_closure(origin_M, R, base_joints_M, platform_joints_P, revolute_axes_P, radius_mm, x, J):
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


def link_forces(
    mechanism: Mechanism,
    origin_M_mm: ArrayLike,
    rotation_M_P: ArrayLike,
    force_M_N: ArrayLike,
    at_M_mm: ArrayLike,
    weight_N: ArrayLike,
    weight_at_P_mm: ArrayLike,
) -> LinkForces:
    """Equilibrium of the moving platform (module docstring). Links weigh nothing; weight pulls along -z of {M}.

    A link's force passes through its base joint, a sphere, in the plane of the link and its revolute axis: so it has
    an axial part and, on the tripod, one lateral part along the revolute axis, which is square to the link.

    origin_M_mm (..., 3), rotation_M_P (..., 3, 3): the pose.  force_M_N (..., 3): the external force on whatever the
    platform carries, acting at at_M_mm (..., 3).  weight_N (...): the platform's, at weight_at_P_mm (..., 3).
    A row fails as NOT_FINITE, or NEAR_SINGULAR where finite link forces cannot hold the load.

    Example: the tripod at machine zero carries its platform of 80 N alone. Its links lean by 450 mm down on a length of
    481.04 mm, so that each pulls with 80 / 3 x 481.04 / 450 = 28.5 N, and no lateral force is left.
    Raises ValueError for arrays of a wrong shape.
    """
    return LinkForces(
        *_forces(*check_mechanism(mechanism), origin_M_mm, rotation_M_P, force_M_N, at_M_mm, weight_N, weight_at_P_mm)
    )
