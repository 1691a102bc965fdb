"""The compensation of one snapshot after the other, in both modes, with the effects of a model; see
`compd.compensation.compensation`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.jit import ROW_MATRICES, ROWS, helper, loop
from compd.model.kernels.effects_on_machine import add_effect, add_effects, set_row
from compd.model.kernels.inverse_solver import inverse_standing
from compd.model.kernels.joints import shorten_by_joints
from compd.model.kernels.machine_solver import (
    copy_frame,
    copy_pose,
    set_contact,
    set_distances,
    solve_frame,
)
from compd.model.kernels.motion import advance_motion
from compd.model.kernels.reason_codes import OK
from compd.model.kernels.row_arguments import (
    EFFECT_ARRAYS,
    GAUGE_ROWS,
    GIVEN_ROWS,
    MEMORY_ARRAYS,
    ROW_OPTIONS,
    SOLVED_ROWS,
    WANTED_ROWS,
    WARM_ROWS,
    EffectArrays,
    GaugeRows,
    GivenRows,
    MemoryArrays,
    RowOptions,
    SolvedRows,
    WantedRows,
    WarmRows,
)
from compd.model.kernels.standing_machine import forward_standing, stand_on
from compd.model.structures import GIVEN, MODELS
from compd.rotation import to_inner_frame


@helper
def _solve_bare(
    model: Any,
    machine_tool: bool,
    gauges: GaugeRows,
    wanted: WantedRows,
    warm: WarmRows,
    r: int,
    work: Any,
    result: Any,
    contributions_mm: FloatArray,
) -> None:
    """Row r of the cycle without effects: equations (1) to (9)."""
    scale_mm, joint_mm, frame_mm = gauges.scale_mm[r], gauges.joint_mm[r], gauges.frame_mm[r]
    w = min(r, warm.supports_M_mm.shape[0] - 1)
    n, m, k = model.links, model.scales, joint_mm.shape[0]
    distances_mm = np.empty(9)
    set_distances(model, frame_mm, distances_mm)
    frame, pose = result.bare_frame, result.bare_pose
    solve_frame(model, model.plate_points_M_mm, distances_mm, warm.supports_M_mm[w], frame)
    nominal, command, at_zero, standing = work.nominal, work.command, work.at_zero, work.standing
    stand_on(model, model.zero_rotation_M_B, model.zero_base_joints_M_mm, at_zero)
    stand_on(model, frame.rotation_M_B, frame.base_joints_M_mm, standing)
    shortened, reason = work.altered, standing.joint_reason
    shorten_by_joints(model.joint_weights[:n, :k], joint_mm, shortened.joint_shortening_mm[:n], reason)
    if not machine_tool:
        standing.joint_shortening_mm = shortened.joint_shortening_mm
        forward_standing(model, standing, scale_mm, warm.origin_M_mm[w], warm.rotation_M_P[w], pose)
        forward_standing(model, at_zero, scale_mm, warm.origin_M_mm[w], warm.rotation_M_P[w], nominal)
        set_contact(model, nominal, model.tool_mm, result.target_M_mm, result.target_P_mm)
        standing.joint_shortening_mm[:n] = 0.0
    else:
        nominal.actuator_mm[:m] = warm.actuator_mm[w]
        attitude_M_P = wanted.attitude_M_P[r]
        inverse_standing(model, at_zero, result.target_M_mm, result.target_P_mm, attitude_M_P, False, nominal)
    # what the frame does, and then what the joints do: an actuator may have several links
    command.actuator_mm = nominal.actuator_mm
    inverse_standing(model, standing, result.target_M_mm, result.target_P_mm, nominal.rotation_M_P, False, command)
    for a in range(m):
        contributions_mm[1, a] = command.actuator_mm[a] - nominal.actuator_mm[a]
        contributions_mm[0, a] = 0.0
    if k > 0:
        standing.joint_shortening_mm = shortened.joint_shortening_mm
        inverse_standing(model, standing, result.target_M_mm, result.target_P_mm, nominal.rotation_M_P, True, command)
        for a in range(m):
            contributions_mm[0, a] = command.actuator_mm[a] - nominal.actuator_mm[a] - contributions_mm[1, a]
    if machine_tool:
        copy_pose(command, pose)
        # where a target fixes fewer than six coordinates the others are those of the pose
        set_contact(model, nominal, model.tool_mm, result.target_M_mm, result.target_P_mm)
    set_contact(model, pose, model.tool_mm, result.tip_M_mm, result.tip_P_mm)
    for a in range(m):
        result.nominal_scale_mm[a] = nominal.actuator_mm[a] - model.zero_actuator_mm[a] if machine_tool else scale_mm[a]
        result.scale_setpoint_mm[a] = command.actuator_mm[a] - model.zero_actuator_mm[a]
    result.reason = max(reason[0], frame.reason[0], nominal.reason[0], pose.reason[0], command.reason[0])
    copy_frame(frame, result.frame)
    copy_pose(pose, result.pose)


@helper
def _finish(model: Any, result: Any, contributions_mm: FloatArray) -> None:
    """What follows from the tip and the target; where the row failed, every number is nan."""
    to_inner_frame(model.zero_rotation_M_B, model.zero_origin_M_mm, result.tip_M_mm, result.tip_B0_mm)
    to_inner_frame(result.frame.rotation_M_B, result.frame.origin_M_mm, result.target_M_mm, result.target_B_mm)
    for i in range(model.scales):
        result.correction_mm[i] = result.scale_setpoint_mm[i] - result.nominal_scale_mm[i]
    if result.reason == OK:
        return
    result.tip_M_mm[:] = math.nan
    result.tip_P_mm[:] = math.nan
    result.tip_B0_mm[:] = math.nan
    result.target_B_mm[:] = math.nan
    result.pose.rotation_M_P[:, :] = math.nan
    result.pose.link_length_mm[:] = math.nan
    result.nominal_scale_mm[:] = math.nan
    result.scale_setpoint_mm[:] = math.nan
    result.correction_mm[:] = math.nan
    contributions_mm[:, :] = math.nan


@helper
def _set_warm(model: Any, warm: WarmRows, w: int, result: Any) -> None:
    """Where the next cycle starts: at this row's solution without effects, or where this row did if it failed."""
    if result.reason == OK:
        result.warm_supports_M_mm = result.bare_frame.supports_M_mm
        result.warm_origin_M_mm = result.bare_pose.origin_M_mm
        result.warm_rotation_M_P = result.bare_pose.rotation_M_P
        result.warm_actuator_mm = result.bare_pose.actuator_mm
        return
    result.warm_supports_M_mm[:, :] = warm.supports_M_mm[w]
    result.warm_origin_M_mm[:] = warm.origin_M_mm[w]
    result.warm_rotation_M_P[:, :] = warm.rotation_M_P[w]
    result.warm_actuator_mm[: model.scales] = warm.actuator_mm[w]


