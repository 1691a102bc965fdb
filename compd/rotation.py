"""Rotations, as matrices inside and as rotation vectors at the boundaries, and points from one frame to another."""

from __future__ import annotations

import math

from compd.arrays import FloatArray
from compd.jit import MATRIX, VECTOR, helper, kernel
from compd.linear import all_finite

# Stands below a fraction whose numerator vanishes too: no angle is that small.
SMALLEST = 1e-300


@helper
def rotate_in_place(R: FloatArray, x_rad: float, y_rad: float, z_rad: float) -> None:
    """Turn R (3, 3) in place by a small vector about the fixed axes.

    The quaternion (1, v/2), normalised, agrees with the exponential to second order, which is all that
    Newton needs, and is a rotation exactly.
    """
    a = 0.5 * x_rad
    b = 0.5 * y_rad
    c = 0.5 * z_rad
    k = 2.0 / (1.0 + a * a + b * b + c * c)
    for j in range(3):
        u, v, w = R[0, j], R[1, j], R[2, j]
        R[0, j] = u + k * (-(b * b + c * c) * u + (a * b - c) * v + (a * c + b) * w)
        R[1, j] = v + k * ((a * b + c) * u - (a * a + c * c) * v + (b * c - a) * w)
        R[2, j] = w + k * ((a * c - b) * u + (b * c + a) * v - (a * a + b * b) * w)


@helper
def orthonormalise(R: FloatArray) -> None:
    """Take R (3, 3) back to a rotation, in place: one Newton step of the polar decomposition.

    A warm start hands on its matrix for days; without this, rounding would add up.
    """
    xx = R[0, 0] * R[0, 0] + R[1, 0] * R[1, 0] + R[2, 0] * R[2, 0]
    yy = R[0, 1] * R[0, 1] + R[1, 1] * R[1, 1] + R[2, 1] * R[2, 1]
    zz = R[0, 2] * R[0, 2] + R[1, 2] * R[1, 2] + R[2, 2] * R[2, 2]
    xy = 0.5 * (R[0, 0] * R[0, 1] + R[1, 0] * R[1, 1] + R[2, 0] * R[2, 1])
    xz = 0.5 * (R[0, 0] * R[0, 2] + R[1, 0] * R[1, 2] + R[2, 0] * R[2, 2])
    yz = 0.5 * (R[0, 1] * R[0, 2] + R[1, 1] * R[1, 2] + R[2, 1] * R[2, 2])
    for i in range(3):
        u, v, w = R[i, 0], R[i, 1], R[i, 2]
        R[i, 0] = (1.5 - 0.5 * xx) * u - xy * v - xz * w
        R[i, 1] = (1.5 - 0.5 * yy) * v - xy * u - yz * w
        R[i, 2] = (1.5 - 0.5 * zz) * w - xz * u - yz * v


@helper
def set_rotation_vector(R: FloatArray, vector_rad: FloatArray) -> None:
    """Rotation vector (3,) of R (3, 3), angle 0 to pi, by its quaternion (Shepperd's choice of the divisor)."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace > 0.0:
        w = 1.0 + trace
        x, y, z = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    elif R[0, 0] >= R[1, 1] and R[0, 0] >= R[2, 2]:
        x = 1.0 + R[0, 0] - R[1, 1] - R[2, 2]
        y, z, w = R[1, 0] + R[0, 1], R[2, 0] + R[0, 2], R[2, 1] - R[1, 2]
    elif R[1, 1] >= R[2, 2]:
        y = 1.0 - R[0, 0] + R[1, 1] - R[2, 2]
        x, z, w = R[1, 0] + R[0, 1], R[2, 1] + R[1, 2], R[0, 2] - R[2, 0]
    else:
        z = 1.0 - R[0, 0] - R[1, 1] + R[2, 2]
        x, y, w = R[2, 0] + R[0, 2], R[2, 1] + R[1, 2], R[1, 0] - R[0, 1]
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 * math.atan2(sine, w) / max(sine, SMALLEST)
    vector_rad[0] = scale * x
    vector_rad[1] = scale * y
    vector_rad[2] = scale * z


@kernel([MATRIX, VECTOR], "(d,d)->(d)")
def rotation_vector(R: FloatArray, vector_rad: FloatArray) -> None:
    """R (..., 3, 3) -> its rotation vector (..., 3) in rad, angle 0 to pi."""
    set_rotation_vector(R, vector_rad)


@kernel([VECTOR, MATRIX], "(d)->(d,d)")
def rotation_matrix(vector_rad: FloatArray, R: FloatArray) -> None:
    """Rotation vector (..., 3) in rad -> R (..., 3, 3); nan if it is not finite."""
    if not all_finite(vector_rad):
        R[:, :] = math.nan
        return
    x, y, z = vector_rad[0], vector_rad[1], vector_rad[2]
    angle = math.sqrt(x * x + y * y + z * z)
    half = math.sin(0.5 * angle) / max(angle, SMALLEST)
    a, b, c, w = half * x, half * y, half * z, math.cos(0.5 * angle)
    R[0, 0] = 1.0 - 2.0 * (b * b + c * c)
    R[0, 1] = 2.0 * (a * b - w * c)
    R[0, 2] = 2.0 * (a * c + w * b)
    R[1, 0] = 2.0 * (a * b + w * c)
    R[1, 1] = 1.0 - 2.0 * (a * a + c * c)
    R[1, 2] = 2.0 * (b * c - w * a)
    R[2, 0] = 2.0 * (a * c - w * b)
    R[2, 1] = 2.0 * (b * c + w * a)
    R[2, 2] = 1.0 - 2.0 * (a * a + b * b)


@kernel([MATRIX, MATRIX, MATRIX], "(d,d),(d,d)->(d,d)")
def compose(first: FloatArray, second: FloatArray, product: FloatArray) -> None:
    """Product of two rotations (..., 3, 3): T_M_P = compose(T_M_B, T_B_P)."""
    for i in range(3):
        for j in range(3):
            product[i, j] = first[i, 0] * second[0, j] + first[i, 1] * second[1, j] + first[i, 2] * second[2, j]


@helper
def to_outer_frame(R: FloatArray, origin_mm: FloatArray, point_mm: FloatArray, outer_mm: FloatArray) -> None:
    """Point in the inner frame -> in the outer one: origin + R point, equation (2).

    R (..., 3, 3) and origin (..., 3): the inner frame's axes and origin in the outer one; point (..., 3).
    nan if the point is not finite.
    """
    if not all_finite(point_mm):
        outer_mm[:] = math.nan
        return
    for i in range(3):
        outer_mm[i] = origin_mm[i] + (R[i, 0] * point_mm[0] + R[i, 1] * point_mm[1] + R[i, 2] * point_mm[2])


to_outer = kernel([MATRIX, VECTOR, VECTOR, VECTOR], "(d,d),(d),(d)->(d)")(to_outer_frame)


@helper
def to_inner_frame(R: FloatArray, origin_mm: FloatArray, point_mm: FloatArray, inner_mm: FloatArray) -> None:
    """Point in the outer frame -> in the inner one: R^T (point - origin); the inverse of `to_outer`.

    nan if the point is not finite.
    """
    if not all_finite(point_mm):
        inner_mm[:] = math.nan
        return
    x, y, z = point_mm[0] - origin_mm[0], point_mm[1] - origin_mm[1], point_mm[2] - origin_mm[2]
    for i in range(3):
        inner_mm[i] = R[0, i] * x + R[1, i] * y + R[2, i] * z


to_inner = kernel([MATRIX, VECTOR, VECTOR, VECTOR], "(d,d),(d),(d)->(d)")(to_inner_frame)
