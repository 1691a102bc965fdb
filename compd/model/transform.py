"""Points from one frame to another."""

from __future__ import annotations

import math

from compd.arrays import FloatArray
from compd.model.kernels.jit import MATRIX, VECTOR, kernel
from compd.model.kernels.linear import all_finite


@kernel([MATRIX, VECTOR, VECTOR, VECTOR], "(d,d),(d),(d)->(d)")
def to_outer(R: FloatArray, origin_mm: FloatArray, point_mm: FloatArray, outer_mm: FloatArray) -> None:
    """Point in the inner frame -> in the outer one: origin + R point, equation (2).

    R (..., 3, 3) and origin (..., 3): the inner frame's axes and origin in the outer one; point (..., 3).
    nan if the point is not finite.
    """
    if not all_finite(point_mm):
        outer_mm[:] = math.nan
        return
    for i in range(3):
        outer_mm[i] = origin_mm[i] + (R[i, 0] * point_mm[0] + R[i, 1] * point_mm[1] + R[i, 2] * point_mm[2])


@kernel([MATRIX, VECTOR, VECTOR, VECTOR], "(d,d),(d),(d)->(d)")
def to_inner(R: FloatArray, origin_mm: FloatArray, point_mm: FloatArray, inner_mm: FloatArray) -> None:
    """Point in the outer frame -> in the inner one: R^T (point - origin); the inverse of `to_outer`.

    nan if the point is not finite.
    """
    if not all_finite(point_mm):
        inner_mm[:] = math.nan
        return
    x, y, z = point_mm[0] - origin_mm[0], point_mm[1] - origin_mm[1], point_mm[2] - origin_mm[2]
    for i in range(3):
        inner_mm[i] = R[0, i] * x + R[1, i] * y + R[2, i] * z
