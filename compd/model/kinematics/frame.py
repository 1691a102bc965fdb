"""The machine frame: the pose of {B} in {M} from nine distances, and where the base joints are."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from compd.arrays import FloatArray, IntArray
from compd.jit import MATRIX, VECTOR, kernel
from compd.model.kernels import edge_lengths, octahedron, place_base


class FrameGeometry(NamedTuple):
    """What the frame is made of; every array may have leading axes.

    plate_points_M_mm : (..., 3, 3), m1..m3; nan where the frame has no reference points: it stands still then.
    joint_offsets_B_mm : (..., n, 3), base joint minus its support, in {B} axes: these it keeps.
    support_of_joint : (n,), the support that carries joint i, counted from 0.
    zero_supports_M_mm : (..., 3, 3), b1..b3 at machine zero.
    zero_origin_M_mm : (..., 3), zero_rotation_M_B : (..., 3, 3): {B0} in {M}.
    """

    plate_points_M_mm: FloatArray
    joint_offsets_B_mm: FloatArray
    support_of_joint: IntArray
    zero_supports_M_mm: FloatArray
    zero_origin_M_mm: FloatArray
    zero_rotation_M_B: FloatArray


class Frame(NamedTuple):
    """The frame now.

    supports_M_mm : (..., 3, 3), b1..b3, equation (2).
    origin_M_mm : (..., 3), rotation_M_B : (..., 3, 3): {B} in {M}.
    base_joints_M_mm : (..., n, 3).
    displacement_M_mm : (..., 3), of the origin of {B} since machine zero.
    rotation_M_rad : (..., 3), rotation vector of {B} since machine zero, about {M}'s axes.
    iterations, residual_mm, reason : (...); where reason is not OK every number is nan.
    """

    supports_M_mm: FloatArray
    origin_M_mm: FloatArray
    rotation_M_B: FloatArray
    base_joints_M_mm: FloatArray
    displacement_M_mm: FloatArray
    rotation_M_rad: FloatArray
    iterations: IntArray
    residual_mm: FloatArray
    reason: IntArray


def solve_frame(
    geometry: FrameGeometry, distances_mm: ArrayLike, guess_supports_M_mm: ArrayLike | None = None
) -> Frame:
    """The frame from its nine distances, exactly: equations (2) and (3) solved by Newton's method.

    distances_mm : (..., 9), t1..t3, u1..u6, by equations (6) and (7).
    guess_supports_M_mm : (..., 3, 3), the last cycle's supports; machine zero's if None.
    A row fails as NOT_FINITE; UNREACHABLE (a distance is not positive, a triangle does not close); NO_CONVERGENCE;
    NEAR_SINGULAR (amplification above AMPLIFICATION_LIMIT, as when supports and plate points come to lie in one
    plane); OTHER_ASSEMBLY (a singular octahedron lies between guess and solution, as for its mirror image).
    Raises ValueError for arrays of a wrong shape.
    """
    plate, offsets, support_of_joint, supports, origin, rotation = geometry
    guess = supports if guess_supports_M_mm is None else guess_supports_M_mm
    return Frame(*octahedron(distances_mm, plate, guess, offsets, support_of_joint, origin, rotation))


@kernel([MATRIX, VECTOR, MATRIX], "(d,d)->(d),(d,d)")
def base_pose(supports_M: FloatArray, origin_M: FloatArray, R: FloatArray) -> None:
    """Supports b1..b3 (..., 3, 3) -> origin (..., 3) and axes (..., 3, 3) of {B} in {M}.

    Origin in the centroid, z_B along (b2-b1) x (b3-b1), y_B from the origin to b1, x_B = y_B x z_B.
    Supports on one line have no axes: nan.
    """
    if not place_base(supports_M, R, origin_M):
        R[:, :] = math.nan


def distances_mm(supports_M_mm: ArrayLike, plate_points_M_mm: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """The nine distances between reference points, equation (3), and their derivatives.

    supports_M_mm, plate_points_M_mm : (..., 3, 3), b1..b3 and m1..m3 in {M}.
    Returns t1..t3, u1..u6 (..., 9), and d distance / d (b1, b2, b3), (..., 9, 9), a pure number.
    Points that coincide give nan.
    """
    supports = np.asarray(supports_M_mm, dtype=np.float64)
    nine = np.zeros((*supports.shape[:-2], 9))
    lengths, J = _distances(supports, plate_points_M_mm, nine)
    return lengths, J


@kernel([MATRIX, MATRIX, VECTOR, VECTOR, MATRIX], "(s,d),(s,d),(l)->(l),(l,l)")
def _distances(
    supports_M: FloatArray, plate_points_M: FloatArray, nine: FloatArray, lengths_mm: FloatArray, J: FloatArray
) -> None:
    """See `distances_mm`. `nine` is not read: a gufunc takes the length of its result from an argument."""
    if not edge_lengths(supports_M, plate_points_M, lengths_mm, J):
        lengths_mm[:] = math.nan
        J[:, :] = math.nan
