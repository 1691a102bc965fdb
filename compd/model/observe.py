"""From gauge values to the rows that effects see, through the nominal model: no effect has acted yet."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compd.arrays import FloatArray
from compd.model.frame import solve_frame
from compd.model.joint_correction import joint_shortening, link_length_mm
from compd.model.kinematics import Pose, forward_kinematics
from compd.model.machine import MachineModel
from compd.model.observations import Constants, Observations
from compd.model.statics import link_forces
from compd.model.transform import to_outer

_NAN = float("nan")


class Details(NamedTuple):
    """What effects ask of a machine's description beyond its kinematics; nan where it says nothing.

    plate_thickness_mm, scale_signal_period_mm: of the configuration's `geometry:`.
    instrument_M_mm: where the reference instrument's beam starts. Only reference_air_index asks, and without a
    place of its own the beam is taken to start at the origin of {M}.
    """

    plate_thickness_mm: float = _NAN
    scale_signal_period_mm: float = _NAN
    instrument_M_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Movement(NamedTuple):
    """How the links move at each row, as far as it is known.

    direction (N, n): +1 or -1 as the link last moved, 0 where unknown.
    velocity_mm_per_s (N, n), joint_velocity_mm_per_s (N, k): of the readings.
    """

    direction: FloatArray
    velocity_mm_per_s: FloatArray
    joint_velocity_mm_per_s: FloatArray


def constants(model: MachineModel, details: Details) -> Constants:
    """What rows of this machine have in common. Once per machine, not per cycle."""
    zero = model.zero
    platform_joints_M = to_outer(zero.rotation_M_P, zero.platform_origin_M_mm, model.platform_joints_P_mm)
    directions_M = (platform_joints_M - zero.base_joints_M_mm) / zero.link_length_mm[:, None]
    if len(model.revolute_axes_P):
        axes_M = to_outer(zero.rotation_M_P, np.zeros(3), model.revolute_axes_P)
    else:
        # a vertical link has no horizontal of its own: {M}'s x serves
        level = np.cross(directions_M, [0.0, 0.0, 1.0])
        axes_M = np.where(np.linalg.norm(level, axis=1, keepdims=True) > 1e-6, level, [1.0, 0.0, 0.0])
    axes_M = axes_M - (axes_M * directions_M).sum(axis=1, keepdims=True) * directions_M
    weight_alone = link_forces(
        model.mechanism(zero.base_joints_M_mm),
        zero.platform_origin_M_mm,
        zero.rotation_M_P,
        np.zeros(3),
        zero.contact.tip_M_mm,
        model.weight_N,
        model.weight_at_P_mm,
    )
    return Constants(
        platform_joints_P_mm=model.platform_joints_P_mm,
        revolute_axes_P=model.revolute_axes_P,
        tool_P_mm=zero.contact.tip_P_mm,
        zero_directions_M=directions_M,
        zero_axes_M=axes_M / np.linalg.norm(axes_M, axis=1, keepdims=True),
        zero_axial_force_N=weight_alone.axial_N,
        weight_N=model.weight_N,
        weight_at_P_mm=model.weight_at_P_mm,
        frame_zero_mm=zero.distances_mm,
        plate_points_M_mm=model.frame.plate_points_M_mm,
        plate_thickness_mm=details.plate_thickness_mm,
        scale_signal_period_mm=details.scale_signal_period_mm,
        instrument_M_mm=np.array(details.instrument_M_mm),
    )


def observe(
    model: MachineModel,
    common: Constants,
    *,
    scale_mm: FloatArray,
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    quantities: Mapping[str, FloatArray],
    time_s: ArrayLike,
    session_start: NDArray[Any],
    movement: Movement,
) -> Observations:
    """N rows by equations (1), (3) and forward kinematics, each from machine zero, so that no row needs another.

    scale_mm (N, n), joint_mm (N, k), frame_mm (N, 9): changes since machine zero.  quantities: (N,) each.
    time_s (N,).  session_start (N,): True where a row has no history.
    A row that has no pose is nan in everything that the pose gives.
    Raises CompdError where a quantity is a column of the reference.
    """
    zero = model.zero
    frame = solve_frame(model.frame, zero.distances_mm + frame_mm)
    shortening_mm, _ = joint_shortening(model.joint_weights, joint_mm)
    length_mm = link_length_mm(zero.link_length_mm, scale_mm, shortening_mm)
    pose = forward_kinematics(
        model.mechanism(frame.base_joints_M_mm), length_mm, zero.platform_origin_M_mm, zero.rotation_M_P
    )
    return rows_at(
        common,
        frame.base_joints_M_mm,
        pose,
        # a tool that stands on the plate is at the same place in every row
        np.broadcast_to(model.arrangement.made(pose).tip_M_mm, pose.origin_M_mm.shape),
        scale_mm=scale_mm,
        joint_mm=joint_mm,
        frame_mm=frame_mm,
        quantities=quantities,
        time_s=np.asarray(time_s, dtype=np.float64),
        session_start=session_start,
        movement=movement,
    )


def rows_at(
    common: Constants,
    base_joints_M_mm: FloatArray,
    pose: Pose,
    tip_M_mm: FloatArray,
    *,
    scale_mm: FloatArray,
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    quantities: Mapping[str, FloatArray],
    time_s: FloatArray,
    session_start: NDArray[Any],
    movement: Movement,
) -> Observations:
    """N rows whose base joints (N, n, 3), pose and tip (N, 3) are known; the rest as in `observe`."""
    joints_M = to_outer(pose.rotation_M_P[:, None], pose.origin_M_mm[:, None], common.platform_joints_P_mm)
    return Observations(
        constants=common,
        scale_mm=scale_mm,
        joint_mm=joint_mm,
        frame_mm=frame_mm,
        quantities=quantities,
        time_s=time_s,
        session_start=session_start,
        direction=movement.direction,
        velocity_mm_per_s=movement.velocity_mm_per_s,
        joint_velocity_mm_per_s=movement.joint_velocity_mm_per_s,
        link_mm=pose.link_length_mm,
        directions_M=(joints_M - base_joints_M_mm) / pose.link_length_mm[:, :, None],
        base_joints_M_mm=base_joints_M_mm,
        origin_M_mm=pose.origin_M_mm,
        rotation_M_P=pose.rotation_M_P,
        tip_M_mm=tip_M_mm,
    )


def observe_tip(
    tip_M_mm: FloatArray, quantities: Mapping[str, FloatArray], time_s: FloatArray, session_start: NDArray[Any]
) -> Observations:
    """Observations of a machine that another model computes: only the tip (N, 3) is known, and what was measured.

    Effects at the port `reference` can act on them; `missing` refuses the others.
    """
    count = len(tip_M_mm)
    none, no_vectors = np.zeros((count, 0)), np.zeros((0, 3))
    common = Constants(
        no_vectors,
        no_vectors,
        np.full(3, _NAN),
        no_vectors,
        no_vectors,
        np.zeros(0),
        _NAN,
        np.full(3, _NAN),
        np.full(9, _NAN),
        np.full((3, 3), _NAN),
        _NAN,
        _NAN,
        np.zeros(3),
    )
    return Observations(
        common,
        none,
        none,
        np.full((count, 9), _NAN),
        quantities,
        time_s,
        session_start,
        none,
        none,
        none,
        none,
        np.zeros((count, 0, 3)),
        np.zeros((count, 0, 3)),
        np.full((count, 3), _NAN),
        np.full((count, 3, 3), _NAN),
        tip_M_mm,
    )
