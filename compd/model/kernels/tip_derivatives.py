"""How one snapshot's tip moves with what its uncertainty comes from: lengths, fitted numbers, quantities.

`compd.model.tip_derivative` calls it. In NumPy the same takes milliseconds, more than a cycle at 1 kHz has.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.jit import NUMBERS, helper, loop
from compd.model.kernels.effect_dispatch import set_basis
from compd.model.kernels.effects_on_machine import set_row
from compd.model.kernels.joints import shorten_by_joints
from compd.model.kernels.machine_solver import set_contact, set_distances, solve_frame
from compd.model.kernels.reason_codes import OK
from compd.model.kernels.row_arguments import (
    EFFECT_ARRAYS,
    GAUGE_ROWS,
    MEMORY_ARRAYS,
    SOLVED_ROWS,
    TIP_DERIVATIVE_ARRAYS,
    WARM_ROWS,
    EffectArrays,
    GaugeRows,
    MemoryArrays,
    SolvedRows,
    TipDerivativeArrays,
    WarmRows,
)
from compd.model.kernels.standing_machine import forward_standing, stand_on
from compd.model.kernels.tip_sensitivity import set_tip_by_closure, set_tip_by_ports
from compd.model.structures import GIVEN, MODELS


@helper
def _add_effect(
    program: EffectArrays,
    e: int,
    row: Any,
    quantities: FloatArray,
    raised: FloatArray,
    memory: FloatArray,
    derivatives: TipDerivativeArrays,
) -> None:
    """Add what effect e gives: its basis as it is, and with each of its quantities raised."""
    effect, theta, targets = program.effects[e], program.theta, program.targets
    by_port, by_theta, by_quantity = derivatives.by_port, derivatives.by_theta, derivatives.by_quantity
    indices = program.quantity_indices[effect.quantities_begin : effect.quantities_end]
    needed = np.empty(indices.shape[0])
    basis = np.zeros((effect.size, effect.theta_end - effect.theta_begin))
    raised_basis = np.empty_like(basis)
    for which in range(-1, indices.shape[0] // 2):  # -1: none is raised; the second half is that at machine zero
        for i in range(indices.shape[0]):
            needed[i] = raised[indices[i]] if i == which else quantities[indices[i]]
        raised_basis[:, :] = 0.0
        set_basis(
            effect.number,
            row,
            program.machine[0],
            needed,
            program.code[effect.code_begin : effect.code_end],
            program.numbers[effect.numbers_begin : effect.numbers_end],
            memory[effect.memory_begin : effect.memory_end].copy(),
            raised_basis,
        )
        if which < 0:
            basis[:, :] = raised_basis
        for i in range(effect.size):
            target = targets[effect.targets_begin + i]
            for p in range(basis.shape[1]):
                number = effect.theta_begin + p
                for c in range(3):
                    if which < 0:
                        by_theta[c, number] += by_port[c, target] * basis[i, p]
                    else:
                        changed = (raised_basis[i, p] - basis[i, p]) * theta[number]
                        by_quantity[c, indices[which]] += by_port[c, target] * changed


@loop(
    [MODELS, EFFECT_ARRAYS, GAUGE_ROWS, NUMBERS, NUMBERS, WARM_ROWS, MEMORY_ARRAYS, SOLVED_ROWS, TIP_DERIVATIVE_ARRAYS]
)
def set_tip_derivatives(
    models: Any,
    program: EffectArrays,
    gauges: GaugeRows,
    quantities: FloatArray,
    raised: FloatArray,
    warm: WarmRows,
    carried: MemoryArrays,
    solved: SolvedRows,
    derivatives: TipDerivativeArrays,
) -> None:
    """Fill in the derivatives at the one row of `gauges`; nan where there is no pose.

    models (1,).  quantities (q + z,) : as in `compensate_rows`, those at machine zero behind them.
    raised (q,) : each quantity with what it may be wrong by; `by_quantity` is how far the tip moves with it, mm.
    warm : machine zero.  carried : after the snapshot.  solved : room.
    Of effects without a kernel, by_theta and what they add to by_quantity stay 0.
    """
    model, work, result = models[0], solved.works[0], solved.results[0]
    scale_mm, joint_mm, frame_mm = gauges.scale_mm[0], gauges.joint_mm[0], gauges.frame_mm[0]
    time_s, motion, effects = gauges.time_s[0], carried.motion, program.effects
    by_port, by_theta, by_quantity = derivatives.by_port, derivatives.by_theta, derivatives.by_quantity
    n, standing = model.links, work.standing
    by_port[:, :] = by_theta[:, :] = by_quantity[:, :] = math.nan
    frame, pose = result.bare_frame, result.bare_pose
    distances_mm, length_mm = np.empty(9), np.empty(n)
    set_distances(model, frame_mm, distances_mm)
    solve_frame(model, model.plate_points_M_mm, distances_mm, warm.supports_M_mm[0], frame)
    shorten_by_joints(model.joint_weights[:n, : joint_mm.shape[0]], joint_mm, length_mm, work.altered.joint_reason)
    stand_on(model, frame.rotation_M_B, frame.base_joints_M_mm, standing)
    standing.joint_shortening_mm[:n] = length_mm
    forward_standing(model, standing, scale_mm, warm.origin_M_mm[0], warm.rotation_M_P[0], pose)
    if max(frame.reason[0], work.altered.joint_reason[0], pose.reason[0]) != OK:
        return
    set_contact(model, pose, model.tool_mm, result.tip_M_mm, result.tip_P_mm)
    row, tip_M_mm = work.row, result.tip_M_mm
    set_row(model, pose, tip_M_mm, scale_mm, joint_mm, frame_mm, time_s, False, motion, row)
    by_closure, by_scale = np.empty((3, 6)), np.empty((6, model.scales))
    targets = np.append(program.targets, model.scales + model.joints)  # of the frame's distances one for all
    if not set_tip_by_closure(model, standing, pose, row, tip_M_mm, by_closure, by_scale):
        return
    set_tip_by_ports(
        model,
        standing,
        frame,
        pose,
        row,
        by_closure,
        by_scale,
        frame_mm,
        targets,
        result.frame,
        work.at_zero,
        by_port,
    )
    by_theta[:, :] = by_quantity[:, :] = 0.0
    for e in range(effects.shape[0]):
        if effects[e].number != GIVEN:
            _add_effect(program, e, row, quantities, raised, carried.memories, derivatives)
