"""One cycle of the loop as a function: `step(state, inputs, settings)` gives the setpoint and the next state.

`step` reads no clock and does no I/O, and every value that goes in or comes out is immutable. The loop keeps the state
and calls it; a replay calls it with states and inputs from a recording, and gets the same setpoints bit for bit.

    machine zero -> comparators (stale policy) -> scales -> compensation -> limits -> uncertainty, shadow -> setpoint
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.compensation import Compensation, GaugeValues, WarmStart, compensate_cmm
from compd.errors import StateError
from compd.live.loop.cycle_state import CycleInputs, CycleSettings, CycleState, ZeroVectors
from compd.live.loop.limits import limit_correction, stroke_problem
from compd.live.loop.machine_zero import MachineZero
from compd.live.loop.model_loader import LiveModel, Models
from compd.live.loop.models import adopt_models, compensate, evaluate_shadow
from compd.live.loop.setpoint import Setpoint, SetpointValues, ShadowResult
from compd.live.loop.stale_policy import ComparatorSet, UsableComparators, held_comparators, usable_comparators
from compd.live.loop.states import Mode, State
from compd.live.loop.tip_uncertainty import uncertainty_um
from compd.live.loop.wiring import MachineWires
from compd.live.memory.latest import Snapshot
from compd.model.solve_status import MEANING, Reason

TARGET_TOO_OLD = (
    "the controller's target is too old (sockets.target.valid_for_s): it sends one again, or its role ends by "
    "`compd release`"
)


class _Outcome(NamedTuple):
    """State and reason of a setpoint, with its values where they are valid.

    oldest_s : monotonic time of the oldest reading used. expires_s : from when the readings must not be used any more.
    """

    state: State
    reason: str
    values: SetpointValues | None = None
    oldest_s: float = math.nan
    expires_s: float = math.nan


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
    else:
        outcome, next_state = _compute(state, inputs, models, settings)
    expires_s = min(now_s + settings.valid_for_s, outcome.expires_s, target_until_s)
    valid_until_s = now_s if outcome.values is None else expires_s
    age_s = now_s - outcome.oldest_s
    # positional, as in `_setpoint_values`: keywords cost twice the time
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
    )
    return setpoint, next_state


def _compute(
    state: CycleState, inputs: CycleInputs, models: Models, settings: CycleSettings
) -> tuple[_Outcome, CycleState]:
    """The outcome of a cycle, and the next state; every step that fails returns what the steps before it have left."""
    tick, snapshot, zero, target, _, _ = inputs
    applied, wires = models.applied, settings.wires

    if not isinstance(zero, MachineZero):
        return _Outcome(State.NO_ZERO, _explanation(zero)), state
    zero_vectors = state.zero_vectors
    if zero is not state.zero or zero_vectors is None:
        zero_vectors = ZeroVectors(wires.scale.zero_vector(zero), wires.comparators.zero_vector(zero))
        state = _with_zero(state, zero, zero_vectors, settings)

    live, usable = _comparators(state.last_good, inputs, zero_vectors.comparators_mm, applied, settings)
    comparators = usable.comparators
    if comparators is None:
        return _Outcome(usable.state, usable.reason), state
    last_good = state.last_good if live is None else live

    scale_mm, oldest_s = settings.unread_scales_mm, comparators.oldest_s
    if target is None:
        scales = wires.scale.read(snapshot, zero_vectors.scale_mm)
        if scales.lost:
            # no policy replaces a scale: without it the tip is not known
            lost_state = State.STOP if state.scales_seen else State.STARTING
            return _Outcome(lost_state, f"the tip is not known: {scales.lost}"), state._replace(last_good=last_good)
        scale_mm, oldest_s = scales.values, min(oldest_s, scales.oldest_s)

    change_mm, joints = comparators.change_mm, wires.joints
    values = GaugeValues(scale_mm, change_mm[:joints], change_mm[joints:], comparators.quantities, snapshot.time_s)
    machine = applied.machine if usable.weight == 1.0 else applied.machine.with_effect_weight(usable.weight)
    compensation, warm_start = compensate(machine, values, target, state.warm_start)
    scales_seen = state.scales_seen or target is None
    if code := int(compensation.reason):
        # a warm start that failed once may fail for ever: the next cycle starts from machine zero
        warm_start = WarmStart.at_zero(settings.model)._replace(effects=warm_start.effects)
        state = state._replace(warm_start=warm_start, last_good=last_good, scales_seen=scales_seen)
        what = "this pose" if target is None else "this target"
        return _Outcome(State.REFUSED, f"{what} cannot be computed: {MEANING[Reason(code)]}"), state

    correction_mm = compensation.correction_mm
    limited = limit_correction(correction_mm, state.correction_mm, settings.period_s, settings.limits)
    refusal = limited.reason if limited.state is State.REFUSED else ""
    if target is not None and (problem := stroke_problem(compensation.link_length_mm, settings.stroke_mm)):
        refusal = f"this target is out of reach: {problem}"
    if refusal:
        state = state._replace(warm_start=warm_start, last_good=last_good, scales_seen=scales_seen)
        return _Outcome(State.REFUSED, refusal), state
    correction_mm = limited.applied_mm

    u_tip_um, scale_setpoint_mm = state.u_tip_um, compensation.scale_setpoint_mm
    if settings.noise is not None and (u_tip_um is None or tick % settings.uncertainty_every == 0):
        u_tip_um = uncertainty_um(machine, settings.noise, values, scale_setpoint_mm, warm_start.effects)
    shadow, shadow_memory = None, state.shadow_memory
    if models.shadow is not None:
        shadow, shadow_memory = evaluate_shadow(
            models.shadow, values, target, snapshot, state.warm_start, shadow_memory, wires.tool_on_plate
        )

    adopting = state.adopting and limited.state is not State.OK
    next_state = CycleState(
        zero, warm_start, correction_mm, last_good, scales_seen, shadow_memory, adopting, u_tip_um, zero_vectors, models
    )
    if target is None and (limited.state is State.CLAMPED or (adopting and limited.state is State.SLEWING)):
        compensation = _with_tip_as_applied(compensation, scale_mm, correction_mm, warm_start, settings)
        if code := int(compensation.reason):
            return _Outcome(State.REFUSED, f"the clamped tip cannot be computed: {MEANING[Reason(code)]}"), next_state
    reported = limited.state if limited.state.rank >= usable.state.rank else usable.state
    reason = "; ".join(filter(None, (usable.reason, limited.reason)))
    setpoint_values = _setpoint_values(compensation, correction_mm, u_tip_um, shadow, wires.tool_on_plate)
    return _Outcome(reported, reason, setpoint_values, oldest_s, usable.expires_s), next_state


def _explanation(error: StateError) -> str:
    """Why there is no machine zero, and what to do."""
    problem = error.problems[0]
    return f"{problem.what}; {problem.next_step}" if problem.next_step else problem.what


def _with_zero(state: CycleState, zero: MachineZero, zero_vectors: ZeroVectors, settings: CycleSettings) -> CycleState:
    """The state with this machine zero; of another one before it nothing is kept that was measured from it."""
    if zero is state.zero:
        return state._replace(zero_vectors=zero_vectors)
    warm_start = WarmStart.at_zero(settings.model)
    return state._replace(zero=zero, zero_vectors=zero_vectors, last_good=None, warm_start=warm_start)


def _comparators(
    last_good: ComparatorSet | None,
    inputs: CycleInputs,
    zero_mm: FloatArray,
    applied: LiveModel,
    settings: CycleSettings,
) -> tuple[ComparatorSet | None, UsableComparators]:
    """The live set of this cycle, and the comparators with which to compute."""
    snapshot = inputs.snapshot
    if inputs.ending:
        return None, held_comparators(last_good, inputs.ending, snapshot.time_s, settings.loop)
    live, lost = _live_comparators(snapshot, zero_mm, applied, settings.wires)
    return live, usable_comparators(live, last_good, lost, snapshot.time_s, settings.loop)


def _live_comparators(
    snapshot: Snapshot, zero_mm: FloatArray, applied: LiveModel, wires: MachineWires
) -> tuple[ComparatorSet | None, str]:
    """Joint and frame comparators with the quantities that the effects need, as a set.

    None where one of them cannot be used; the text then says which, and why.
    """
    lengths = wires.comparators.read(snapshot, zero_mm)
    lost, oldest_s = lengths.lost, lengths.oldest_s
    quantities: Mapping[str, FloatArray] = {}
    if applied.quantities:
        needed = applied.read(snapshot)
        lost = ", ".join(filter(None, (lost, needed.lost)))
        oldest_s = min(oldest_s, needed.oldest_s)
        quantities = applied.by_name(needed)
    if lost:
        return None, lost
    return ComparatorSet(lengths.values, snapshot.time_s, oldest_s, quantities), ""


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


def _setpoint_values(
    compensation: Compensation,
    applied_mm: FloatArray,
    u_tip_um: FloatArray | None,
    shadow: ShadowResult | None,
    tool_on_plate: bool,
) -> SetpointValues:
    frame = compensation.frame
    return SetpointValues(
        compensation.tip_M_mm,
        compensation.tip_B0_mm,
        compensation.tip_P_mm if tool_on_plate else None,
        frame.origin_M_mm,
        frame.displacement_M_mm,
        frame.rotation_M_rad,
        compensation.link_length_mm,
        compensation.nominal_scale_mm + applied_mm,
        applied_mm,
        compensation.sources,
        u_tip_um,
        shadow,
    )
