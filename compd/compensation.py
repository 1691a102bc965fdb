"""From gauge values and a model to a compensated tip and a scale setpoint: pure functions, shared by daemon and replay.

Both modes go the same way: machine frame (3), joints (1), kinematics, and then the effects of the model
(`compd.model.apply_effects`), if it has any. In both, the correction is what is added to the command, and the command
is what a controller that knows nothing of joints and frame would send to bring the tip to its target.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from compd.arrays import FloatArray, IntArray
from compd.errors import KinematicsError, Problem
from compd.model.apply_effects import EffectInputs, EffectMemory, apply_effects, final, final_array
from compd.model.frame import Frame, solve_frame
from compd.model.kernels.rotation import compose, rotation_matrix, to_inner
from compd.model.kinematics import (
    Pose,
    forward_kinematics,
    inverse_kinematics,
    joint_shortening,
    link_length_mm,
    scale_for_length_mm,
)
from compd.model.machine import MachineModel
from compd.model.prediction import PerturbedMachine
from compd.model.tool import Contact

Sources: TypeAlias = Mapping[str, FloatArray]

# In machine-tool mode effects are computed at the scale setpoint, which they shift themselves. After the first pass the
# error left is at most a scale's cyclic error, 1 % of its period; the second leaves 2 pi times 1 % of that: nanometres.
_EFFECT_PASSES = 2


class GaugeValues(NamedTuple):
    """One snapshot, or N rows of them: changes since machine zero, signed as in equations (1), (6) and (7).

    scale_mm : (..., n).  joint_mm : (..., k), in the wiring's order.  frame_mm : (..., 9), t1..t3, u1..u6.
    quantities : anything else by its name with unit (temperatures, forces), each (...): what effects need, or empty.
    time_s : (...), monotonic, for effects with a memory; rows follow each other in time.
    """

    scale_mm: FloatArray
    joint_mm: FloatArray
    frame_mm: FloatArray
    quantities: Mapping[str, FloatArray]
    time_s: FloatArray | float = math.nan


class WarmStart(NamedTuple):
    """Where the last cycle ended and the next one's Newton starts; rows that failed keep what they came with.

    supports_M_mm : (..., 3, 3).  origin_M_mm : (..., 3), rotation_M_P : (..., 3, 3), of the moving platform.
    effects : what the model's effects remember; of N rows, after the last one.
    """

    supports_M_mm: FloatArray
    origin_M_mm: FloatArray
    rotation_M_P: FloatArray
    effects: EffectMemory = EffectMemory()

    @classmethod
    def at_zero(cls, model: MachineModel) -> WarmStart:
        """Machine zero: the first start, and the one that depends on no history."""
        zero = model.zero
        return cls(model.frame.zero_supports_M_mm, zero.platform_origin_M_mm, zero.rotation_M_P)


class Compensation(NamedTuple):
    """What one cycle computes; where reason is not OK every number is nan (frame has a reason of its own).

    tip_M_mm, tip_B0_mm : (..., 3), the tip in {M}, and in {B0} by equation (9). In CMM mode where it is now, in
        machine-tool mode where it will be when the setpoint is reached.
    tip_P_mm : (..., 3), the same place in {P}: with the tool on the plate, the place on the work that it touches.
    rotation_M_P : (..., 3, 3), attitude of the moving platform.
    frame : the machine frame now, with its displacement since machine zero.
    link_length_mm : (..., n): in CMM mode those measured, equation (1); in machine-tool mode those needed.
    target_B_mm : (..., 3), the target in today's {B}, equation (8).
    nominal_scale_mm : (..., n), the command without compensation.
    scale_setpoint_mm : (..., n), what the scales must show for the tip to be on the target.
    correction_mm : (..., n) = scale_setpoint_mm - nominal_scale_mm.
    sources : the correction by cause, (..., n) each; their sum is correction_mm but for rounding.
    reason : (...), a Reason, of the step that failed first.
    """

    tip_M_mm: FloatArray
    tip_B0_mm: FloatArray
    tip_P_mm: FloatArray
    rotation_M_P: FloatArray
    frame: Frame
    link_length_mm: FloatArray
    target_B_mm: FloatArray
    nominal_scale_mm: FloatArray
    scale_setpoint_mm: FloatArray
    correction_mm: FloatArray
    sources: Sources
    reason: IntArray


def compensate_machine_tool(
    model: MachineModel,
    target_mm: ArrayLike,
    target_rotation_B0_rad: ArrayLike | None,
    values: GaugeValues,
    warm: WarmStart,
) -> tuple[Compensation, WarmStart]:
    """Machine-tool mode: equation (8), inverse kinematics with the base joints as they are now, (1) solved for gL.

    target_mm : (..., 3), in {B0}; with the tool on the plate the place on the work, in {P}.
    target_rotation_B0_rad : (..., 3), hexapod only, rotation vector of the attitude wanted for {P} in {B0}; None
        for machine zero's attitude.
    values : the scales are not used and may be nan; effects are computed at the setpoint.
    A row's reason says why it failed (NOT_FINITE, UNREACHABLE, NO_CONVERGENCE, NEAR_SINGULAR, OTHER_ASSEMBLY).
    Raises KinematicsError for an attitude asked of a tripod.
    """
    attitude = _attitude(model, target_rotation_B0_rad, warm)
    target = model.arrangement.target_contact(model.frame, target_mm)
    frame = solve_frame(model.frame, model.zero.distances_mm + values.frame_mm, warm.supports_M_mm)
    nominal = inverse_kinematics(model.mechanism(model.zero.base_joints_M_mm), *target, attitude)
    compensated = inverse_kinematics(model.mechanism(frame.base_joints_M_mm), *target, attitude)
    shortening_mm, joint_reason = joint_shortening(model.joint_weights, values.joint_mm)
    nominal_scale_mm = nominal.link_length_mm - model.zero.link_length_mm
    command = _command(model, nominal, nominal_scale_mm, compensated, shortening_mm)
    reason = np.maximum(np.maximum(joint_reason, frame.reason), np.maximum(nominal.reason, compensated.reason))
    warm_after = WarmStart(frame.supports_M_mm, compensated.origin_M_mm, compensated.rotation_M_P, warm.effects)
    solution = _Solution(frame, compensated, target, target, command, reason)
    if model.live_effects:
        without_effects = solution
        for _ in range(_EFFECT_PASSES):
            setpoint_mm = solution.command.scale_setpoint_mm
            inputs = _effect_inputs(values, setpoint_mm, frame, compensated, target)
            machine, memory = apply_effects(model, inputs, warm.effects, commanded=True)
            solution = _command_with_effects(model, without_effects, machine, attitude)
        warm_after = warm_after._replace(effects=memory)
    return _result(model, solution, warm, warm_after)


def compensate_cmm(model: MachineModel, values: GaugeValues, warm: WarmStart) -> tuple[Compensation, WarmStart]:
    """CMM mode: equations (1) and (3), forward kinematics with the base joints as they are now, and (9).

    The correction is that of the command which the scales show now: its target is where uncompensated kinematics
    takes the tip to be.
    A row's reason says why it failed (NOT_FINITE, UNREACHABLE, NO_CONVERGENCE, NEAR_SINGULAR, OTHER_ASSEMBLY).
    """
    zero_mm = model.zero.link_length_mm
    shortening_mm, joint_reason = joint_shortening(model.joint_weights, values.joint_mm)
    frame = solve_frame(model.frame, model.zero.distances_mm + values.frame_mm, warm.supports_M_mm)
    mechanism = model.mechanism(frame.base_joints_M_mm)
    length_mm = link_length_mm(zero_mm, values.scale_mm, shortening_mm)
    pose = forward_kinematics(mechanism, length_mm, warm.origin_M_mm, warm.rotation_M_P)
    nominal = forward_kinematics(
        model.mechanism(model.zero.base_joints_M_mm), zero_mm + values.scale_mm, warm.origin_M_mm, warm.rotation_M_P
    )
    target = model.arrangement.contact_at(nominal)
    compensated = inverse_kinematics(mechanism, *target, nominal.rotation_M_P)
    command = _command(model, nominal, values.scale_mm, compensated, shortening_mm)
    reason = np.maximum(
        np.maximum(joint_reason, frame.reason), np.maximum(nominal.reason, np.maximum(pose.reason, compensated.reason))
    )
    warm_after = WarmStart(frame.supports_M_mm, pose.origin_M_mm, pose.rotation_M_P, warm.effects)
    solution = _Solution(frame, pose, model.arrangement.contact_at(pose), target, command, reason)
    if model.live_effects:
        inputs = _effect_inputs(values, values.scale_mm, frame, pose, solution.contact)
        machine, memory = apply_effects(model, inputs, warm.effects, commanded=False)
        solution = _command_with_effects(model, solution, machine, nominal.rotation_M_P)
        cumulative_mm = link_length_mm(zero_mm, values.scale_mm, machine.joint_shortening_mm)
        pose = forward_kinematics(
            final(machine.mechanism, mechanism),
            final_array(cumulative_mm + machine.reading_to_length_mm, length_mm),
            warm.origin_M_mm,
            warm.rotation_M_P,
        )
        tool_mm = final_array(machine.tool_mm, model.arrangement.tool_mm)
        solution = solution._replace(
            pose=pose,
            contact=model.arrangement.contact_at(pose, tool_mm),
            reason=np.maximum(solution.reason, pose.reason),
        )
        warm_after = warm_after._replace(effects=memory)
    return _result(model, solution, warm, warm_after)


class _Command(NamedTuple):
    """What the scales are to show, without compensation and with it; (..., n) mm each."""

    nominal_scale_mm: FloatArray
    scale_setpoint_mm: FloatArray
    correction_mm: FloatArray
    sources: Sources


class _Solution(NamedTuple):
    """What a cycle computes, before rows that failed are blanked.

    pose, contact : of the platform and of the tip: where they are (CMM mode), or will be at the setpoint.
    target : the contact to which the command leads.
    """

    frame: Frame
    pose: Pose
    contact: Contact
    target: Contact
    command: _Command
    reason: IntArray


def _command(
    model: MachineModel, nominal: Pose, nominal_scale_mm: FloatArray, compensated: Pose, joint_shortening_mm: FloatArray
) -> _Command:
    """The command by joints and frame alone. The joints' share is what they take from the links; the frame's is by how
    much its displacement changes the lengths."""
    setpoint_mm = scale_for_length_mm(model.zero.link_length_mm, compensated.link_length_mm, joint_shortening_mm)
    sources = {"joints": joint_shortening_mm, "frame": compensated.link_length_mm - nominal.link_length_mm}
    return _Command(nominal_scale_mm, setpoint_mm, setpoint_mm - nominal_scale_mm, sources)


def _effect_inputs(
    values: GaugeValues, scale_mm: FloatArray, frame: Frame, pose: Pose, contact: Contact
) -> EffectInputs:
    return EffectInputs(
        scale_mm, values.joint_mm, values.frame_mm, values.quantities, values.time_s, frame, pose, contact.tip_M_mm
    )


def _command_with_effects(
    model: MachineModel, solution: _Solution, machine: PerturbedMachine, attitude: FloatArray
) -> _Solution:
    """The command that reaches the target on the machine with its effects.

    solution : without effects.  machine : from `apply_effects`, entry k with effects 0 to k. Inverse kinematics solves
    all of them at once; an effect's share is by how much it changes the setpoint of those before it.
    """
    command = solution.command
    target = model.arrangement.with_tool(solution.target, machine.tool_mm)
    cumulative = inverse_kinematics(machine.mechanism, *target, attitude)
    setpoints_mm = scale_for_length_mm(
        model.zero.link_length_mm, cumulative.link_length_mm - machine.reading_to_length_mm, machine.joint_shortening_mm
    )
    shares_mm = setpoints_mm - np.concatenate([command.scale_setpoint_mm[None], setpoints_mm[:-1]])
    ids = [fitted.effect.id for fitted in model.live_effects]
    setpoint_mm = setpoints_mm[-1]
    command = _Command(
        command.nominal_scale_mm,
        setpoint_mm,
        setpoint_mm - command.nominal_scale_mm,
        {**command.sources, **dict(zip(ids, shares_mm, strict=True))},
    )
    reasons = np.maximum(machine.reason, cumulative.reason)
    reason = reasons.max(axis=0) if reasons.ndim > solution.reason.ndim else reasons
    return solution._replace(
        frame=final(machine.frame, solution.frame),
        pose=final(cumulative, solution.pose),
        command=command,
        reason=np.maximum(solution.reason, reason),
    )


def _attitude(model: MachineModel, target_rotation_B0_rad: ArrayLike | None, warm: WarmStart) -> FloatArray:
    """The attitude wanted of a hexapod in {M}; for a tripod the guess to start from."""
    if not model.attitude_is_free:
        if target_rotation_B0_rad is not None:
            raise KinematicsError(
                Problem(
                    where="target",
                    what="a tripod's attitude follows from its tip",
                    value=str(target_rotation_B0_rad),
                    allowed="a position alone",
                    next_step="leave the attitude out",
                )
            )
        return warm.rotation_M_P
    if target_rotation_B0_rad is None:
        return model.zero.rotation_M_P
    return np.asarray(compose(model.frame.zero_rotation_M_B, rotation_matrix(target_rotation_B0_rad)))


def _result(
    model: MachineModel, solution: _Solution, warm: WarmStart, warm_after: WarmStart
) -> tuple[Compensation, WarmStart]:
    """Everything together; where a row failed, all its numbers are nan and its warm start stays as it was."""
    frame, pose, contact, target, command, reason = solution
    result = Compensation(
        tip_M_mm=contact.tip_M_mm,
        tip_B0_mm=to_inner(model.frame.zero_rotation_M_B, model.frame.zero_origin_M_mm, contact.tip_M_mm),
        tip_P_mm=contact.tip_P_mm,
        rotation_M_P=pose.rotation_M_P,
        frame=frame,
        link_length_mm=pose.link_length_mm,
        target_B_mm=to_inner(frame.rotation_M_B, frame.origin_M_mm, target.tip_M_mm),
        nominal_scale_mm=command.nominal_scale_mm,
        scale_setpoint_mm=command.scale_setpoint_mm,
        correction_mm=command.correction_mm,
        sources=command.sources,
        reason=reason,
    )
    if not reason.any():
        return result, warm_after
    warm_after = WarmStart(
        _replace_failed(reason, warm.supports_M_mm, warm_after.supports_M_mm, 2),
        _replace_failed(reason, warm.origin_M_mm, warm_after.origin_M_mm, 1),
        _replace_failed(reason, warm.rotation_M_P, warm_after.rotation_M_P, 2),
        warm_after.effects,
    )
    return _blank_failed(result), warm_after


def _blank_failed(result: Compensation) -> Compensation:
    """nan for every number in the rows that failed; the frame has a reason of its own."""

    def blank(vector: FloatArray) -> FloatArray:
        return _replace_failed(result.reason, np.nan, vector, 1)

    return result._replace(
        tip_M_mm=blank(result.tip_M_mm),
        tip_B0_mm=blank(result.tip_B0_mm),
        tip_P_mm=blank(result.tip_P_mm),
        rotation_M_P=_replace_failed(result.reason, np.nan, result.rotation_M_P, 2),
        link_length_mm=blank(result.link_length_mm),
        target_B_mm=blank(result.target_B_mm),
        nominal_scale_mm=blank(result.nominal_scale_mm),
        scale_setpoint_mm=blank(result.scale_setpoint_mm),
        correction_mm=blank(result.correction_mm),
        sources={name: blank(share) for name, share in result.sources.items()},
    )


def _replace_failed(reason: IntArray, replacement: FloatArray | float, values: FloatArray, core: int) -> FloatArray:
    """`replacement` in the rows that failed; each row of `values` has `core` axes."""
    return np.where(np.reshape(reason, np.shape(reason) + (1,) * core) != 0, replacement, values)