@helper
def _advance(motion: FloatArray, other_mode: bool, time_s: float, scale_mm: FloatArray, joint_mm: FloatArray) -> None:
    """The motion after this snapshot. other_mode : the snapshot before it was of the other mode."""
    n, k = scale_mm.shape[0], joint_mm.shape[0]
    if other_mode and not math.isnan(motion[0]):
        # a scale does not stand where it is commanded: changing from one mode to the other is no motion
        motion[1 : 1 + n] = scale_mm
        motion[1 + n + k : 1 + 2 * n + k] = scale_mm
    advance_motion(motion, time_s, scale_mm, joint_mm)


@helper
def _solve_altered_pose(
    model: Any,
    scale_mm: FloatArray,
    warm_origin_M_mm: FloatArray,
    warm_rotation_M_P: FloatArray,
    work: Any,
    result: Any,
) -> int:
    """Where the tip is in CMM mode on the machine with its effects; returns the reason."""
    altered = work.altered
    shown_mm = scale_mm + altered.scale_mm[: model.scales]
    forward_standing(model, altered, shown_mm, warm_origin_M_mm, warm_rotation_M_P, result.pose)
    set_contact(model, result.pose, altered.tool_mm, result.tip_M_mm, result.tip_P_mm)
    return result.pose.reason[0]  # type: ignore[no-any-return]


