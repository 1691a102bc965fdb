"""The compensation of one snapshot after the other, in both modes, with the effects of a model; see
`compd.compensation.compensation`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.model.kernels.effect_row import EFFECT_MACHINE
from compd.model.kernels.effects_on_machine import add_effect, add_effects, set_row
from compd.model.kernels.jit import COUNT, FLAG, INDEX_ROWS, INDICES, NUMBERS, ROW_MATRICES, ROWS, helper, loop
from compd.model.kernels.joints import shorten_by_joints
from compd.model.kernels.machine_solver import (
    copy_frame,
    copy_pose,
    forward_pose,
    inverse_pose,
    set_contact,
    solve_frame,
)
from compd.model.kernels.motion import advance_motion
from compd.model.kernels.reason_codes import OK
from compd.model.kernels.rotation import to_inner_frame
from compd.model.kernels.solver_structures import EFFECTS, GIVEN, MODELS, RESULTS, WORKSPACES


@helper
def _solve_bare(
    model: Any,
    machine_tool: bool,
    scale_mm: FloatArray,
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    attitude_M_P: FloatArray,
    warm_supports_M_mm: FloatArray,
    warm_origin_M_mm: FloatArray,
    warm_rotation_M_P: FloatArray,
    work: Any,
    result: Any,
    contributions_mm: FloatArray,
) -> None:
    """The cycle without effects: equations (1) to (9)."""
    n, k = model.links, joint_mm.shape[0]
    distances_mm = np.empty(9)
    for i in range(9):
        distances_mm[i] = model.zero_distances_mm[i] + frame_mm[i]
    frame, pose = result.bare_frame, result.bare_pose
    solve_frame(model, model.plate_points_M_mm, distances_mm, warm_supports_M_mm, frame)
    shorten_by_joints(model.joint_weights[:n, :k], joint_mm, contributions_mm[0], work.altered.joint_reason)
    base_M_mm, zero_base_M_mm = frame.base_joints_M_mm, model.zero_base_joints_M_mm
    if machine_tool:
        inverse_pose(model, zero_base_M_mm, model, result.target_M_mm, result.target_P_mm, attitude_M_P, work.nominal)
        inverse_pose(model, base_M_mm, model, result.target_M_mm, result.target_P_mm, attitude_M_P, pose)
        copy_pose(pose, work.command)
        result.tip_M_mm[:] = result.target_M_mm
        result.tip_P_mm[:] = result.target_P_mm
    else:
        length_mm = np.empty(n)
        nominal_mm = np.empty(n)
        for i in range(n):
            nominal_mm[i] = model.zero_link_length_mm[i] + scale_mm[i]
            length_mm[i] = nominal_mm[i] - contributions_mm[0, i]
        forward_pose(model, base_M_mm, model, length_mm, warm_origin_M_mm, warm_rotation_M_P, pose)
        forward_pose(model, zero_base_M_mm, model, nominal_mm, warm_origin_M_mm, warm_rotation_M_P, work.nominal)
        set_contact(model, work.nominal, model.tool_mm, result.target_M_mm, result.target_P_mm)
        inverse_pose(
            model,
            base_M_mm,
            model,
            result.target_M_mm,
            result.target_P_mm,
            work.nominal.rotation_M_P,
            work.command,
        )
        set_contact(model, pose, model.tool_mm, result.tip_M_mm, result.tip_P_mm)
    for i in range(n):
        length_mm_i = work.command.link_length_mm[i]
        nominal_mm_i = work.nominal.link_length_mm[i]
        result.nominal_scale_mm[i] = nominal_mm_i - model.zero_link_length_mm[i] if machine_tool else scale_mm[i]
        result.scale_setpoint_mm[i] = length_mm_i - model.zero_link_length_mm[i] + contributions_mm[0, i]
        contributions_mm[1, i] = length_mm_i - nominal_mm_i
    result.reason = max(
        work.altered.joint_reason[0],
        frame.reason[0],
        work.nominal.reason[0],
        pose.reason[0],
        work.command.reason[0],
    )
    copy_frame(frame, result.frame)
    copy_pose(pose, result.pose)


@helper
def _finish(model: Any, result: Any, contributions_mm: FloatArray) -> None:
    """What follows from the tip and the target; where the row failed, every number is nan."""
    n = model.links
    to_inner_frame(model.zero_rotation_M_B, model.zero_origin_M_mm, result.tip_M_mm, result.tip_B0_mm)
    to_inner_frame(result.frame.rotation_M_B, result.frame.origin_M_mm, result.target_M_mm, result.target_B_mm)
    for i in range(n):
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
    n, altered = model.links, work.altered
    length_mm = np.empty(n)
    for i in range(n):
        length_mm[i] = model.zero_link_length_mm[i] + scale_mm[i] - altered.joint_shortening_mm[i]
        length_mm[i] += altered.reading_to_length_mm[i]
    forward_pose(model, altered.base_joints_M_mm, altered, length_mm, warm_origin_M_mm, warm_rotation_M_P, result.pose)
    set_contact(model, result.pose, altered.tool_mm, result.tip_M_mm, result.tip_P_mm)
    return result.pose.reason[0]  # type: ignore[no-any-return]


@loop(
    [
        *[FLAG, COUNT, FLAG, FLAG],
        *[MODELS, EFFECT_MACHINE, EFFECTS, NUMBERS, NUMBERS, INDEX_ROWS, INDICES, INDICES],
        *[ROWS, ROWS, ROWS, ROWS, NUMBERS, ROWS, ROW_MATRICES, ROWS, ROW_MATRICES],
        *[ROW_MATRICES, ROWS, ROW_MATRICES, NUMBERS, NUMBERS],
        *[WORKSPACES, RESULTS, ROW_MATRICES],
    ]
)
def compensate_rows(  # noqa: PLR0912  the steps of a cycle, in their order
    machine_tool: bool,
    passes: int,
    starts: bool,
    other_mode: bool,
    models: Any,
    machines: Any,
    effects: Any,
    theta: FloatArray,
    numbers: FloatArray,
    code: IntArray,
    quantity_places: IntArray,
    targets: IntArray,
    scale_mm: FloatArray,
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    quantities: FloatArray,
    time_s: FloatArray,
    target_mm: FloatArray,
    attitude_M_P: FloatArray,
    effects_at_mm: FloatArray,
    given_mm: FloatArray,
    warm_supports_M_mm: FloatArray,
    warm_origin_M_mm: FloatArray,
    warm_rotation_M_P: FloatArray,
    motion: FloatArray,
    memory: FloatArray,
    works: Any,
    results: Any,
    contributions_mm: FloatArray,
) -> None:
    """N rows of `results` and of `contributions_mm` (N, 2 + K, n): joints, frame, and each of K effects.

    passes : how often effects are computed, each time at the setpoint of the time before.  starts : the first row has
    no history.  other_mode : the motion before the first row is of the other mode.
    models, machines, works (1,).  The effects' numbers: see `compd.model.effect_program.EffectProgram`.
    scale_mm (N, n), joint_mm (N, k), frame_mm (N, 9), time_s (N,).  quantities (N, q + z) : those that the effects
        need, and behind them those from which the effects count, in the order of the program.
    target_mm (N, 6) : the contact in {M} and in {P}, attitude_M_P (N, 3, 3) : wanted; both in machine-tool mode alone.
    effects_at_mm (N, n) : in machine-tool mode the scales at which effects are computed first; nan for the setpoint
        without effects.
    given_mm (N, K, size) : what effects without a kernel add.
    warm_ (N, ...) or (1, ...).  motion, memory : before the first row, and after the last.
    """
    model, work = models[0], works[0]
    n = model.links
    added_mm = np.zeros((effects.shape[0], given_mm.shape[2]))
    at_mm = np.empty(n)
    attitude = np.empty((3, 3))
    memory_before, motion_before = np.empty_like(memory), np.empty_like(motion)
    for r in range(scale_mm.shape[0]):
        result = results[r]
        w = min(r, warm_supports_M_mm.shape[0] - 1)
        result.target_M_mm[:] = target_mm[r, :3]
        result.target_P_mm[:] = target_mm[r, 3:]
        _solve_bare(
            model,
            machine_tool,
            scale_mm[r],
            joint_mm[r],
            frame_mm[r],
            attitude_M_P[r],
            warm_supports_M_mm[w],
            warm_origin_M_mm[w],
            warm_rotation_M_P[w],
            work,
            result,
            contributions_mm[r],
        )
        result.warm_supports_M_mm[:, :] = result.bare_frame.supports_M_mm
        result.warm_origin_M_mm[:] = result.bare_pose.origin_M_mm
        result.warm_rotation_M_P[:, :] = result.bare_pose.rotation_M_P
        if effects.shape[0] > 0:
            for i in range(n):
                at_mm[i] = scale_mm[r, i]
                if machine_tool:
                    at_mm[i] = result.scale_setpoint_mm[i] if math.isnan(effects_at_mm[r, i]) else effects_at_mm[r, i]
            if machine_tool:
                attitude[:, :] = attitude_M_P[r]
            else:
                attitude[:, :] = work.nominal.rotation_M_P
            memory_before[:] = memory
            motion_before[:] = motion
            reason = OK
            for p in range(passes):
                memory[:] = memory_before
                motion[:] = motion_before
                if model.needs_motion:
                    _advance(motion, other_mode and r == 0, time_s[r], at_mm, joint_mm[r])
                set_row(
                    model,
                    result.bare_frame.base_joints_M_mm,
                    result.bare_pose,
                    result.tip_M_mm,
                    at_mm,
                    joint_mm[r],
                    frame_mm[r],
                    time_s[r],
                    starts and r == 0,
                    motion,
                    work.row,
                )
                for e in range(effects.shape[0]):
                    if effects[e].number == GIVEN:
                        added_mm[e] = given_mm[r, e]
                    else:
                        added_mm[e] = 0.0
                        add_effect(
                            effects[e],
                            work.row,
                            machines[0],
                            quantities[r],
                            quantity_places,
                            code,
                            numbers,
                            theta,
                            targets,
                            memory,
                            added_mm[e],
                        )
                at_mm[:] = result.scale_setpoint_mm[:n]
                reason = add_effects(
                    model,
                    effects,
                    added_mm,
                    p == passes - 1,
                    joint_mm[r],
                    frame_mm[r],
                    attitude,
                    work,
                    result,
                    contributions_mm[r],
                    at_mm,
                )
            result.scale_setpoint_mm[:n] = at_mm
            if machine_tool:
                copy_pose(work.with_effects, result.pose)
            else:
                reason = max(
                    reason,
                    _solve_altered_pose(model, scale_mm[r], warm_origin_M_mm[w], warm_rotation_M_P[w], work, result),
                )
            result.reason = max(result.reason, reason)
        if result.reason != OK:
            result.warm_supports_M_mm[:, :] = warm_supports_M_mm[w]
            result.warm_origin_M_mm[:] = warm_origin_M_mm[w]
            result.warm_rotation_M_P[:, :] = warm_rotation_M_P[w]
        _finish(model, result, contributions_mm[r])
