"""The frame by instantaneous kinematics, the paper's equations (4) and (5): exact to first order.

    U = J X                 (4)
    X = J^-1 U              (5)

U (9,) are the changes of t1..t3, u1..u6 since machine zero and X (9,) the displacements of b1, b2, b3 in {M}. Row e of
J is the unit vector along edge e, at its near support positive, at its far support negative: d|b - m| = (b - m) . db /
|b - m|. J is constant, that of machine zero.

The exact solution costs five microseconds, so the daemon uses that. Example, on the tripod: u1 longer by 0.1 mm
displaces {B} by 0.0862 mm, and the two ways differ by 7 nm and 0.02 urad.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from compd.arrays import FloatArray
from compd.errors import KinematicsError
from compd.model.kernels import AMPLIFICATION_LIMIT
from compd.model.kinematics import Frame, FrameGeometry, distances_mm


class FrameJacobians(NamedTuple):
    """What equation (5) needs of a machine; constant, computed once.

    supports : (9, 9), d (b1, b2, b3) / d (t1..t3, u1..u6), pure numbers.
    pose : (6, 9), d (displacement, rotation vector) of {B} / d (t1..t3, u1..u6); rows 3..5 in rad/mm.
    """

    supports: FloatArray
    pose: FloatArray


class InstantaneousFrame(NamedTuple):
    """The frame to first order in the changes of its distances.

    supports_M_mm : (..., 3, 3).  displacement_M_mm : (..., 3), of the origin of {B} since machine zero.
    rotation_M_rad : (..., 3), of {B} since machine zero, about {M}'s axes.
    """

    supports_M_mm: FloatArray
    displacement_M_mm: FloatArray
    rotation_M_rad: FloatArray


class FrameDifference(NamedTuple):
    """How far the instantaneous frame is from the exact one: the length of each difference.

    supports_mm : (...), of the support that differs most.  origin_mm, rotation_rad : (...).
    """

    supports_mm: FloatArray
    origin_mm: FloatArray
    rotation_rad: FloatArray


def inverse_frame_jacobian(geometry: FrameGeometry) -> FloatArray:
    """J^-1 of equation (5) at machine zero, (9, 9): d (b1, b2, b3) / d (t1..t3, u1..u6), pure numbers.

    The paper's J has six columns, for a base platform that is rigid; with nine the shape may change as well.
    Raises KinematicsError where the frame at machine zero is near-singular.
    """
    _, J = distances_mm(geometry.zero_supports_M_mm, geometry.plate_points_M_mm)
    smallest = float(np.linalg.svd(J, compute_uv=False)[-1])
    if not smallest * AMPLIFICATION_LIMIT > 1.0:
        raise KinematicsError.of(
            "frame at machine zero",
            "the nine distances do not fix the supports",
            value=f"smallest singular value {smallest:.3g}",
            allowed=f"more than {1.0 / AMPLIFICATION_LIMIT:g}",
            next_step="check supports and plate points",
        )
    return np.asarray(np.linalg.inv(J), dtype=np.float64)


def base_pose_jacobian(geometry: FrameGeometry) -> FloatArray:
    """d (displacement, rotation vector) / d (b1, b2, b3) of {B} at machine zero, (6, 9); rows 3..5 in rad/mm.

    The origin is the centroid: a third of each support's displacement. A rotation w of {B} moves its axes by w x y_B
    and w x z_B; written in {B} these are (-w_z, 0, w_x) and (w_y, -w_x, 0), so that

        w_x = z_B . dy_B,   w_y = x_B . dz_B,   w_z = -x_B . dy_B,

    with dy_B = (db1 - d origin) / |b1 - origin| and dz_B = d((b2 - b1) x (b3 - b1)) / |(b2 - b1) x (b3 - b1)|, each
    but for a part along the axis itself, which the products leave out.
    """
    b1, b2, b3 = geometry.zero_supports_M_mm
    axes = geometry.zero_rotation_M_B
    x_B, z_B = axes[:, 0], axes[:, 2]
    thirds = np.tile(np.eye(3) / 3.0, 3)
    arm_mm = float(np.linalg.norm(b1 - geometry.zero_origin_M_mm))
    to_b1 = (np.hstack([np.eye(3), np.zeros((3, 6))]) - thirds) / arm_mm
    normal = np.cross(b2 - b1, b3 - b1)
    area_mm2 = float(np.linalg.norm(normal))
    # x_B . d((b2-b1) x (b3-b1)) by b1, b2 and b3 in turn, a scalar triple product each
    normal_along_x = np.concatenate([np.cross(b2 - b3, x_B), np.cross(b3 - b1, x_B), np.cross(x_B, b2 - b1)]) / area_mm2
    turn_B = np.vstack([z_B @ to_b1, normal_along_x, -x_B @ to_b1])
    return np.vstack([thirds, axes @ turn_B])


def frame_jacobians(geometry: FrameGeometry) -> FrameJacobians:
    """J^-1 of equation (5) at machine zero, for the supports and for the pose of {B}.

    Raises KinematicsError where the frame at machine zero is near-singular.
    """
    supports = inverse_frame_jacobian(geometry)
    return FrameJacobians(supports, base_pose_jacobian(geometry) @ supports)


def instantaneous_frame(
    geometry: FrameGeometry, changes_mm: ArrayLike, jacobians: FrameJacobians | None = None
) -> InstantaneousFrame:
    """Equation (5): X = J^-1 U with the constant J of machine zero.

    changes_mm : (..., 9), U, of t1..t3, u1..u6 since machine zero. nan in, nan out.
    jacobians : of this geometry, where they are at hand; computed if None.
    Raises KinematicsError where the frame at machine zero is near-singular.
    """
    changes = np.asarray(changes_mm, dtype=np.float64)
    by_supports, by_pose = jacobians or frame_jacobians(geometry)
    moved_mm = changes @ by_supports.T
    pose = changes @ by_pose.T
    supports = geometry.zero_supports_M_mm + moved_mm.reshape(*changes.shape[:-1], 3, 3)
    return InstantaneousFrame(supports, pose[..., :3], pose[..., 3:])


def frame_difference(exact: Frame, instantaneous: InstantaneousFrame) -> FrameDifference:
    """How far the two ways of the paper differ, row by row; nan where the exact one failed."""

    def length(vector: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt((vector * vector).sum(-1)))

    return FrameDifference(
        length(exact.supports_M_mm - instantaneous.supports_M_mm).max(-1),
        length(exact.displacement_M_mm - instantaneous.displacement_M_mm),
        length(exact.rotation_M_rad - instantaneous.rotation_M_rad),
    )
