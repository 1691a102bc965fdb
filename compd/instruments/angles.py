"""Three angles of an attitude as a rotation vector, in the order of turning that a person states."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray

# A rotation vector: no order of turning.
VECTOR = "vector"
_FIXED = tuple("".join(axes) for axes in product("xyz", repeat=3) if axes[0] != axes[1] != axes[2])
# Orders, as scipy names them, in words. Where an axis occurs twice, rx, ry, rz are the first, the second and the third
# angle; else the angles about x, y and z.
ANGLE_ORDERS: Mapping[str, str] = {
    VECTOR: "a rotation vector",
    **{order: f"about fixed axes: {', then '.join(order)}" for order in _FIXED},
    **{order.upper(): f"about axes that turn along: {', then '.join(order)}" for order in _FIXED},
}


def rotation_vectors(angles_rad: FloatArray, order: str) -> FloatArray:
    """(N, 3) rotation vectors, rad, of angles (N, 3) in the columns rx, ry, rz; nan where one is missing.

    order : one of `ANGLE_ORDERS`.
    """
    if order == VECTOR:
        return angles_rad
    known = np.isfinite(angles_rad).all(axis=1)
    axes = order.lower()
    in_turn = ["xyz".index(axis) for axis in axes] if len(set(axes)) == len(axes) else [0, 1, 2]
    vectors = np.full(angles_rad.shape, np.nan)
    if known.any():
        vectors[known] = Rotation.from_euler(order, angles_rad[known][:, in_turn]).as_rotvec()
    return vectors
