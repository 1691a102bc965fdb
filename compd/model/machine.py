"""One machine, as the physics sees it: geometry, joint weights, and what follows from them at machine zero."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.errors import KinematicsError
from compd.link_count import LinkCount
from compd.model.effects import AtZero, EffectProgram, FittedEffect, MachineConstants, MachineDetails, build_program
from compd.model.kernels import require
from compd.model.kinematics import (
    Actuators,
    Arrangement,
    Contact,
    FrameGeometry,
    Mechanism,
    Pose,
    base_pose,
    distances_mm,
    forward_kinematics,
    inverse_kinematics,
    link_forces,
    links_at,
    solve_frame,
)
from compd.model.structures import MODEL
from compd.rotation import compose, to_inner, to_outer

# Poses on the way from machine zero to a place; of a way as long as a rod, a tenth of the rod apart.
_REACH_STEPS = 10


class Reach(NamedTuple):
    """A pose, and the scales (..., m) that show it, mm since machine zero."""

    pose: Pose
    scale_mm: FloatArray


@dataclass(frozen=True, eq=False)
class MachineModel:
    """Geometry and parameters of one machine; frozen, its arrays read-only. Build it with `machine_model`.

    frame : supports, plate points, base joints.  platform_joints_P_mm : (n, 3).
    revolute_axes_P : (k, 3), unit vectors of the hinges, in {M} where the base carries one.  hinges : (k, 2), as in
        `Mechanism`.  actuators : what moves the links; see `Actuators`.
    arrangement : where the tool is.  joint_weights : (n, k), see `compd.model.kinematics.joint_shortening`.
    weight_N : the moving platform's, at weight_at_P_mm (3,).
    effects : in their order.  covariance : (P, P) of all their fitted numbers jointly.
    constants : what effects need beyond the kinematics; None where none was computed, as for a model without effects.
    frame_drift_mm : standard uncertainty of the tip along each axis by what the frame moves unmeasured; nan where it is
        not known.
    quantity_noise : of quantities, by name, the standard deviation of one reading that the configuration states.
    """

    frame: FrameGeometry
    platform_joints_P_mm: FloatArray
    revolute_axes_P: FloatArray
    hinges: IntArray
    actuators: Actuators
    arrangement: Arrangement
    joint_weights: FloatArray
    weight_N: float
    weight_at_P_mm: FloatArray
    zero: AtZero
    effects: tuple[FittedEffect, ...] = ()
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    constants: MachineConstants | None = None
    frame_drift_mm: float = 0.0
    quantity_noise: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def links(self) -> int:
        """Number of links, 3 to 6, which knows the number of scales."""
        return LinkCount(self.platform_joints_P_mm.shape[0], self.scales)

    @cached_property
    def scales(self) -> int:
        """Number of actuators, each with the place of a scale."""
        return len(self.actuators.kinds)

    @cached_property
    def attitude_is_free(self) -> bool:
        """Whether a target has an attitude of its own; a tripod's follows from its tip."""
        return bool(self.actuators.fixed[3:].any())

    @cached_property
    def live_effects(self) -> tuple[FittedEffect, ...]:
        """The effects of the machine itself; those of the reference instrument never enter the live loop."""
        return tuple(fitted for fitted in self.effects if fitted.effect.live)

    @cached_property
    def contribution_names(self) -> tuple[str, ...]:
        """Names of the parts of a correction: joints, frame, and each live effect."""
        return ("joints", "frame", *(fitted.effect.id for fitted in self.live_effects))

    @cached_property
    def needs_motion(self) -> bool:
        """Whether an effect depends on the links' direction of travel or velocity."""
        return any({"direction", "motion"} & set(fitted.effect.needs) for fitted in self.live_effects)

    @cached_property
    def live_covariance(self) -> FloatArray:
        """(P, P) of the live effects' fitted numbers; nan where the model does not give it."""
        live = [fitted.effect.live for fitted in self.effects for _ in fitted.theta]
        if not len(self.covariance):
            return np.full((sum(live),) * 2, np.nan)
        return self.covariance[np.ix_(live, live)]

    @cached_property
    def program(self) -> EffectProgram:
        """The live effects as the compensation's kernel reads them."""
        return build_program(
            self.live_effects, self.constants, self.links, self.joint_weights.shape[1], len(self.revolute_axes_P)
        )

    @cached_property
    def structure(self) -> NDArray[np.void]:
        """(1,) The machine as the compensation's kernel reads it; see `compd.model.structures.MODEL`."""
        structure = np.zeros(1, dtype=MODEL)
        model, n, k = structure[0], self.links, self.joint_weights.shape[1]
        model["links"], model["scales"], model["joints"], model["axes"] = n, self.scales, k, len(self.revolute_axes_P)
        model["tool_on_plate"], model["needs_motion"] = self.arrangement.on_plate, self.needs_motion
        model["tool_mm"] = self.arrangement.tool_mm
        for name in ("plate_points_M_mm", "zero_supports_M_mm", "zero_origin_M_mm", "zero_rotation_M_B"):
            model[name] = getattr(self.frame, name)
        model["joint_offsets_B_mm"][:n] = self.frame.joint_offsets_B_mm
        model["support_of_joint"][:n] = self.frame.support_of_joint
        model["platform_joints_P_mm"][:n] = self.platform_joints_P_mm
        model["revolute_axes_P"][: len(self.revolute_axes_P)] = self.revolute_axes_P
        model["hinges"][: len(self.hinges)] = self.hinges
        model["joint_weights"][:n, :k] = self.joint_weights
        model["zero_base_joints_M_mm"][:n] = self.base_joints_at_0_M_mm
        model["zero_distances_mm"] = self.zero.distances_mm
        model["extends_each"] = self.extends_each
        for name in ("kinds", "cosine_M", "sine_M", "radius_mm", "of_link", "rod_length_mm", "fixed"):
            values = getattr(self.actuators, name)
            model[name][: len(values)] = values
        model["zero_actuator_mm"][: self.scales] = self.zero.actuator_mm
        return structure

    @cached_property
    def extends_each(self) -> bool:
        """Whether each link has an actuator of its own that extends it."""
        return self.scales == self.links and not self.actuators.kinds.any()

    @cached_property
    def base_joints_at_0_M_mm(self) -> FloatArray:
        """(n, 3) at machine zero, with the actuators at 0: of a turning one the centre of its circle."""
        if not self.actuators.kinds.any():
            return self.zero.base_joints_M_mm
        frame = self.frame
        supports_M_mm = frame.zero_supports_M_mm[frame.support_of_joint]
        return np.asarray(to_outer(frame.zero_rotation_M_B, np.zeros(3), frame.joint_offsets_B_mm) + supports_M_mm)

    def with_effect_weight(self, weight: float) -> Self:
        """The same machine with all fitted numbers of its effects times `weight`, 0 to 1: a model that is faded in."""
        return replace(self, effects=tuple(replace(fitted, theta=fitted.theta * weight) for fitted in self.effects))

    def mechanism(self, base_joints_M_mm: FloatArray) -> Mechanism:
        """The links with the base joints (..., n, 3) where they are now; axes that the base carries as at zero."""
        return Mechanism(base_joints_M_mm, self.platform_joints_P_mm, self.revolute_axes_P, self.hinges)

    def reach(self, tip_M_mm: FloatArray) -> Reach:
        """The machine as drawn with its tip at places (..., 3) in {M}, its frame and its attitude as at machine zero.

        Coordinates that a target does not fix follow. A row fails as `inverse_kinematics` does.
        """
        zero, tip_P_mm = self.zero, self.zero.contact.tip_P_mm
        mechanism = self.mechanism(self.base_joints_at_0_M_mm)
        rotation_M_P, actuator_mm = zero.rotation_M_P, zero.actuator_mm
        # followed from machine zero: Newton alone finds another assembly, or none, of a far place
        for share in np.arange(1, _REACH_STEPS + 1) / _REACH_STEPS:
            here_M_mm = zero.contact.tip_M_mm + share * (tip_M_mm - zero.contact.tip_M_mm)
            reached = inverse_kinematics(mechanism, self.actuators, here_M_mm, tip_P_mm, rotation_M_P, actuator_mm)
            pose, actuator_mm = reached.pose, reached.actuator_mm
            if not self.actuators.fixed[3:].any():
                rotation_M_P = pose.rotation_M_P
        return Reach(pose, actuator_mm - zero.actuator_mm)

    @cached_property
    def extended(self) -> BoolArray:
        """(n,) True for a link that its actuator makes longer."""
        return np.asarray(self.actuators.kinds[self.actuators.of_link] == 0)

    @cached_property
    def base_turns_parts(self) -> bool:
        """Whether the base carries rails, circles or hinges, which turn with it."""
        return bool(self.actuators.kinds.any() or self.hinges[:, 1].any())

    def lengths_mm(self, scale_mm: FloatArray) -> FloatArray:
        """Lengths (..., n) of the links with the scales (..., m) at these readings: l0 + gL of equation (1)."""
        return np.asarray(
            self.zero.link_length_mm + np.where(self.extended, scale_mm[..., self.actuators.of_link], 0.0)
        )

    def links_on(
        self, rotation_M_B: FloatArray, base_joints_M_mm: FloatArray, scale_mm: FloatArray
    ) -> tuple[Mechanism, FloatArray]:
        """The links on a base with the scales (..., m) at these readings, and their lengths (..., n) in mm.

        rotation_M_B : (..., 3, 3), the base's axes.  base_joints_M_mm : (..., n, 3), with the actuators at 0.

        The lengths are those of equation (1) before what the joints take from them.
        """
        length_mm = self.lengths_mm(scale_mm)
        if not self.base_turns_parts:
            return self.mechanism(base_joints_M_mm), length_mm
        turned = compose(rotation_M_B, self.frame.zero_rotation_M_B.T)[..., None, :, :]
        actuators, nowhere = self.actuators, np.zeros(3)
        joints_M_mm, _ = links_at(
            actuators._replace(
                cosine_M=to_outer(turned, nowhere, actuators.cosine_M),
                sine_M=to_outer(turned, nowhere, actuators.sine_M),
            ),
            base_joints_M_mm,
            self.zero.actuator_mm + scale_mm,
        )
        axes = self.revolute_axes_P
        if self.hinges[:, 1].any():
            axes = np.where(self.hinges[:, 1:] == 1, to_outer(turned, nowhere, axes), axes)
        return Mechanism(joints_M_mm, self.platform_joints_P_mm, axes, self.hinges), length_mm


