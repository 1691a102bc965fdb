"""One machine, as the physics sees it: geometry, joint weights, and what follows from them at machine zero."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from compd.arrays import FloatArray, IntArray
from compd.errors import KinematicsError, Problem
from compd.model.effect import FittedEffect
from compd.model.frame import FrameGeometry, base_pose, distances_mm, solve_frame
from compd.model.kernels.rotation import compose
from compd.model.kinematics import Mechanism, forward_kinematics, inverse_kinematics
from compd.model.observations import Constants
from compd.model.solve_status import require
from compd.model.tool import Arrangement, Contact
from compd.model.transform import to_inner


class AtZero(NamedTuple):
    """The machine at machine zero, where every gauge reads zero.

    base_joints_M_mm : (n, 3).  platform_origin_M_mm : (3,).  rotation_M_P : (3, 3).
    contact : tip_M_mm (3,), tip_P_mm (3,).
    link_length_mm : (n,), l0.  distances_mm : (9,), t0_1..t0_3, u0_1..u0_6.
    """

    base_joints_M_mm: FloatArray
    platform_origin_M_mm: FloatArray
    rotation_M_P: FloatArray
    contact: Contact
    link_length_mm: FloatArray
    distances_mm: FloatArray


@dataclass(frozen=True, eq=False)
class MachineModel:
    """Geometry and parameters of one machine; frozen, its arrays read-only. Build it with `machine_model`.

    frame : supports, plate points, base joints.  platform_joints_P_mm : (n, 3).
    revolute_axes_P : (3, 3) unit vectors for the tripod, (0, 3) for the hexapod.
    arrangement : where the tool is.  joint_weights : (n, k), see `compd.model.joint_correction`.
    weight_N : the moving platform's, at weight_at_P_mm (3,).
    effects : in their order.  covariance : (P, P) of all their fitted numbers jointly.
    constants : what effects ask of the description beyond the kinematics; None where nothing was given.
    """

    frame: FrameGeometry
    platform_joints_P_mm: FloatArray
    revolute_axes_P: FloatArray
    arrangement: Arrangement
    joint_weights: FloatArray
    weight_N: float
    weight_at_P_mm: FloatArray
    zero: AtZero
    effects: tuple[FittedEffect, ...] = ()
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    constants: Constants | None = None

    @property
    def links(self) -> int:
        """Number of links: 3 or 6."""
        return int(self.platform_joints_P_mm.shape[0])

    @property
    def attitude_is_free(self) -> bool:
        """Whether a target has an attitude of its own; a tripod's follows from its tip."""
        return len(self.revolute_axes_P) == 0

    @cached_property
    def acting(self) -> tuple[FittedEffect, ...]:
        """The effects that belong to the machine; those at the reference instrument never act on it."""
        return tuple(one for one in self.effects if one.effect.live)

    @cached_property
    def watches_motion(self) -> bool:
        """Whether an effect asks how the links move."""
        return any({"direction", "motion"} & set(one.effect.needs) for one in self.acting)

    def fading(self, weight: float) -> Self:
        """The same machine with its effects counting `weight`, 0 to 1."""
        return replace(self, effects=tuple(replace(one, theta=one.theta * weight) for one in self.effects))

    def mechanism(self, base_joints_M_mm: FloatArray) -> Mechanism:
        """The links with the base joints (..., n, 3) where they are now."""
        return Mechanism(base_joints_M_mm, self.platform_joints_P_mm, self.revolute_axes_P)


