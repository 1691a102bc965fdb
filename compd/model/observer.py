"""Observations from gauge values, through the nominal model: the rows from which effects are computed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.model.effects import MachineConstants, Observations
from compd.model.kernels import GaugeRows, Reason, joint_shortening
from compd.model.kinematics import Frame, Mechanism, Movement, Pose, ToolOnPlatform, forward_kinematics, solve_frame
from compd.model.machine import MachineModel
from compd.rotation import to_outer

# Of the shortest link, the most that a scale moves between two poses solved one from the other.
_STEP_SHARE = 0.1


class EffectInputs(NamedTuple):
    """What effects are computed from in N snapshots.

    quantities : (N,) each, by name.  quantities_at_zero : the same at machine zero; None where that is not known.
    base_joints_M_mm (N, n, 3), pose, tip_M_mm (N, 3): by the kinematics alone.
    """

    gauges: GaugeRows
    quantities: Mapping[str, FloatArray]
    quantities_at_zero: Mapping[str, float] | None
    base_joints_M_mm: FloatArray
    pose: Pose
    tip_M_mm: FloatArray


def observe(
    model: MachineModel,
    constants: MachineConstants,
    *,
    scale_mm: FloatArray,
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    quantities: Mapping[str, FloatArray],
    time_s: ArrayLike,
    session_start: BoolArray,
    movement: Movement,
    quantities_at_zero: Mapping[str, float] | None = None,
) -> Observations:
    """N rows by equations (1), (3) and forward kinematics, each followed from machine zero: no row needs another.

    constants : of this machine, from `machine_constants`.
    scale_mm (N, m), joint_mm (N, k), frame_mm (N, 9), or as in `whole_frame_mm`: changes since machine zero.
    quantities: (N,) each.  time_s (N,).  session_start (N,): True where a row has no history.
    quantities_at_zero: as in `Observations`.
    A row that has no pose is nan in everything that the pose gives.
    Raises CompdError where a quantity is a column of the reference.
    """
    zero, frame_mm = model.zero, whole_frame_mm(frame_mm)
    frame = solve_frame(model.frame, zero.distances_mm + frame_mm)
    shortening_mm, _ = joint_shortening(model.joint_weights, joint_mm)
    mechanism, pose = _from_machine_zero(model, frame, scale_mm, shortening_mm)
    inputs = EffectInputs(
        GaugeRows(scale_mm, joint_mm, frame_mm, np.asarray(time_s, dtype=np.float64)),
        quantities,
        quantities_at_zero,
        mechanism.base_joints_M_mm,
        pose,
        # a tool that stands on the plate is at the same place in every row
        np.broadcast_to(model.arrangement.contact_at(pose).tip_M_mm, pose.origin_M_mm.shape),
    )
    return observe_at_pose(constants, inputs, session_start, movement)


def _from_machine_zero(
    model: MachineModel, frame: Frame, scale_mm: FloatArray, shortening_mm: FloatArray
) -> tuple[Mechanism, Pose]:
    """The links of N rows and their poses, in the assembly of machine zero.

    The scales go from machine zero to a row's readings in equal steps, and Newton starts at the pose of the step
    before: far from machine zero it would else find another assembly, or none.
    """
    zero = model.zero
    longest_mm = np.abs(np.nan_to_num(scale_mm)).max(axis=1, initial=0.0)
    steps = np.maximum(np.ceil(longest_mm / (_STEP_SHARE * float(zero.link_length_mm.min()))), 1.0)
    guess = zero.platform_origin_M_mm, zero.rotation_M_P

    def solved(rows: slice | IntArray, step: int, guess: tuple[FloatArray, FloatArray]) -> Pose:
        reading_mm = scale_mm[rows] * (step / steps[rows])[:, None]
        mechanism, length_mm = model.links_on(frame.rotation_M_B[rows], frame.base_joints_M_mm[rows], reading_mm)
        return forward_kinematics(mechanism, length_mm - shortening_mm[rows], *guess)

    pose = solved(slice(None), 1, guess)
    for step in range(2, int(steps.max(initial=1.0)) + 1):
        going = np.flatnonzero((steps >= step) & (pose.reason == Reason.OK))
        if not len(going):
            break
        ahead = solved(going, step, (pose.origin_M_mm[going], pose.rotation_M_P[going]))
        for values, new in zip(pose, ahead, strict=True):
            values[going] = new
    return model.links_on(frame.rotation_M_B, frame.base_joints_M_mm, scale_mm)[0], pose


def whole_frame_mm(frame_mm: FloatArray) -> FloatArray:
    """(N, 9) changes of t1..t3, u1..u6; those before the ones that are measured, (N, 6) or (N, 0), stay 0."""
    return np.pad(frame_mm, ((0, 0), (9 - frame_mm.shape[-1], 0)))


def observe_at_pose(
    constants: MachineConstants, inputs: EffectInputs, session_start: BoolArray, movement: Movement
) -> Observations:
    """N rows whose pose is solved already; the rest as in `observe`."""
    gauges, quantities, quantities_at_zero, base_joints_M_mm, pose, tip_M_mm = inputs
    joints_M = to_outer(pose.rotation_M_P[:, None], pose.origin_M_mm[:, None], constants.platform_joints_P_mm)
    return Observations(
        constants=constants,
        scale_mm=gauges.scale_mm,
        joint_mm=gauges.joint_mm,
        frame_mm=whole_frame_mm(gauges.frame_mm),
        quantities=quantities,
        time_s=gauges.time_s,
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
        quantities_at_zero=quantities_at_zero,
    )


def observe_external(
    tip_M_mm: FloatArray,
    *,
    scale_mm: FloatArray,
    movement: Movement,
    quantities: Mapping[str, FloatArray],
    time_s: FloatArray,
    session_start: BoolArray,
    recorded: frozenset[str],
) -> Observations:
    """Observations of a machine that an external model computes, of whose kinematics nothing is known.

    tip_M_mm : (N, 3), nan where link lengths are predicted.  scale_mm : (N, n), of the links whose length was measured,
    nan where not recorded; n = 0 for a machine of which the tip was measured.  recorded : as in `Observations`.
    """
    count, links = scale_mm.shape
    no_vectors = np.zeros((0, 3))
    unknown = np.full(3, np.nan)
    constants = MachineConstants(
        platform_joints_P_mm=no_vectors,
        revolute_axes_P=no_vectors,
        hinges=np.zeros((0, 2), dtype=np.int64),
        scale_of_link=np.arange(links),
        actuators=None,
        arrangement=ToolOnPlatform(unknown),
        zero_directions_M=no_vectors,
        zero_axes_M=no_vectors,
        zero_axial_force_N=np.zeros(0),
        zero_axial_per_force=no_vectors,
        weight_N=np.nan,
        weight_at_P_mm=unknown,
        frame_zero_mm=np.full(9, np.nan),
        plate_points_M_mm=np.full((3, 3), np.nan),
        plate_thickness_mm=np.nan,
        scale_signal_period_mm=np.nan,
        instrument_M_mm=np.zeros(3),
        joints=0,
        tolerance_mm=np.nan,
        link_limits_mm=(np.nan, np.nan),
        zero=None,
    )
    return Observations(
        constants=constants,
        scale_mm=scale_mm,
        joint_mm=np.zeros((count, 0)),
        frame_mm=np.full((count, 9), np.nan),
        quantities=quantities,
        time_s=time_s,
        session_start=session_start,
        direction=movement.direction,
        velocity_mm_per_s=movement.velocity_mm_per_s,
        joint_velocity_mm_per_s=movement.joint_velocity_mm_per_s,
        link_mm=np.full((count, links), np.nan),
        directions_M=np.full((count, links, 3), np.nan),
        base_joints_M_mm=np.full((count, links, 3), np.nan),
        origin_M_mm=np.full((count, 3), np.nan),
        rotation_M_P=np.full((count, 3, 3), np.nan),
        tip_M_mm=tip_M_mm,
        recorded=recorded,
    )