class MachineParts(NamedTuple):
    """A machine at machine zero, all in {M} but what moves with the platform; lengths in mm.

    supports_M_mm, plate_points_M_mm : (3, 3); of a frame without reference points, which stands still, the origin of
        {B0} three times and nan.  rotation_M_B : (3, 3), axes of {B0}; read where there are no reference points.
    base_joints_M_mm, platform_joints_P_mm : (n, 3), n from 3 to 6; base joints with sliding actuators at 0, and the
        centres of the circles of turning ones.
    support_of_joint : (n,), counted from 0.  revolute_axes_P : (k, 3), any length.  hinges : (k, 2).
    actuators : see `Actuators`.  actuator_guess_mm : (m,), about where they stand at machine zero.
    zero_contact : the tip in {M} and in {P}.  zero_rotation_M_P : (3, 3), the attitude at machine zero, or None for
        that of a platform parallel to its base: the guess where a target leaves the attitude free.
    joint_weights : (n, k).  weight_N at weight_at_P_mm (3,).
    """

    supports_M_mm: ArrayLike
    plate_points_M_mm: ArrayLike
    rotation_M_B: ArrayLike
    base_joints_M_mm: ArrayLike
    support_of_joint: ArrayLike
    platform_joints_P_mm: ArrayLike
    revolute_axes_P: ArrayLike
    hinges: IntArray
    actuators: Actuators
    actuator_guess_mm: ArrayLike
    arrangement: Arrangement
    zero_contact: Contact
    zero_rotation_M_P: ArrayLike | None
    joint_weights: ArrayLike
    weight_N: float
    weight_at_P_mm: ArrayLike


