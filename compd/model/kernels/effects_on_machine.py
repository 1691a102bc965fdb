"""What effects add at the ports of a machine, and the command that reaches the target there all the same.

What effects add stands in one row of numbers, port by port in the order of `_add_to_machine`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.jit import helper
from compd.model.kernels.effect_dispatch import set_basis
from compd.model.kernels.inverse_solver import inverse_standing
from compd.model.kernels.joints import shorten_by_joints
from compd.model.kernels.machine_solver import copy_frame, copy_pose, frame_change_mm, solve_frame
from compd.model.kernels.reason_codes import OK
from compd.model.kernels.row_arguments import EffectArrays
from compd.model.kernels.standing_machine import stand_parts
from compd.model.structures import FRAME, LENGTHS
from compd.rotation import to_outer_frame


@helper
def set_row(
    model: Any,
    pose: Any,
    tip_M_mm: FloatArray,
    scale_mm: FloatArray,
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    time_s: float,
    starts: bool,
    motion: FloatArray,
    row: Any,
) -> None:
    """The instant from which effects are computed, at the pose without effects."""
    n, m, k = model.links, model.scales, joint_mm.shape[0]
    row.links, row.scales = n, m
    row.time_s = time_s
    row.session_start = 1 if starts else 0
    for i in range(n):
        row.link_mm[i] = pose.link_length_mm[i]
        to_outer_frame(pose.rotation_M_P, pose.origin_M_mm, model.platform_joints_P_mm[i], row.directions_M[i])
        for j in range(3):
            row.base_joints_M_mm[i, j] = pose.base_joints_M_mm[i, j]
            row.directions_M[i, j] -= pose.base_joints_M_mm[i, j]
            row.directions_M[i, j] /= pose.link_length_mm[i]
    for i in range(k):
        row.joint_mm[i] = joint_mm[i]
    for i in range(9):
        row.frame_mm[i] = frame_change_mm(frame_mm, i)
    for i in range(3):
        row.origin_M_mm[i] = pose.origin_M_mm[i]
        row.tip_M_mm[i] = tip_M_mm[i]
        for j in range(3):
            row.rotation_M_P[i, j] = pose.rotation_M_P[i, j]
    direction = 1 + 2 * m + k
    for i in range(m):
        row.scale_mm[i] = scale_mm[i]
        row.direction[i] = motion[direction + i] if model.needs_motion else 0.0
        row.velocity_mm_per_s[i] = motion[direction + m + i] if model.needs_motion else math.nan
    for i in range(k):
        row.joint_velocity_mm_per_s[i] = motion[direction + 2 * m + i] if model.needs_motion else math.nan


@helper
def add_effect(
    program: EffectArrays, e: int, row: Any, quantities: FloatArray, memory: FloatArray, added: FloatArray
) -> None:
    """Add basis @ theta of effect e to the row of numbers `added`. memory : of all effects."""
    effect, theta, targets, indices = program.effects[e], program.theta, program.targets, program.quantity_indices
    needed = np.empty(effect.quantities_end - effect.quantities_begin)
    for i in range(needed.shape[0]):
        needed[i] = quantities[indices[effect.quantities_begin + i]]
    parameters = effect.theta_end - effect.theta_begin
    basis = np.zeros((effect.size, parameters))
    set_basis(
        effect.number,
        row,
        program.machine[0],
        needed,
        program.code[effect.code_begin : effect.code_end],
        program.numbers[effect.numbers_begin : effect.numbers_end],
        memory[effect.memory_begin : effect.memory_end],
        basis,
    )
    for i in range(effect.size):
        total = 0.0
        for p in range(parameters):
            total += basis[i, p] * theta[effect.theta_begin + p]
        added[targets[effect.targets_begin + i]] += total


@helper
def _add_to_machine(
    model: Any,
    added: FloatArray,
    level: int,
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    nominal_frame: Any,
    frame: Any,
    altered: Any,
) -> None:
    """The machine with what effects add at its ports, the frame solved anew where its distances or its plate change.

    level : of what has changed; the rest of `altered` is as it was.

    The ports' order in `added` is that of `compd.model.effects.effect_program.LIVE_PORTS`.
    """
    n, m, k, a = model.links, model.scales, joint_mm.shape[0], model.axes
    link = m + k + 9
    base = link + n
    platform, axis = base + 3 * n, base + 6 * n
    plate = axis + 3 * a
    tool = plate + 9
    reading_mm = np.empty(k)
    for i in range(k):
        reading_mm[i] = joint_mm[i] + added[m + i]
    if level == FRAME:
        plate_points_M_mm = np.empty((3, 3))
        distances_mm = np.empty(9)
        for i in range(9):
            plate_points_M_mm[i // 3, i % 3] = model.plate_points_M_mm[i // 3, i % 3] + added[plate + i]
            distances_mm[i] = model.zero_distances_mm[i] + (frame_change_mm(frame_mm, i) + added[m + k + i])
        solve_frame(model, plate_points_M_mm, distances_mm, nominal_frame.supports_M_mm, frame)
    shorten_by_joints(model.joint_weights[:n, :k], reading_mm, altered.joint_shortening_mm[:n], altered.joint_reason)
    for i in range(m):
        altered.scale_mm[i] = added[i]
    for i in range(n):
        altered.reading_to_length_mm[i] = added[link + i]
    if level == LENGTHS:
        return
    stand_parts(model, frame.rotation_M_B, frame.base_joints_M_mm, altered)
    for j in range(3):
        for i in range(n):
            altered.base_joints_M_mm[i, j] += added[base + 3 * i + j]
            altered.platform_joints_P_mm[i, j] += added[platform + 3 * i + j]
        for i in range(a):
            altered.revolute_axes_P[i, j] += added[axis + 3 * i + j]
        altered.tool_mm[j] += added[tool + j]


@helper
def add_effects(
    model: Any,
    effects: Any,
    added_mm: FloatArray,
    every: bool,
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    work: Any,
    result: Any,
    contributions_mm: FloatArray,
    setpoint_mm: FloatArray,
) -> int:
    """The command that reaches the target on the machine with its effects; returns the reason.

    added_mm (K, size) : what each effect adds.  every : compute each effect's contribution, by how much it changes
    the setpoint of those before it; otherwise the setpoint with all of them alone.  setpoint_mm : that without
    effects, and afterwards with them.
    """
    m = model.scales
    total_mm = np.zeros(added_mm.shape[1])
    level = LENGTHS
    reason = OK
    copy_frame(result.bare_frame, result.frame)
    copy_pose(work.command, work.with_effects)
    stand_parts(model, result.frame.rotation_M_B, result.frame.base_joints_M_mm, work.altered)
    for e in range(effects.shape[0]):
        for i in range(total_mm.shape[0]):
            total_mm[i] += added_mm[e, i]
        level = max(level, effects[e].level)
        if not every and e < effects.shape[0] - 1:
            continue
        altered = work.altered
        _add_to_machine(model, total_mm, level, joint_mm, frame_mm, result.bare_frame, result.frame, altered)
        tip_M_mm = altered.tool_mm if model.tool_on_plate else result.target_M_mm
        tip_P_mm = result.target_P_mm if model.tool_on_plate else altered.tool_mm
        work.with_effects.actuator_mm = work.command.actuator_mm
        attitude_M_P = work.nominal.rotation_M_P
        inverse_standing(model, altered, tip_M_mm, tip_P_mm, attitude_M_P, level == LENGTHS, work.with_effects)
        for i in range(m):
            setpoint = work.with_effects.actuator_mm[i] - model.zero_actuator_mm[i] - altered.scale_mm[i]
            contributions_mm[2 + e, i] = setpoint - setpoint_mm[i]
            setpoint_mm[i] = setpoint
        reason = max(reason, altered.joint_reason[0], result.frame.reason[0], work.with_effects.reason[0])
        level = LENGTHS
    return reason
