"""The frame from nine distances, as one kernel: supports, {B}, the base joints, and how {B} has moved.

Six reference points, m1..m3 on the surface plate and b1..b3 on the base platform, span an octahedron (paper, figures 7
and 8); nine of its twelve edges are measured, the other three lie in the plate. Equation (3) and its triangle b1 b2 b3,

    |b_i - b_j| = t,  |b_i - m_j| = u    (nine equations),

is solved for the nine coordinates of b1..b3 by Newton's method,

    b <- b + c J^-1 (measured - computed),   J = d(lengths)/d(b1, b2, b3)   (9 x 9, pure numbers),

where c <= 1 shortens a step that is longer than STEP_LIMIT times the shortest edge. Three checks follow:

- amplification |J^-1| (Frobenius norm) at most AMPLIFICATION_LIMIT: root of the sum of squares of the supports' errors
  for independent errors of one unit on each distance; 4.6 for the tripod at machine zero;
- det J has the same sign at guess and solution: between two assemblies lies a singular one, where it changes;
- {B} is not farther from machine zero than FURTHEST.
"""

from __future__ import annotations

import math

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.jit import INTEGERS, MATRIX, VECTOR, helper, kernel
from compd.linear import all_finite, inverse_norm, lu_factor, lu_solve, max_abs, rows_finite
from compd.model.kernels.reason_codes import NEAR_SINGULAR, NO_CONVERGENCE, NOT_FINITE, OK, OTHER_ASSEMBLY, UNREACHABLE
from compd.model.kernels.solve_status import (
    AMPLIFICATION_LIMIT,
    ITERATION_LIMIT,
    RESIDUAL_TOLERANCE_MM,
    STEP_LIMIT,
    STEP_TOLERANCE_MM,
)
from compd.rotation import set_rotation_vector

# Equation (3): distance u_k runs from support k // 2 to this plate point.
PLATE_POINT_OF_DISTANCE = (0, 2, 0, 1, 1, 2)

# Frames deform by micrometres, the softest by millimetres. One found further from machine zero than this fraction of
# its size, or this many radians, is another assembly: a mirror image, or legs crossed.
FURTHEST = 0.1

# Two reference points nearer than this coincide: the edge between them has no direction.
MIN_EDGE_MM = 1e-6


@helper
def edge_lengths(supports_M: FloatArray, plate_points_M: FloatArray, lengths_mm: FloatArray, J: FloatArray) -> bool:
    """Lengths t1..t3, u1..u6 (9,) of the edges, equation (3), and their derivatives J (9, 9) by b1, b2, b3.

    Row e of J holds the unit vector of edge e: positive at its near support, negative at its far one if that is a
    support too.
    False where two points coincide.
    """
    for i in range(9):
        for j in range(9):
            J[i, j] = 0.0
    for edge in range(9):
        if edge < 3:
            near, far = edge, (edge + 1) % 3
            x = supports_M[near, 0] - supports_M[far, 0]
            y = supports_M[near, 1] - supports_M[far, 1]
            z = supports_M[near, 2] - supports_M[far, 2]
        else:
            near, far = (edge - 3) // 2, PLATE_POINT_OF_DISTANCE[edge - 3]
            x = supports_M[near, 0] - plate_points_M[far, 0]
            y = supports_M[near, 1] - plate_points_M[far, 1]
            z = supports_M[near, 2] - plate_points_M[far, 2]
        length = math.sqrt(x * x + y * y + z * z)
        if not length > MIN_EDGE_MM:
            return False
        x, y, z = x / length, y / length, z / length
        lengths_mm[edge] = length
        J[edge, 3 * near], J[edge, 3 * near + 1], J[edge, 3 * near + 2] = x, y, z
        if edge < 3:
            J[edge, 3 * far], J[edge, 3 * far + 1], J[edge, 3 * far + 2] = -x, -y, -z
    return True