def machine_model(parts: MachineParts) -> MachineModel:
    """A machine from its parts at machine zero.

    Raises KinematicsError where machine zero is unreachable, near-singular or not finite, ValueError for arrays of
    a wrong shape.
    """
    supports, base_joints = _read_only(parts.supports_M_mm), _read_only(parts.base_joints_M_mm)
    axes = np.asarray(parts.revolute_axes_P, dtype=np.float64).reshape(-1, 3)
    axes = _read_only(axes / np.sqrt((axes * axes).sum(-1, keepdims=True)))
    carriers: IntArray = np.array(parts.support_of_joint, dtype=np.int64)
    carriers.flags.writeable = False
    plate, platform_joints, weights = map(
        _read_only, (parts.plate_points_M_mm, parts.platform_joints_P_mm, parts.joint_weights)
    )
    _check_shapes(supports, plate, base_joints, carriers, platform_joints, weights)
    frame, distances = _frame_at_zero(supports, plate, _read_only(parts.rotation_M_B), base_joints, carriers)
    mechanism = Mechanism(base_joints, platform_joints, axes, parts.hinges)
    attitude = (
        _parallel_attitude(base_joints, platform_joints) if parts.zero_rotation_M_P is None else parts.zero_rotation_M_P
    )
    reached = inverse_kinematics(mechanism, parts.actuators, *parts.zero_contact, attitude, parts.actuator_guess_mm)
    pose = reached.pose
    check = "check the tip and the attitude at machine zero, base joints, platform joints and revolute axes"
    require(pose.reason, "links at machine zero", check)
    # forward kinematics must lead back to machine zero as well: the first cycle starts from there
    mechanism = mechanism._replace(base_joints_M_mm=reached.base_joints_M_mm)
    require(
        forward_kinematics(mechanism, pose.link_length_mm, pose.origin_M_mm, pose.rotation_M_P).reason,
        "links at machine zero",
        check,
    )
    zero = AtZero(
        _read_only(reached.base_joints_M_mm),
        _read_only(pose.origin_M_mm),
        _read_only(pose.rotation_M_P),
        Contact(*map(_read_only, parts.zero_contact)),
        _read_only(pose.link_length_mm),
        _read_only(reached.actuator_mm),
        _read_only(distances),
    )
    return MachineModel(
        frame,
        platform_joints,
        axes,
        parts.hinges,
        parts.actuators,
        parts.arrangement,
        weights,
        float(parts.weight_N),
        _read_only(parts.weight_at_P_mm),
        zero,
    )


