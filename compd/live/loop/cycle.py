"""One cycle of the loop as a function: `step(state, inputs, settings)` gives the setpoint and the next state.

`step` reads no clock and does no I/O, and every value that goes in or comes out is immutable. The loop keeps the state
and calls it; a replay calls it with states and inputs from a recording, and gets the same setpoints bit for bit.

    machine zero -> comparators (stale policy) -> scales -> compensation -> limits -> shadow, bound -> setpoint
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.compensation import (
    Compensation,
    GaugeValues,
    WarmStart,
    command_pose,
    compensate_cmm,
    external_as_applied,
    first_start,
)
from compd.errors import StateError
from compd.live.loop.commands import Target
from compd.live.loop.cycle_readings import judge_scales, read_comparators, read_scales
from compd.live.loop.cycle_state import CycleInputs, CycleSettings, CycleState, ZeroVectors
from compd.live.loop.limits import (
    LimitedCorrection,
    limit_correction,
    limit_pose_correction,
    slewed,
    stroke_problem,
)
from compd.live.loop.models import adopt_models, at_target, compensate, evaluate_shadow
from compd.live.loop.refusal_cause import refusal_cause
from compd.live.loop.setpoint import Setpoint, ShadowResult
from compd.live.loop.skew import skew_between, skew_reason
from compd.live.loop.stale_policy import UsableComparators
from compd.live.loop.tip_bound import refused_bound, tip_bound, with_place
from compd.live.loop.tip_uncertainty import TipUncertainty, has_grown, noise_now, tip_uncertainty
from compd.live.machine import MachineWires, MachineZero, Models
from compd.live.memory import Snapshot
from compd.model import MachineModel
from compd.model.external import ExternalModel, OwnKinematicsError
from compd.model.kernels import Reason
from compd.setpoint_states import Mode, State

NO_SCALES = "there are no scales: what a TARGET commands is corrected, and there is none"
TARGET_TOO_OLD = (
    "the controller's target is too old (sockets.target.valid_for_s): it sends one again, or its role ends by "
    "`compd machine release`"
)


# In recordings of releases up to 0.2.0 the uncertainty has no radius, and stands alone.
_FORMER_NUMBERS = 3


class _Outcome(NamedTuple):
    """State and reason of a setpoint, with its values where they are valid.

    oldest_s : monotonic time of the oldest reading used. expires_s : from when the readings must not be used any more.
    skew_s : between the oldest and the newest length that was used; nan where that is not known.
    values, u_tip_um, shadow : as in `Setpoint`.
    """

    state: State
    reason: str
    values: Compensation | None = None
    oldest_s: float = math.nan
    expires_s: float = math.nan
    skew_s: float = math.nan
    u_tip_um: float = math.nan
    shadow: ShadowResult | None = None


def step(state: CycleState, inputs: CycleInputs, settings: CycleSettings) -> tuple[Setpoint, CycleState]:
    """Compute one setpoint.

    Parameters
    ----------
    state : what the cycle before returned; `CycleState.at_start` for the first.
    inputs : this cycle's number, snapshot and commands.
    settings : of the machine and its loop.

    Returns
    -------
    setpoint : an invalid one says why in its `reason`. It keeps `inputs` and the state from which it was computed.
    state : for the next cycle. An invalid setpoint keeps the correction that is applied, so that the next valid one
        slews from it.
    """
    models = inputs.models or settings.without_effects
    if models is not state.models:
        state = adopt_models(state, models)
    now_s = inputs.snapshot.time_s
    mode, target_until_s = Mode.CMM, math.inf
    if inputs.target is not None:
        mode, target_until_s = Mode.MACHINE_TOOL, inputs.target.valid_until_s
    if now_s > target_until_s:
        outcome, next_state = _Outcome(State.STOP, TARGET_TOO_OLD), state
    elif inputs.target is None and settings.commands_pose:
        outcome, next_state = _Outcome(State.REFUSED, NO_SCALES), state
    else:
        try:
            outcome, next_state = _compute(state, inputs, models, settings)
        except OwnKinematicsError as error:  # a person's own code must not end the loop
            outcome, next_state = _Outcome(State.REFUSED, str(error)), state
    if outcome.values is None and next_state.tip_correction_mm is not None:
        next_state = next_state._replace(tip_correction_mm=None)
    expires_s = min(now_s + settings.valid_for_s, outcome.expires_s, target_until_s)
    valid_until_s = now_s if outcome.values is None else expires_s
    age_s = now_s - outcome.oldest_s
    # positional: keywords cost twice the time
    setpoint = Setpoint(
        inputs.tick,
        now_s,
        valid_until_s,
        age_s,
        outcome.state,
        outcome.reason,
        mode,
        outcome.values,
        models.applied.hash,
        inputs,
        state,
        outcome.skew_s,
        outcome.u_tip_um,
        outcome.shadow,
        settings.wires.tool_on_plate,
    )
    return setpoint, next_state


def _compute(
    state: CycleState, inputs: CycleInputs, models: Models, settings: CycleSettings
) -> tuple[_Outcome, CycleState]:
    """The outcome of a cycle, and the next state; every step that fails returns what the steps before it have left."""
    tick, snapshot, zero, target, _, _ = inputs
    applied, wires = models.applied, settings.wires

    if not isinstance(zero, MachineZero) or not applied.needed_at_zero <= zero.quantities.keys():
        return _Outcome(State.NO_ZERO, _explanation(zero, models)), state
    zero_vectors = state.zero_vectors
    if zero is not state.zero or zero_vectors is None:
        zero_vectors = ZeroVectors(wires.scale.zero_vector(zero), wires.comparators.zero_vector(zero))
        state = _with_zero(state, zero, zero_vectors, settings)

    live, usable = read_comparators(state.last_good, inputs, zero_vectors.comparators_mm, applied, settings)
    comparators = usable.comparators
    if comparators is None:
        return _Outcome(usable.state, usable.reason), state

    scales = read_scales(snapshot, zero_vectors.scale_mm, target, settings)
    compares = target is not None and not settings.has_own_pose
    scales_state, scales_reason = judge_scales(scales.lost, compares, state.scales_seen)
    if not scales_state.valid:
        reason = "; ".join(filter(None, (scales_reason, usable.reason)))
        return _Outcome(scales_state, reason), state if live is None else state._replace(last_good=live)
    scale_mm, oldest_s = scales.values, min(comparators.oldest_s, scales.oldest_s)
    skew_s = skew_between(comparators.length_times_s, scales.oldest_s, scales.newest_s)
    if usable.state is State.OK and skew_s > settings.largest_skew_s:  # what is held instead, `hold_s` limits
        return _refused_skew(snapshot, skew_s, target, settings), state
    last_good = state.last_good if live is None else live

    change_mm, joints = comparators.change_mm, wires.joints
    values = GaugeValues(
        scale_mm, change_mm[:joints], change_mm[joints:], comparators.quantities, snapshot.time_s, zero.quantities
    )
    machine = applied.machine if usable.weight == 1.0 else applied.machine.with_effect_weight(usable.weight)
    started = first_start(machine, state.warm_start, values, None if target is None else target.tip_mm)
    compensation, warm_start, at_scale_mm = _compensated(machine, values, target, started, settings)
    scales_seen = state.scales_seen or target is None
    if code := int(compensation.reason):
        # a warm start that failed once may fail for ever: the next cycle is followed from machine zero
        warm_start = WarmStart.at_zero(settings.model)._replace(effects=warm_start.effects)
        state = state._replace(warm_start=warm_start, last_good=last_good, scales_seen=scales_seen)
        return _Outcome(State.REFUSED, _refusal(code, machine, values, target, started, wires)), state

    limited = _limited(compensation, state, settings)
    refusal = limited.reason if limited.state is State.REFUSED else ""
    if target is not None and (problem := stroke_problem(compensation.link_length_mm, settings.stroke_mm)):
        refusal = f"this target is out of reach: {problem}"
    if refusal:
        state = state._replace(warm_start=warm_start, last_good=last_good, scales_seen=scales_seen)
        return _Outcome(State.REFUSED, refusal), state

    u_tip = _uncertainty(tick, state, settings, snapshot) or _not_below_held(
        tip_uncertainty(
            at_target(machine, target),
            noise_now(settings.noise, wires, snapshot, usable.beyond),
            values,
            at_scale_mm,
            warm_start.effects,
        ),
        state.tip_noise_um,
        usable,
    )
    shadow, shadow_memory = None, state.shadow_memory
    if models.shadow is not None:
        shadow, shadow_memory = evaluate_shadow(
            models.shadow, values, target, snapshot, state.warm_start, shadow_memory, wires.tool_on_plate
        )

    adopting = state.adopting and limited.state is not State.OK
    tip_correction_mm = (
        None
        if target is not None or settings.corrects_pose
        else _tip_correction(compensation.correction_mm, limited, state, settings)
    )
    reached_mm = limited.applied_mm if tip_correction_mm is None else tip_correction_mm
    bound = tip_bound(u_tip, snapshot, usable, compensation, reached_mm, target, settings)
    next_state = CycleState(
        zero,
        warm_start,
        limited.applied_mm,
        last_good if live is None else with_place(live, compensation.nominal_scale_mm, settings),
        scales_seen,
        shadow_memory,
        adopting,
        u_tip.by_noise_um,
        tip_correction_mm,
        zero_vectors,
        models,
        u_tip.tip_by_gauge,
    )
    if refusal := refused_bound(bound, snapshot, usable, applied.quantities, settings):
        # what is not published changes no correction
        kept = next_state._replace(correction_mm=state.correction_mm, adopting=state.adopting)
        return _Outcome(State.REFUSED, "; ".join(filter(None, (refusal, usable.reason, limited.reason)))), kept
    compensation = _as_applied(compensation, machine, values, target, started, reached_mm, settings)
    if code := int(compensation.reason):
        return _Outcome(State.REFUSED, f"the clamped tip cannot be computed: {Reason(code).meaning}"), next_state
    reported, reason = _reported(usable, scales_state, scales_reason, limited)
    compensation = _with_applied(compensation, limited.applied_mm, settings)
    return (
        _Outcome(
            reported,
            reason,
            compensation,
            oldest_s,
            usable.expires_s,
            skew_s,
            math.nan if bound is None else bound.um,
            shadow,
        ),
        next_state,
    )


def _compensated(
    machine: MachineModel, values: GaugeValues, target: Target | None, started: WarmStart, settings: CycleSettings
) -> tuple[Compensation, WarmStart, FloatArray]:
    """The compensation, without scales that of the pose; the next warm start; and where the scales (m) are then."""
    compensation, warm_start = compensate(machine, values, target, started)
    at_scale_mm = compensation.scale_setpoint_mm
    if settings.commands_pose and int(compensation.reason) == 0:
        compensation = command_pose(machine, compensation)
    return compensation, warm_start, at_scale_mm


def _limited(compensation: Compensation, state: CycleState, settings: CycleSettings) -> LimitedCorrection:
    """What of the correction may be applied: of each scale's, or of the pose's where there are no scales."""
    if not settings.corrects_pose:
        return limit_correction(compensation.correction_mm, state.correction_mm, settings.period_s, settings.limits)
    wanted, previous = compensation.pose_correction, state.correction_mm
    assert wanted is not None, "without scales the pose is corrected"
    if len(previous) != len(wanted):  # before the first
        previous = np.zeros(len(wanted))
    return limit_pose_correction(wanted, previous, settings.period_s, settings.limits)


def _with_applied(compensation: Compensation, applied_mm: FloatArray, settings: CycleSettings) -> Compensation:
    """The compensation with the correction (n) that is applied, and the scale setpoint that belongs to it."""
    if settings.corrects_pose:
        return compensation._replace(pose_correction=applied_mm)
    setpoint_mm = compensation.nominal_scale_mm + applied_mm
    # in the order of the fields: `_replace` takes three times as long
    return Compensation._make((*compensation[:8], setpoint_mm, applied_mm, *compensation[10:]))


def _reported(
    usable: UsableComparators, scales_state: State, scales_reason: str, limited: LimitedCorrection
) -> tuple[State, str]:
    """State and reason of a valid setpoint: of what concerns it the worst state, and all reasons."""
    beyond = f"effects stay at the edge of their range: {usable.beyond.text}" if usable.beyond else ""
    reason = "; ".join(filter(None, (usable.reason, scales_reason, limited.reason, beyond)))
    if limited.state is usable.state is scales_state and not beyond:
        return scales_state, reason
    at_edge = State.CLAMPED if beyond else State.OK
    return max(limited.state, usable.state, scales_state, at_edge, key=lambda state: state.rank), reason


def _refused_skew(snapshot: Snapshot, skew_s: float, target: Target | None, settings: CycleSettings) -> _Outcome:
    wires = settings.wires.length_wires if target is None else settings.wires.comparators.wires
    return _Outcome(State.REFUSED, skew_reason(wires, snapshot, settings.largest_skew_s), skew_s=skew_s)


def _refusal(
    code: int,
    machine: MachineModel,
    values: GaugeValues,
    target: Target | None,
    warm_start: WarmStart,
    wires: MachineWires,
) -> str:
    """Why the compensation cannot be computed, with the gauge or effect to which it is due."""
    what = "this pose" if target is None else "this target"
    cause = refusal_cause(machine, values, target, warm_start, wires)
    return f"{what} cannot be computed: {Reason(code).meaning}" + (f"; {cause}" if cause else "")


def _explanation(zero: MachineZero | StateError, models: Models) -> str:
    """Why there is no machine zero from which the models' effects can count, and what to do."""
    if isinstance(zero, MachineZero):
        return models.applied.missing_at_zero(zero)
    problem = zero.problems[0]
    return f"{problem.what}; {problem.next_step}" if problem.next_step else problem.what


