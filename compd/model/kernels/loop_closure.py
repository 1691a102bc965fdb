"""The closure of the links: what a pose makes of link lengths and revolute axes, and the derivatives.

A parallel machine is six equations for the six coordinates of its platform: n links and k hinges, n + k = 6. With
d_i = p + R c_i - a_i the link vector and u_i = d_i / |d_i|, the rows are

    |d_i|         for every link,                          d|d_i| = u_i . v + (R c_i x u_i) . w
    d_i . R e_h   for every hinge fixed to the platform,   d(d_i . R e_h) = R e_h . v + (R e_h x (p - a_i)) . w
    d_i . e_h     for every hinge fixed to the base,       d(d_i . e_h) = e_h . v + (R c_i x e_h) . w

for a displacement v and a rotation w of the platform about {M}'s axes through its origin. Hinge h belongs to link
i = hinges[h, 0]; hinges[h, 1] is 1 where its axis is fixed to the base (in {M}), 0 on the platform (in {P}).
"""

from __future__ import annotations

import math

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.jit import INTEGER_ROWS, INTEGERS, MATRIX, VECTOR, helper, kernel
from compd.linear import all_finite, rows_finite
from compd.model.kernels.reason_codes import NEAR_SINGULAR, NOT_FINITE, OK

# Two joint centres nearer than this coincide: the link between them has no direction.
MIN_LINK_MM = 1e-6