def machine_constants(model: MachineModel, details: MachineDetails) -> MachineConstants:
    """What all rows of this machine have in common; computed once per machine, not in a cycle."""
    zero = model.zero
    platform_joints_M = to_outer(zero.rotation_M_P, zero.platform_origin_M_mm, model.platform_joints_P_mm)
    directions_M = (platform_joints_M - zero.base_joints_M_mm) / zero.link_length_mm[:, None]
    if len(model.revolute_axes_P):
        axes_M = to_outer(zero.rotation_M_P, np.zeros(3), model.revolute_axes_P)
    else:
        # horizontal and square to the link; a vertical link has no such direction of its own and gets x of {M}
        level = np.cross(directions_M, [0.0, 0.0, 1.0])
        axes_M = np.where(np.linalg.norm(level, axis=1, keepdims=True) > 1e-6, level, [1.0, 0.0, 0.0])
    axes_M = axes_M - (axes_M * directions_M).sum(axis=1, keepdims=True) * directions_M
    at_zero = (model.mechanism(zero.base_joints_M_mm), zero.platform_origin_M_mm, zero.rotation_M_P)
    weight_alone = link_forces(*at_zero, np.zeros(3), zero.contact.tip_M_mm, model.weight_N, model.weight_at_P_mm)
    by_force = link_forces(*at_zero, np.eye(3), zero.contact.tip_M_mm, 0.0, model.weight_at_P_mm)
    return MachineConstants(
        platform_joints_P_mm=model.platform_joints_P_mm,
        revolute_axes_P=model.revolute_axes_P,
        hinges=model.hinges,
        scale_of_link=model.actuators.of_link,
        actuators=model.actuators,
        arrangement=model.arrangement,
        zero_directions_M=directions_M,
        zero_axes_M=axes_M / np.linalg.norm(axes_M, axis=1, keepdims=True),
        zero_axial_force_N=weight_alone.axial_N,
        zero_axial_per_force=by_force.axial_N.T,
        weight_N=model.weight_N,
        weight_at_P_mm=model.weight_at_P_mm,
        frame_zero_mm=zero.distances_mm,
        plate_points_M_mm=model.frame.plate_points_M_mm,
        plate_thickness_mm=details.plate_thickness_mm,
        scale_signal_period_mm=details.scale_signal_period_mm,
        instrument_M_mm=np.array(details.instrument_M_mm),
        joints=model.joint_weights.shape[1],
        tolerance_mm=details.tolerance_mm,
        link_limits_mm=details.link_limits_mm,
        zero=zero,
    )


