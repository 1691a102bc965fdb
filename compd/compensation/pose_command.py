"""The pose to command where a machine has no scales: its controller computes links by the drawing, and drives them.

A controller that is told another pose drives other links. The one to tell is where the machine as drawn, on its frame
at machine zero, is with the actuators as the compensation wants them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from compd.arrays import FloatArray
from compd.compensation.compensation import compensate_cmm, compensate_machine_tool
from compd.compensation.followed_start import followed_to_target
from compd.compensation.values import Compensation, Contributions, GaugeValues, WarmStart
from compd.model import MachineModel, tip_by_scales
from compd.model.kernels import Reason
from compd.model.kinematics import Pose
from compd.rotation import rotation_vector, to_inner

_NO_LENGTHS: FloatArray = np.zeros(0)
# A row of the compensation's result has 2 kB.
_ROWS_AT_ONCE = 10_000


def scales_of_command(model: MachineModel, tip_mm: FloatArray, rotation_rad: FloatArray | None) -> FloatArray:
    """(N, m) mm since machine zero: what the actuators of a machine without scales do at the commanded poses.

    Its controller computes them by the drawing, and drives them; nan where the machine as drawn has no such pose.

    tip_mm : (N, 3), in {B0}; with the tool on the plate the place on the work, in {P}. Along an axis that the target
        does not fix it may be nan.
    rotation_rad : (N, 3), rotation vector of {P} in {B0}; None for the attitude at machine zero.
    """
    drawn, nowhere = replace(model, effects=()), np.zeros(model.joint_weights.shape[1])
    tip_mm = np.where(model.actuators.fixed.astype(bool)[:3], tip_mm, 0.0)
    scale_mm = np.full((len(tip_mm), model.scales), np.nan)
    for begin in range(0, len(tip_mm), _ROWS_AT_ONCE):
        rows = slice(begin, begin + _ROWS_AT_ONCE)
        values = GaugeValues(scale_mm[rows], nowhere, _NO_LENGTHS, {})
        turned = rotation_rad[rows] if rotation_rad is not None and model.attitude_is_free else None
        found, _ = compensate_machine_tool(drawn, tip_mm[rows], turned, values, followed_to_target(drawn, tip_mm[rows]))
        solved = found.reason == Reason.OK
        scale_mm[rows][solved] = found.nominal_scale_mm[solved]
    return scale_mm


def command_pose(model: MachineModel, wanted: Compensation) -> Compensation:
    """The compensation of a target in machine-tool mode, as a correction of the target's pose.

    wanted : of one snapshot. Its scales, which the machine does not have, are left out; `contributions` are those of
    the commanded tip, to first order.
    The reason is that of the machine as drawn where it has no such pose.
    """
    nowhere, zero = np.zeros(model.joint_weights.shape[1]), model.zero
    drawn = replace(model, effects=())
    values = GaugeValues(wanted.scale_setpoint_mm, nowhere, _NO_LENGTHS, {})
    # the wanted pose is a correction away from both
    start = WarmStart.at_zero(drawn)._replace(
        origin_M_mm=wanted.tip_M_mm - wanted.rotation_M_P @ wanted.tip_P_mm, rotation_M_P=wanted.rotation_M_P
    )
    command, _ = compensate_cmm(drawn, values, start)
    nominal, _ = compensate_cmm(drawn, values._replace(scale_mm=wanted.nominal_scale_mm), start)
    rotation_M_B = model.frame.zero_rotation_M_B
    moved_B = to_inner(rotation_M_B, np.zeros(3), command.tip_M_mm - nominal.tip_M_mm)
    turned_M = rotation_vector(command.rotation_M_P @ nominal.rotation_M_P.T)
    attitude, solved = command.rotation_M_P[None], np.zeros(1, dtype=np.int64)
    origin_M_mm = command.tip_M_mm[None] - attitude @ zero.contact.tip_P_mm
    pose = Pose(origin_M_mm, attitude, command.link_length_mm[None], solved, np.zeros(1), solved)
    scale_mm = wanted.scale_setpoint_mm[None]
    mechanism, _ = model.links_on(rotation_M_B, model.base_joints_at_0_M_mm[None], scale_mm)
    by_scale = tip_by_scales(model, rotation_M_B, mechanism.base_joints_M_mm, pose, command.tip_M_mm[None], scale_mm)[0]
    contributions = Contributions(wanted.contributions.causes, wanted.contributions.by_cause_mm @ by_scale.T)
    return wanted._replace(
        nominal_scale_mm=_NO_LENGTHS,
        scale_setpoint_mm=_NO_LENGTHS,
        correction_mm=_NO_LENGTHS,
        contributions=contributions,
        rotation_M_rad=rotation_vector(wanted.rotation_M_P),
        pose_correction=np.concatenate([moved_B, to_inner(rotation_M_B, np.zeros(3), turned_M)]),
        reason=np.maximum(wanted.reason, command.reason),
    )