@helper
def place_base(supports_M: FloatArray, R: FloatArray, origin_M: FloatArray) -> bool:
    """{B} by its convention: origin in the centroid, z_B along (b2-b1) x (b3-b1), y_B from the origin to b1.

    supports_M (3, 3) -> R (3, 3), its columns x_B, y_B, z_B in {M}, and origin_M (3,).

    False where the supports lie on one line.
    """
    for j in range(3):
        origin_M[j] = (supports_M[0, j] + supports_M[1, j] + supports_M[2, j]) / 3.0
        R[j, 0] = supports_M[1, j] - supports_M[0, j]
        R[j, 1] = supports_M[0, j] - origin_M[j]
        R[j, 2] = supports_M[2, j] - supports_M[0, j]
    zx = R[1, 0] * R[2, 2] - R[2, 0] * R[1, 2]
    zy = R[2, 0] * R[0, 2] - R[0, 0] * R[2, 2]
    zz = R[0, 0] * R[1, 2] - R[1, 0] * R[0, 2]
    yx, yy, yz = R[0, 1], R[1, 1], R[2, 1]
    y_length = math.sqrt(yx * yx + yy * yy + yz * yz)
    z_length = math.sqrt(zx * zx + zy * zy + zz * zz)
    # the area of the triangle over its height is a side
    if not z_length > MIN_EDGE_MM * y_length:
        return False
    yx, yy, yz = yx / y_length, yy / y_length, yz / y_length
    zx, zy, zz = zx / z_length, zy / z_length, zz / z_length
    R[0, 0], R[1, 0], R[2, 0] = yy * zz - yz * zy, yz * zx - yx * zz, yx * zy - yy * zx
    R[0, 1], R[1, 1], R[2, 1] = yx, yy, yz
    R[0, 2], R[1, 2], R[2, 2] = zx, zy, zz
    return True


@helper
def _edges_can_close(lengths_mm: FloatArray, plate_points_M: FloatArray) -> bool:
    """The four triangles that the edges form with each other and with the plate obey the triangle inequality."""
    t1, t2, t3 = lengths_mm[0], lengths_mm[1], lengths_mm[2]
    if t1 > t2 + t3 or t2 > t3 + t1 or t3 > t1 + t2:
        return False
    for i in range(3):
        m, n = PLATE_POINT_OF_DISTANCE[2 * i], PLATE_POINT_OF_DISTANCE[2 * i + 1]
        x = plate_points_M[m, 0] - plate_points_M[n, 0]
        y = plate_points_M[m, 1] - plate_points_M[n, 1]
        z = plate_points_M[m, 2] - plate_points_M[n, 2]
        side = math.sqrt(x * x + y * y + z * z)
        u, v = lengths_mm[3 + 2 * i], lengths_mm[4 + 2 * i]
        if side > u + v or u > side + v or v > side + u:
            return False
    return True


@helper
def _input_reason(lengths_mm: FloatArray, plate_points_M: FloatArray, guess_supports_M: FloatArray) -> int:
    if not (all_finite(lengths_mm) and rows_finite(guess_supports_M) and rows_finite(plate_points_M)):
        return NOT_FINITE
    return OK if np.min(lengths_mm) > 0.0 else UNREACHABLE


@helper
def _newton(
    lengths_mm: FloatArray, plate_points_M: FloatArray, supports_M: FloatArray, iterations: IntArray, J: FloatArray
) -> int:
    """Newton in the nine coordinates of the supports, from the guess in `supports_M`, in place; leaves J factored."""
    limit_mm = STEP_LIMIT * np.min(lengths_mm)
    x = np.empty(9)
    pivot = np.empty(9, np.int64)
    first_sign = 0.0
    sign = 0.0
    step = math.inf
    while step > STEP_TOLERANCE_MM:
        if iterations[0] == ITERATION_LIMIT:
            return NO_CONVERGENCE
        if not edge_lengths(supports_M, plate_points_M, x, J):
            return NEAR_SINGULAR
        for i in range(9):
            x[i] = lengths_mm[i] - x[i]
        sign = lu_factor(J, pivot)
        if iterations[0] == 0:
            first_sign = sign
        if sign == 0.0:
            return NEAR_SINGULAR
        lu_solve(J, pivot, x)
        step = max_abs(x)
        shortened = limit_mm / max(step, limit_mm)
        for i in range(3):
            for j in range(3):
                supports_M[i, j] += shortened * x[3 * i + j]
        iterations[0] += 1
    # between two assemblies lies a singular one, where the determinant changes its sign
    return OK if sign == first_sign else OTHER_ASSEMBLY