def _with_zero(state: CycleState, zero: MachineZero, zero_vectors: ZeroVectors, settings: CycleSettings) -> CycleState:
    """The state with this machine zero; of another one before it nothing is kept that was measured from it."""
    if zero is state.zero:
        return state._replace(zero_vectors=zero_vectors)
    warm_start = WarmStart.at_zero(settings.model)
    return state._replace(
        zero=zero, zero_vectors=zero_vectors, last_good=None, warm_start=warm_start, tip_correction_mm=None
    )


def _uncertainty(tick: int, state: CycleState, settings: CycleSettings, snapshot: Snapshot) -> TipUncertainty | None:
    """The tip's uncertainty of the cycle before, since it changes slowly; None where it is to be computed anew: now and
    then, more often while a length scatters, and at once where it begins to."""
    if settings.noise is None:
        return TipUncertainty(None, None)
    if state.tip_noise_um is None or tick % settings.uncertainty_every == 0:
        return None
    if state.tip_by_gauge is None and len(state.tip_noise_um) > _FORMER_NUMBERS:
        return None
    former = TipUncertainty(state.tip_noise_um, state.tip_by_gauge)
    scatters = bool((settings.wires.lengths.scatter_mm(snapshot) > settings.scatter_limits_mm).any())
    if scatters and (
        tick % settings.scattering_every == 0 or has_grown(former, settings.noise, settings.wires, snapshot)
    ):
        return None
    return former