def _frame_at_zero(
    supports: FloatArray, plate: FloatArray, rotation_M_B: FloatArray, base_joints: FloatArray, carriers: IntArray
) -> tuple[FrameGeometry, FloatArray]:
    """The frame, and its nine distances at machine zero."""
    distances, _ = distances_mm(supports, plate)
    origin, rotation = (supports[0], rotation_M_B) if np.isnan(plate).any() else base_pose(supports)
    offsets = to_inner(rotation, np.zeros(3), base_joints - supports[carriers])
    frame = FrameGeometry(plate, _read_only(offsets), carriers, supports, _read_only(origin), _read_only(rotation))
    require(
        solve_frame(frame, distances).reason,
        "frame at machine zero",
        "check supports and plate points, and that rods u1..u6 join them in the order of equation (3)",
    )
    return frame, np.asarray(distances)


def _parallel_attitude(base_joints_M_mm: FloatArray, platform_joints_P_mm: FloatArray) -> FloatArray:
    """Attitude that lays the triangle of the platform joints parallel to that of the base joints: a tripod's guess."""
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
    """Kernels do not check indices and sizes; raise here for those that would read outside an array."""
    links = base_joints.shape[0]
    shapes = {
        "supports_M_mm": (supports.shape, (3, 3)),
        "plate_points_M_mm": (plate.shape, (3, 3)),
        "base_joints_M_mm": (base_joints.shape, (links, 3)),
        "support_of_joint": (carriers.shape, (links,)),
        "platform_joints_P_mm": (platform_joints.shape, (links, 3)),
        "joint_weights": (weights.shape, (links, weights.shape[-1])),
    }
    errors = [f"{name} is {shape}, must be {right}" for name, (shape, right) in shapes.items() if shape != right]
    if errors:
        raise ValueError("; ".join(errors))
    if carriers.min() < 0 or carriers.max() > 2:
        raise KinematicsError.of(
            "support_of_joint", "names a support that is not there", value=str(carriers.tolist()), allowed="0, 1 or 2"
        )


def _read_only(values: ArrayLike) -> FloatArray:
    """A contiguous read-only copy."""
    array = np.array(values, dtype=np.float64, order="C")
    array.flags.writeable = False
    return array