@helper
def _supports_from(
    lengths_mm: FloatArray,
    plate_points_M: FloatArray,
    supports_M: FloatArray,
    iterations: IntArray,
    residual_mm: FloatArray,
) -> int:
    """Solve from the guess in `supports_M`, in place, and check the solution; returns the reason."""
    reason = _input_reason(lengths_mm, plate_points_M, supports_M)
    if reason != OK:
        return reason
    J = np.empty((9, 9))
    X = np.empty((9, 9))
    reason = _newton(lengths_mm, plate_points_M, supports_M, iterations, J)
    if reason in (NO_CONVERGENCE, NEAR_SINGULAR):
        return reason if _edges_can_close(lengths_mm, plate_points_M) else UNREACHABLE
    if inverse_norm(J, X) > AMPLIFICATION_LIMIT:
        return NEAR_SINGULAR
    x = X[0]
    if not edge_lengths(supports_M, plate_points_M, x, J):
        return NEAR_SINGULAR
    for i in range(9):
        x[i] -= lengths_mm[i]
    residual_mm[0] = max_abs(x)
    return NO_CONVERGENCE if residual_mm[0] > RESIDUAL_TOLERANCE_MM else reason


@helper
def _compare(
    origin_M: FloatArray,
    R: FloatArray,
    zero_origin_M: FloatArray,
    zero_R: FloatArray,
    displacement_M: FloatArray,
    rotation_M: FloatArray,
) -> None:
    """Displacement and rotation vector of {B} since machine zero, in {M} axes."""
    turned = np.empty((3, 3))
    for i in range(3):
        displacement_M[i] = origin_M[i] - zero_origin_M[i]
        for j in range(3):
            turned[i, j] = R[i, 0] * zero_R[j, 0] + R[i, 1] * zero_R[j, 1] + R[i, 2] * zero_R[j, 2]
    set_rotation_vector(turned, rotation_M)


@helper
def solve_octahedron(
    lengths_mm: FloatArray,
    plate_points_M: FloatArray,
    guess_supports_M: FloatArray,
    joint_offsets_B: FloatArray,
    support_of_joint: IntArray,
    zero_origin_M: FloatArray,
    zero_R: FloatArray,
    supports_M: FloatArray,
    origin_M: FloatArray,
    R: FloatArray,
    base_joints_M: FloatArray,
    displacement_M: FloatArray,
    rotation_M: FloatArray,
    iterations: IntArray,
    residual_mm: FloatArray,
    reason: IntArray,
) -> None:
    """See `compd.model.kinematics.frame.solve_frame`."""
    for i in range(3):
        for j in range(3):
            supports_M[i, j] = guess_supports_M[i, j]
    iterations[0] = 0
    residual_mm[0] = math.nan
    if math.isnan(plate_points_M[0, 0]):  # without reference points the frame stands where it stood at machine zero
        reason[0] = OK
        residual_mm[0] = 0.0
        origin_M[:] = zero_origin_M
        R[:, :] = zero_R
        displacement_M[:] = 0.0
        rotation_M[:] = 0.0
    else:
        reason[0] = _supports_from(lengths_mm, plate_points_M, supports_M, iterations, residual_mm)
        if reason[0] == OK and not place_base(supports_M, R, origin_M):
            reason[0] = NEAR_SINGULAR
    if reason[0] == OK and not math.isnan(plate_points_M[0, 0]):
        _compare(origin_M, R, zero_origin_M, zero_R, displacement_M, rotation_M)
        if max(max_abs(displacement_M) / np.min(lengths_mm), max_abs(rotation_M)) > FURTHEST:
            reason[0] = OTHER_ASSEMBLY
    if reason[0] != OK:
        supports_M[:, :] = math.nan
        origin_M[:] = math.nan
        R[:, :] = math.nan
        base_joints_M[:, :] = math.nan
        displacement_M[:] = math.nan
        rotation_M[:] = math.nan
        return
    for i in range(support_of_joint.shape[0]):
        s = support_of_joint[i]
        x, y, z = joint_offsets_B[i, 0], joint_offsets_B[i, 1], joint_offsets_B[i, 2]
        for j in range(3):
            base_joints_M[i, j] = supports_M[s, j] + (R[j, 0] * x + R[j, 1] * y + R[j, 2] * z)


octahedron = kernel(
    [
        VECTOR,
        MATRIX,
        MATRIX,
        MATRIX,
        INTEGERS,
        VECTOR,
        MATRIX,
        MATRIX,
        VECTOR,
        MATRIX,
        MATRIX,
        VECTOR,
        VECTOR,
        INTEGERS,
        VECTOR,
        INTEGERS,
    ],
    "(l),(s,d),(s,d),(n,d),(n),(d),(d,d)->(s,d),(d),(d,d),(n,d),(d),(d),(),(),()",
)(solve_octahedron)