@helper
def evaluate_closure(
    origin_M: FloatArray,
    R: FloatArray,
    base_joints_M: FloatArray,
    platform_joints_P: FloatArray,
    revolute_axes: FloatArray,
    hinges: IntArray,
    radius_mm: float,
    value_mm: FloatArray,
    J: FloatArray,
) -> bool:
    """Rows (6,) of the closure at the pose (origin_M, R), and their derivatives J (6, 6).

    The unknowns are the platform's displacement in mm and its rotation about {M}'s axes times `radius_mm`, so that
    every entry of J is a pure number and one norm serves both. False where a link has no length.
    """
    n = base_joints_M.shape[0]
    k = revolute_axes.shape[0]
    for i in range(n):
        cx, cy, cz = platform_joints_P[i, 0], platform_joints_P[i, 1], platform_joints_P[i, 2]
        rx = R[0, 0] * cx + R[0, 1] * cy + R[0, 2] * cz
        ry = R[1, 0] * cx + R[1, 1] * cy + R[1, 2] * cz
        rz = R[2, 0] * cx + R[2, 1] * cy + R[2, 2] * cz
        dx = origin_M[0] + rx - base_joints_M[i, 0]
        dy = origin_M[1] + ry - base_joints_M[i, 1]
        dz = origin_M[2] + rz - base_joints_M[i, 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        if not length > MIN_LINK_MM:
            return False
        nx, ny, nz = dx / length, dy / length, dz / length
        value_mm[i] = length
        J[i, 0], J[i, 1], J[i, 2] = nx, ny, nz
        J[i, 3] = (ry * nz - rz * ny) / radius_mm
        J[i, 4] = (rz * nx - rx * nz) / radius_mm
        J[i, 5] = (rx * ny - ry * nx) / radius_mm
    for h in range(k):
        i = hinges[h, 0]
        ex, ey, ez = revolute_axes[h, 0], revolute_axes[h, 1], revolute_axes[h, 2]
        cx, cy, cz = platform_joints_P[i, 0], platform_joints_P[i, 1], platform_joints_P[i, 2]
        qx = origin_M[0] - base_joints_M[i, 0]
        qy = origin_M[1] - base_joints_M[i, 1]
        qz = origin_M[2] - base_joints_M[i, 2]
        if hinges[h, 1] == 1:
            rx = R[0, 0] * cx + R[0, 1] * cy + R[0, 2] * cz
            ry = R[1, 0] * cx + R[1, 1] * cy + R[1, 2] * cz
            rz = R[2, 0] * cx + R[2, 1] * cy + R[2, 2] * cz
            value_mm[n + h] = (qx + rx) * ex + (qy + ry) * ey + (qz + rz) * ez
            J[n + h, 0], J[n + h, 1], J[n + h, 2] = ex, ey, ez
            J[n + h, 3] = (ry * ez - rz * ey) / radius_mm
            J[n + h, 4] = (rz * ex - rx * ez) / radius_mm
            J[n + h, 5] = (rx * ey - ry * ex) / radius_mm
            continue
        ax = R[0, 0] * ex + R[0, 1] * ey + R[0, 2] * ez
        ay = R[1, 0] * ex + R[1, 1] * ey + R[1, 2] * ez
        az = R[2, 0] * ex + R[2, 1] * ey + R[2, 2] * ez
        # d . Re = (p - a) . Re + c . e: turning the platform leaves c . e as it is
        turning = cx * ex + cy * ey + cz * ez
        value_mm[n + h] = qx * ax + qy * ay + qz * az + turning
        J[n + h, 0], J[n + h, 1], J[n + h, 2] = ax, ay, az
        J[n + h, 3] = (ay * qz - az * qy) / radius_mm
        J[n + h, 4] = (az * qx - ax * qz) / radius_mm
        J[n + h, 5] = (ax * qy - ay * qx) / radius_mm
    return True


@helper
def platform_radius(platform_joints_P: FloatArray) -> float:
    """Root mean square distance of the platform joints from their centroid: what makes a rotation a length."""
    n = platform_joints_P.shape[0]
    total = 0.0
    for j in range(3):
        mean = 0.0
        for i in range(n):
            mean += platform_joints_P[i, j] / n
        for i in range(n):
            total += (platform_joints_P[i, j] - mean) ** 2
    return math.sqrt(total / n)


@helper
def pose_is_finite(
    base_joints_M: FloatArray,
    platform_joints_P: FloatArray,
    revolute_axes: FloatArray,
    origin_M: FloatArray,
    R: FloatArray,
) -> bool:
    """Whether all numbers of the mechanism and of a pose, or of a guess of one, are finite."""
    finite = rows_finite(base_joints_M) and rows_finite(platform_joints_P) and rows_finite(revolute_axes)
    return finite and rows_finite(R) and all_finite(origin_M)


@helper
def is_turned_over(R: FloatArray, guess_R: FloatArray) -> bool:
    """Whether R lies more than a right angle from the guess, about any axis: trace(R^T guess) = 1 + 2 cos < 1."""
    trace = 0.0
    for i in range(3):
        for j in range(3):
            trace += R[i, j] * guess_R[i, j]
    return trace < 1.0


@kernel(
    [MATRIX, MATRIX, MATRIX, INTEGER_ROWS, VECTOR, MATRIX, VECTOR, MATRIX, MATRIX, VECTOR, MATRIX, MATRIX, INTEGERS],
    "(n,d),(n,d),(k,d),(k,c),(d),(d,d)->(n),(n,d),(n,d),(k),(k,d),(k,d),()",
)
def closure(
    base_joints_M: FloatArray,
    platform_joints_P: FloatArray,
    revolute_axes: FloatArray,
    hinges: IntArray,
    origin_M: FloatArray,
    R: FloatArray,
    length_mm: FloatArray,
    length_by_displacement: FloatArray,
    length_by_rotation_mm: FloatArray,
    offset_mm: FloatArray,
    offset_by_displacement: FloatArray,
    offset_by_rotation_mm: FloatArray,
    reason: IntArray,
) -> None:
    """See `compd.model.kinematics.link_kinematics.closure_at`."""
    n = length_mm.shape[0]
    k = offset_mm.shape[0]
    value_mm = np.empty(6)
    J = np.empty((6, 6))
    reason[0] = OK
    if not pose_is_finite(base_joints_M, platform_joints_P, revolute_axes, origin_M, R):
        reason[0] = NOT_FINITE
    elif not evaluate_closure(origin_M, R, base_joints_M, platform_joints_P, revolute_axes, hinges, 1.0, value_mm, J):
        reason[0] = NEAR_SINGULAR
    if reason[0] != OK:
        value_mm[:] = math.nan
        J[:, :] = math.nan
    for i in range(n):
        length_mm[i] = value_mm[i]
        for j in range(3):
            length_by_displacement[i, j] = J[i, j]
            length_by_rotation_mm[i, j] = J[i, 3 + j]
    for i in range(k):
        offset_mm[i] = value_mm[n + i]
        for j in range(3):
            offset_by_displacement[i, j] = J[n + i, j]
            offset_by_rotation_mm[i, j] = J[n + i, 3 + j]