def machine_model(
    *,
    supports_M_mm: ArrayLike,
    plate_points_M_mm: ArrayLike,
    base_joints_M_mm: ArrayLike,
    support_of_joint: ArrayLike,
    platform_joints_P_mm: ArrayLike,
    revolute_axes_P: ArrayLike,
    arrangement: Arrangement,
    zero_contact: Contact,
    zero_rotation_M_P: ArrayLike | None,
    joint_weights: ArrayLike,
    weight_N: float,
    weight_at_P_mm: ArrayLike,
) -> MachineModel:
    """A machine from its parts at machine zero, all in {M} but what moves with the platform; lengths in mm.

    supports_M_mm, plate_points_M_mm : (3, 3).  base_joints_M_mm, platform_joints_P_mm : (n, 3), n = 3 or 6.
    support_of_joint : (n,), counted from 0.  revolute_axes_P : (3, 3), any length, or (0, 3).
    zero_contact : the tip in {M} and in {P}.  zero_rotation_M_P : (3, 3) for the hexapod, None for the tripod.
    joint_weights : (n, k).  weight_N at weight_at_P_mm (3,).
    Raises KinematicsError where machine zero is unreachable, near-singular or not finite, ValueError for arrays of
    a wrong shape.
    """
    supports, base_joints = _frozen(supports_M_mm), _frozen(base_joints_M_mm)
    axes = np.asarray(revolute_axes_P, dtype=np.float64).reshape(-1, 3)
    axes = _frozen(axes / np.sqrt((axes * axes).sum(-1, keepdims=True)))
    carriers: IntArray = np.array(support_of_joint, dtype=np.int64)
    carriers.flags.writeable = False
    plate, platform_joints, weights = _frozen(plate_points_M_mm), _frozen(platform_joints_P_mm), _frozen(joint_weights)
    _check_shapes(supports, plate, base_joints, carriers, platform_joints, weights)
    distances, _ = distances_mm(supports, plate)
    origin, rotation = base_pose(supports)
    offsets = to_inner(rotation, np.zeros(3), base_joints - supports[carriers])
    frame = FrameGeometry(plate, _frozen(offsets), carriers, supports, _frozen(origin), _frozen(rotation))
    require(
        solve_frame(frame, distances).reason,
        "frame at machine zero",
        "check supports and plate points, and that rods u1..u6 join them in the order of equation (3)",
    )
    mechanism = Mechanism(base_joints, platform_joints, axes)
    attitude = _facing(base_joints, platform_joints) if zero_rotation_M_P is None else zero_rotation_M_P
    pose = inverse_kinematics(mechanism, *zero_contact, attitude)
    check = "check the tip and the attitude at machine zero, base joints, platform joints and revolute axes"
    require(pose.reason, "links at machine zero", check)
    # the links must also lead back to machine zero, or the first warm start would
    require(
        forward_kinematics(mechanism, pose.link_length_mm, pose.origin_M_mm, pose.rotation_M_P).reason,
        "links at machine zero",
        check,
    )
    zero = AtZero(
        base_joints,
        _frozen(pose.origin_M_mm),
        _frozen(pose.rotation_M_P),
        Contact(*map(_frozen, zero_contact)),
        _frozen(pose.link_length_mm),
        _frozen(distances),
    )
    return MachineModel(
        frame, platform_joints, axes, arrangement, weights, float(weight_N), _frozen(weight_at_P_mm), zero
    )


def _facing(base_joints_M_mm: FloatArray, platform_joints_P_mm: FloatArray) -> FloatArray:
    """Attitude at which the triangle of the platform joints lies as that of the base joints does: near a tripod's."""
    _, base = base_pose(base_joints_M_mm)
    _, platform = base_pose(platform_joints_P_mm)
    return np.asarray(compose(base, platform.T))


def _check_shapes(
    supports: FloatArray,
    plate: FloatArray,
    base_joints: FloatArray,
    carriers: IntArray,
    platform_joints: FloatArray,
    weights: FloatArray,
) -> None:
    """Kernels trust indices and sizes: refuse here what would lead them astray."""
    links = base_joints.shape[0]
    shapes = {
        "supports_M_mm": (supports.shape, (3, 3)),
        "plate_points_M_mm": (plate.shape, (3, 3)),
        "base_joints_M_mm": (base_joints.shape, (links, 3)),
        "support_of_joint": (carriers.shape, (links,)),
        "platform_joints_P_mm": (platform_joints.shape, (links, 3)),
        "joint_weights": (weights.shape, (links, weights.shape[-1])),
    }
    wrong = [f"{name} is {found}, must be {wanted}" for name, (found, wanted) in shapes.items() if found != wanted]
    if wrong:
        raise ValueError("; ".join(wrong))
    if carriers.min() < 0 or carriers.max() > 2:
        raise KinematicsError(
            Problem(
                where="support_of_joint",
                what="names a support that is not there",
                value=str(carriers.tolist()),
                allowed="0, 1 or 2",
            )
        )


def _frozen(values: ArrayLike) -> FloatArray:
    """A contiguous read-only copy."""
    array = np.array(values, dtype=np.float64, order="C")
    array.flags.writeable = False
    return array