def _not_below_held(u_tip: TipUncertainty, former_um: FloatArray | None, usable: UsableComparators) -> TipUncertainty:
    """Of comparators that are held nobody measures the scatter: what they had when they were read stays."""
    if usable.held_s is None or u_tip.by_noise_um is None or former_um is None:
        return u_tip
    return u_tip if u_tip.by_noise_um[-1] >= former_um[-1] else u_tip._replace(by_noise_um=former_um)


def _tip_correction(
    wanted_mm: FloatArray, limited: LimitedCorrection, state: CycleState, settings: CycleSettings
) -> FloatArray:
    """The correction (n) with which the tip is computed in CMM mode: `wanted_mm` itself, or as far as it may go.

    The tip jumps as little as the correction does: from one valid setpoint to the next its correction slews. After an
    invalid one there is nothing to jump from, and the tip is the right one at once. While the correction is clamped, or
    slews to a newly adopted model, the tip belongs to what is applied.
    """
    if limited.state is State.CLAMPED or (state.adopting and limited.state is State.SLEWING):
        return limited.applied_mm
    if state.tip_correction_mm is None:
        return wanted_mm
    return slewed(wanted_mm, state.tip_correction_mm, settings.period_s, settings.limits)


def _as_applied(
    compensation: Compensation,
    machine: MachineModel,
    values: GaugeValues,
    target: Target | None,
    warm_start: WarmStart,
    reached_mm: FloatArray,
    settings: CycleSettings,
) -> Compensation:
    """The compensation with the tip that belongs to the correction (n) with which it is reached, not to the one asked
    for: in CMM mode, and where a client gives the pose. `reason` says whether it could be computed."""
    if settings.corrects_pose or reached_mm is compensation.correction_mm:
        return compensation
    if isinstance(machine, ExternalModel):
        return external_as_applied(at_target(machine, target), compensation, values, warm_start, reached_mm)
    if target is not None:
        return compensation
    return _with_tip_as_applied(compensation, values.scale_mm, reached_mm, warm_start, settings)


def _with_tip_as_applied(
    compensation: Compensation,
    scale_mm: FloatArray,
    applied_mm: FloatArray,
    warm_start: WarmStart,
    settings: CycleSettings,
) -> Compensation:
    """The compensation with the tip that belongs to the correction which is applied, not to the one asked for.

    For CMM mode while the correction is limited. The tip follows from the scales less the correction by the kinematics
    without compensation, which is right to second order in the correction. `reason` says whether it could be computed.
    """
    wires = settings.wires
    without_comparators = GaugeValues(
        scale_mm - applied_mm, np.zeros(wires.joints), np.zeros(len(wires.comparators.wires) - wires.joints), {}
    )
    tip, _ = compensate_cmm(settings.model, without_comparators, warm_start)
    return compensation._replace(
        tip_M_mm=tip.tip_M_mm,
        tip_B0_mm=tip.tip_B0_mm,
        tip_P_mm=tip.tip_P_mm,
        link_length_mm=tip.link_length_mm,
        reason=tip.reason,
    )