@helper
def _add_each_effect(
    program: EffectArrays,
    given_mm: FloatArray,
    r: int,
    quantities: FloatArray,
    memory: FloatArray,
    row: Any,
    added_mm: FloatArray,
) -> None:
    """What each effect adds in row r, added_mm (K, size); given_mm (N, K, size) by those without a kernel."""
    for e in range(program.effects.shape[0]):
        if program.effects[e].number == GIVEN:
            added_mm[e] = given_mm[r, e]
        else:
            added_mm[e] = 0.0
            add_effect(program, e, row, quantities, memory, added_mm[e])


@loop(
    [
        *[ROW_OPTIONS, MODELS, EFFECT_ARRAYS, GAUGE_ROWS, ROWS],
        *[WANTED_ROWS, GIVEN_ROWS, WARM_ROWS, MEMORY_ARRAYS, SOLVED_ROWS, ROW_MATRICES],
    ]
)
def compensate_rows(
    options: RowOptions,
    models: Any,
    program: EffectArrays,
    gauges: GaugeRows,
    quantities: FloatArray,
    wanted: WantedRows,
    given: GivenRows,
    warm: WarmRows,
    carried: MemoryArrays,
    solved: SolvedRows,
    contributions_mm: FloatArray,
) -> None:
    """N rows of `solved` and of `contributions_mm` (N, 2 + K, m), which are of joints, frame, and each of K effects.

    models (1,).  quantities (N, q + z) : those that the effects need, and behind them those from which the effects
    count, in the order of the program.
    """
    machine_tool, passes = options.machine_tool, options.passes
    effects, memory, motion = program.effects, carried.memories, carried.motion
    model, work = models[0], solved.works[0]
    m = model.scales
    for r in range(gauges.scale_mm.shape[0]):
        result = solved.results[r]
        scale_mm, joint_mm, frame_mm, time_s = (
            gauges.scale_mm[r],
            gauges.joint_mm[r],
            gauges.frame_mm[r],
            gauges.time_s[r],
        )
        w = min(r, warm.supports_M_mm.shape[0] - 1)
        result.target_M_mm[:] = wanted.target_mm[r, :3]
        result.target_P_mm[:] = wanted.target_mm[r, 3:]
        _solve_bare(model, machine_tool, gauges, wanted, warm, r, work, result, contributions_mm[r])
        if effects.shape[0] > 0:
            added_mm, at_mm = np.zeros((effects.shape[0], given.added_mm.shape[2])), np.empty(m)
            memory_before, motion_before = memory.copy(), motion.copy()
            for i in range(m):
                at_mm[i] = scale_mm[i]
                if machine_tool:
                    effects_at_mm = given.effects_at_mm[r, i]
                    at_mm[i] = result.scale_setpoint_mm[i] if math.isnan(effects_at_mm) else effects_at_mm
            reason = OK
            for p in range(passes):
                memory[:] = memory_before
                motion[:] = motion_before
                if model.needs_motion:
                    _advance(motion, options.other_mode and r == 0, time_s, at_mm, joint_mm)
                set_row(
                    model,
                    result.bare_pose,
                    result.tip_M_mm,
                    at_mm,
                    joint_mm,
                    frame_mm,
                    time_s,
                    options.starts and r == 0,
                    motion,
                    work.row,
                )
                _add_each_effect(program, given.added_mm, r, quantities[r], memory, work.row, added_mm)
                at_mm[:] = result.scale_setpoint_mm[:m]
                reason = add_effects(
                    model,
                    effects,
                    added_mm,
                    p == passes - 1,
                    joint_mm,
                    frame_mm,
                    work,
                    result,
                    contributions_mm[r],
                    at_mm,
                )
            result.scale_setpoint_mm[:m] = at_mm
            if machine_tool:
                copy_pose(work.with_effects, result.pose)
            else:
                reason = max(
                    reason,
                    _solve_altered_pose(model, scale_mm, warm.origin_M_mm[w], warm.rotation_M_P[w], work, result),
                )
            result.reason = max(result.reason, reason)
        _set_warm(model, warm, w, result)
        _finish(model, result, contributions_mm[r])
