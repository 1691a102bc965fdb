"""From gauge values and a model to a compensated tip and a scale setpoint: pure, shared by daemon and replay.

Both modes mean the same by a correction: what is added to the command. The command is what a controller that knows
nothing of joints and frame would send to bring the tip to its target.
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
from compd.model.joint_correction import joint_shortening, link_length_mm, scale_for_length_mm
from compd.model.kernels.rotation import compose, rotation_matrix
from compd.model.kinematics import Pose, forward_kinematics, inverse_kinematics
from compd.model.machine import MachineModel
from compd.model.prediction import PerturbedMachine
from compd.model.tool import Contact, ToolOnPlate
from compd.model.transform import to_inner

Sources: TypeAlias = Mapping[str, FloatArray]

# An effect is looked up where the scales will stand, which effects themselves shift. What is wrong after the first look
# is at most a scale's cyclic error, 1 % of its period; the second leaves 2 pi times 1 % of that: nanometres.
_LOOKS = 2


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
    effects : what the model's effects remember; of N rows after the last one.
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
    """Equation (8), inverse kinematics with the base joints as they are now, and (1) solved for gL.

    target_mm : (..., 3), in {B0}; with the tool on the plate the place on the work, in {P}.
    target_rotation_B0_rad : (..., 3), hexapod only, rotation vector of the attitude wanted for {P} in {B0}; None
        for machine zero's attitude.
    values : the scales are not used and may be nan; effects see them where they shall be.
    A row's reason says why it failed (NOT_FINITE, UNREACHABLE, NO_CONVERGENCE, NEAR_SINGULAR, OTHER_ASSEMBLY).
    Raises KinematicsError for an attitude asked of a tripod.
    """
    attitude = _attitude(model, target_rotation_B0_rad, warm)
    wanted = model.arrangement.target_contact(model.frame, target_mm)
    frame = solve_frame(model.frame, model.zero.distances_mm + values.frame_mm, warm.supports_M_mm)
    nominal = inverse_kinematics(model.mechanism(model.zero.base_joints_M_mm), *wanted, attitude)
    needed = inverse_kinematics(model.mechanism(frame.base_joints_M_mm), *wanted, attitude)
    shortening_mm, joint_reason = joint_shortening(model.joint_weights, values.joint_mm)
    nominal_scale_mm = nominal.link_length_mm - model.zero.link_length_mm
    command = _command(model, nominal, nominal_scale_mm, needed, shortening_mm)
    reason = np.maximum(np.maximum(joint_reason, frame.reason), np.maximum(nominal.reason, needed.reason))
    after = WarmStart(frame.supports_M_mm, needed.origin_M_mm, needed.rotation_M_P, warm.effects)
    found = _Found(frame, needed, wanted, wanted, command, reason)
    if model.live_effects:
        plain = found
        for _ in range(_LOOKS):
            scale_mm = found.command.scale_setpoint_mm
            machine, remembered = apply_effects(
                model, _sight(values, scale_mm, frame, needed, wanted), warm.effects, True
            )
            found = _with_effects(model, plain, machine, attitude)
        after = after._replace(effects=remembered)
    return _result(model, found, warm, after)


def compensate_cmm(model: MachineModel, values: GaugeValues, warm: WarmStart) -> tuple[Compensation, WarmStart]:
    """Equations (1) and (3), forward kinematics with the base joints as they are now, and (9).

    The correction is that of the command which the scales show now: its target is where uncompensated kinematics
    takes the tip to be.
    A row's reason says why it failed (NOT_FINITE, UNREACHABLE, NO_CONVERGENCE, NEAR_SINGULAR, OTHER_ASSEMBLY).
    """
    zero_mm = model.zero.link_length_mm
    shortening_mm, joint_reason = joint_shortening(model.joint_weights, values.joint_mm)
    frame = solve_frame(model.frame, model.zero.distances_mm + values.frame_mm, warm.supports_M_mm)
    now = model.mechanism(frame.base_joints_M_mm)
    length_mm = link_length_mm(zero_mm, values.scale_mm, shortening_mm)
    pose = forward_kinematics(now, length_mm, warm.origin_M_mm, warm.rotation_M_P)
    nominal = forward_kinematics(
        model.mechanism(model.zero.base_joints_M_mm), zero_mm + values.scale_mm, warm.origin_M_mm, warm.rotation_M_P
    )
    wanted = model.arrangement.contact_at(nominal)
    needed = inverse_kinematics(now, *wanted, nominal.rotation_M_P)
    command = _command(model, nominal, values.scale_mm, needed, shortening_mm)
    reason = np.maximum(
        np.maximum(joint_reason, frame.reason), np.maximum(nominal.reason, np.maximum(pose.reason, needed.reason))
    )
    after = WarmStart(frame.supports_M_mm, pose.origin_M_mm, pose.rotation_M_P, warm.effects)
    found = _Found(frame, pose, model.arrangement.contact_at(pose), wanted, command, reason)
    if model.live_effects:
        machine, remembered = apply_effects(
            model, _sight(values, values.scale_mm, frame, pose, found.made), warm.effects, False
        )
        corrected = _with_effects(model, found, machine, nominal.rotation_M_P)
        each_mm = link_length_mm(zero_mm, values.scale_mm, machine.joint_shortening_mm) + machine.reading_to_length_mm
        there = forward_kinematics(
            final(machine.mechanism, now), final_array(each_mm, length_mm), warm.origin_M_mm, warm.rotation_M_P
        )
        tool_mm = wanted.tip_M_mm if isinstance(model.arrangement, ToolOnPlate) else wanted.tip_P_mm
        made = type(model.arrangement)(final_array(machine.tool_mm, tool_mm)).contact_at(there)
        found = corrected._replace(pose=there, made=made, reason=np.maximum(corrected.reason, there.reason))
        after = after._replace(effects=remembered)
    return _result(model, found, warm, after)


class _Command(NamedTuple):
    """What the scales are to show, without compensation and with it; (..., n) mm each."""

    nominal_scale_mm: FloatArray
    scale_setpoint_mm: FloatArray
    correction_mm: FloatArray
    sources: Sources


class _Found(NamedTuple):
    """What a cycle has found; `made` is where the tip is, `wanted` where the command would have it."""

    frame: Frame
    pose: Pose
    made: Contact
    wanted: Contact
    command: _Command
    reason: IntArray


def _command(
    model: MachineModel, nominal: Pose, nominal_scale_mm: FloatArray, needed: Pose, joint_shortening_mm: FloatArray
) -> _Command:
    """The joints' share is what they take from the links; the frame's is what its moving makes of the lengths."""
    setpoint_mm = scale_for_length_mm(model.zero.link_length_mm, needed.link_length_mm, joint_shortening_mm)
    sources = {"joints": joint_shortening_mm, "frame": needed.link_length_mm - nominal.link_length_mm}
    return _Command(nominal_scale_mm, setpoint_mm, setpoint_mm - nominal_scale_mm, sources)


def _sight(values: GaugeValues, scale_mm: FloatArray, frame: Frame, pose: Pose, at: Contact) -> EffectInputs:
    return EffectInputs(
        scale_mm, values.joint_mm, values.frame_mm, values.quantities, values.time_s, frame, pose, at.tip_M_mm
    )


def _with_effects(model: MachineModel, found: _Found, machine: PerturbedMachine, attitude: FloatArray) -> _Found:
    """The command that reaches the target on the machine that the effects make; an effect's share is what it adds to
    those before it."""
    before = found.command
    tool_on_plate = isinstance(model.arrangement, ToolOnPlate)
    contact = (
        Contact(machine.tool_mm, found.wanted.tip_P_mm)
        if tool_on_plate
        else Contact(found.wanted.tip_M_mm, machine.tool_mm)
    )
    each = inverse_kinematics(machine.mechanism, *contact, attitude)
    setpoints_mm = scale_for_length_mm(
        model.zero.link_length_mm, each.link_length_mm - machine.reading_to_length_mm, machine.joint_shortening_mm
    )
    shares_mm = setpoints_mm - np.concatenate([before.scale_setpoint_mm[None], setpoints_mm[:-1]])
    ids = [one.effect.id for one in model.live_effects]
    setpoint_mm = setpoints_mm[-1]
    command = _Command(
        before.nominal_scale_mm,
        setpoint_mm,
        setpoint_mm - before.nominal_scale_mm,
        {**before.sources, **dict(zip(ids, shares_mm, strict=True))},
    )
    reasons = np.maximum(machine.reason, each.reason)
    worst = reasons.max(axis=0) if reasons.ndim > found.reason.ndim else reasons
    return found._replace(
        frame=final(machine.frame, found.frame),
        pose=final(each, found.pose),
        command=command,
        reason=np.maximum(found.reason, worst),
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


def _result(model: MachineModel, found: _Found, warm: WarmStart, after: WarmStart) -> tuple[Compensation, WarmStart]:
    """Everything together; where a row failed, all its numbers nan and its warm start as it was."""
    frame, pose, made, wanted, command, reason = found
    result = Compensation(
        tip_M_mm=made.tip_M_mm,
        tip_B0_mm=to_inner(model.frame.zero_rotation_M_B, model.frame.zero_origin_M_mm, made.tip_M_mm),
        tip_P_mm=made.tip_P_mm,
        rotation_M_P=pose.rotation_M_P,
        frame=frame,
        link_length_mm=pose.link_length_mm,
        target_B_mm=to_inner(frame.rotation_M_B, frame.origin_M_mm, wanted.tip_M_mm),
        nominal_scale_mm=command.nominal_scale_mm,
        scale_setpoint_mm=command.scale_setpoint_mm,
        correction_mm=command.correction_mm,
        sources=command.sources,
        reason=reason,
    )
    if not reason.any():
        return result, after
    kept = WarmStart(
        _where(reason, warm.supports_M_mm, after.supports_M_mm, 2),
        _where(reason, warm.origin_M_mm, after.origin_M_mm, 1),
        _where(reason, warm.rotation_M_P, after.rotation_M_P, 2),
        after.effects,
    )
    return _blanked(result), kept


def _blanked(result: Compensation) -> Compensation:
    """nan for every number in the rows that failed; the frame has a reason of its own."""

    def blank(vector: FloatArray) -> FloatArray:
        return _where(result.reason, np.nan, vector, 1)

    return result._replace(
        tip_M_mm=blank(result.tip_M_mm),
        tip_B0_mm=blank(result.tip_B0_mm),
        tip_P_mm=blank(result.tip_P_mm),
        rotation_M_P=_where(result.reason, np.nan, result.rotation_M_P, 2),
        link_length_mm=blank(result.link_length_mm),
        target_B_mm=blank(result.target_B_mm),
        nominal_scale_mm=blank(result.nominal_scale_mm),
        scale_setpoint_mm=blank(result.scale_setpoint_mm),
        correction_mm=blank(result.correction_mm),
        sources={name: blank(share) for name, share in result.sources.items()},
    )


def _where(failed: IntArray, instead: FloatArray | float, values: FloatArray, core: int) -> FloatArray:
    """`instead` in the rows that failed; each row of `values` has `core` axes."""
    return np.where(np.reshape(failed, np.shape(failed) + (1,) * core) != 0, instead, values)
