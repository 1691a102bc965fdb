"""One cycle: from a snapshot to a setpoint. No clock, no I/O: a recorded run replays bit for bit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.compensation import Compensation, GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool
from compd.configuration.operation import LimitSettings, LoopSettings
from compd.errors import StateError
from compd.live.loop.commands import Commands, Target
from compd.live.loop.cycle_state import CycleInputs, CycleState
from compd.live.loop.limits import beyond_stroke, limited
from compd.live.loop.machine_zero import MachineZero
from compd.live.loop.model_loader import LiveModel, Models
from compd.live.loop.setpoint import Mode, Setpoint, SetpointValues, ShadowResult, State
from compd.live.loop.stale_policy import ComparatorSet, UsableComparators, usable
from compd.live.loop.tip_uncertainty import uncertainty_um
from compd.live.loop.wiring import MachineWires, WiredValues
from compd.model.apply_effects import EffectMemory, carry_over
from compd.model.machine import MachineModel
from compd.model.solve_status import MEANING, Reason
from compd.model.uncertainty import GaugeNoise
from compd.readings import Snapshot

# An uncertainty changes as the machine warms up or crosses its workspace: in seconds.
UNCERTAINTY_EVERY_S = 1.0


class _ZeroVectors(NamedTuple):
    """Raw readings at machine zero, in the wiring's order."""

    scale_mm: FloatArray
    comparators_mm: FloatArray


class _Invalid(Exception):
    """No setpoint can be had this time; the state and the reason that clients are told."""

    def __init__(self, state: State, reason: str) -> None:
        super().__init__(reason)
        self.state = state
        self.reason = reason


class Cycle:
    """Computes setpoints one after another; keeps what one cycle hands to the next. Only the loop's thread runs it.

    What it keeps: the warm start with what effects remember, the last good set of comparators, and the correction
    that stands. An invalid setpoint leaves the correction standing, so that the next valid one slews from it.
    """

    def __init__(
        self,
        model: MachineModel,
        wires: MachineWires,
        loop: LoopSettings,
        limits: LimitSettings,
        valid_for_s: float,
        stroke_mm: tuple[float, float] | None = None,
        noise: GaugeNoise | None = None,
    ) -> None:
        """`model`: without effects, which come by orders; `stroke_mm`: shortest and longest link, `noise`: of the
        gauges; None where the configuration does not say.
        """
        self._model = model
        self._bare = Models(LiveModel(model, "", "", (), wires.quantity_wires(())))
        self._models: Models | None = None
        self._noise = noise
        self._uncertainty_every = max(1, round(UNCERTAINTY_EVERY_S * loop.rate_hz))
        self._wires = wires
        self._loop = loop
        self._limits = limits
        self._valid_for_s = valid_for_s
        self._stroke_mm = stroke_mm
        self._period_s = 1.0 / loop.rate_hz
        self._no_scales = np.full(model.links, math.nan)
        self._no_comparators = GaugeValues(
            self._no_scales, np.zeros(wires.joints), np.zeros(len(wires.comparators.wires) - wires.joints), {}
        )
        self._warm = WarmStart.at_zero(model)
        self._correction_mm: FloatArray = np.zeros(model.links)
        self._zero: MachineZero | None = None
        self._zero_vectors: _ZeroVectors | None = None
        self._last_good: ComparatorSet | None = None
        self._scales_seen = False
        self._shadow = EffectMemory()
        self._adopting = False
        self._u_tip_um: FloatArray | None = None

    def run(self, tick: int, snapshot: Snapshot, orders: Commands) -> Setpoint:
        """The setpoint of one tick; an invalid one says why."""
        # the orders are read once: their writers do not wait for the cycle
        models = orders.models or self._bare
        if models is not self._models:
            self._adopt(models)
        inputs = CycleInputs(snapshot, orders.zero, orders.target, self._carried(), models)
        mode = Mode.CMM if inputs.target is None else Mode.MACHINE_TOOL
        try:
            return self._compute(tick, inputs, mode)
        except _Invalid as why:
            now_s = snapshot.time_s
            return Setpoint(
                tick, now_s, now_s, math.nan, why.state, why.reason, mode, None, inputs, models.applied.hash
            )

    def resume(self, carried: CycleState, models: Models | None = None) -> None:
        """Go on as if the cycle before, with the same models, had left this behind; None is without effects."""
        self._models = models or self._bare
        (
            self._zero,
            self._warm,
            self._correction_mm,
            self._last_good,
            self._scales_seen,
            self._shadow,
            self._adopting,
            self._u_tip_um,
        ) = carried
        self._zero_vectors = None if carried.zero is None else self._vectors(carried.zero)

    def _carried(self) -> CycleState:
        return CycleState(
            self._zero,
            self._warm,
            self._correction_mm,
            self._last_good,
            self._scales_seen,
            self._shadow,
            self._adopting,
            self._u_tip_um,
        )

    def _adopt(self, models: Models) -> None:
        """Other models from this tick on; effects of the same definition keep what they remember."""
        old, new = self._models or self._bare, models
        was, effects = old.applied.machine, self._warm.effects
        if old.shadow is not None and new.applied is old.shadow:
            was, effects = old.shadow.machine, self._shadow
        elif new.shadow is not None and new.shadow is not old.shadow:
            self._shadow = carry_over(effects, was, new.shadow.machine)
        if new.applied is not old.applied:
            self._warm = self._warm._replace(effects=carry_over(effects, was, new.applied.machine))
            self._adopting = self._models is not None
            self._u_tip_um = None
            if self._last_good is not None and not set(new.applied.quantities) <= set(self._last_good.quantities):
                self._last_good = None
        self._models = models

    def _compute(self, tick: int, inputs: CycleInputs, mode: Mode) -> Setpoint:
        snapshot, zero, target, _, models = inputs
        assert models is not None
        vectors = self._adopted(zero)
        set_ = self._comparators(snapshot, vectors, models.applied)
        assert set_.comparators is not None
        oldest_s = set_.comparators.oldest_s
        scale_mm = self._no_scales
        if target is None:
            scales = self._scales(snapshot, vectors)
            scale_mm, oldest_s = scales.change_mm, min(oldest_s, scales.oldest_s)
        change_mm, joints = set_.comparators.change_mm, self._wires.joints
        values = GaugeValues(
            scale_mm, change_mm[:joints], change_mm[joints:], set_.comparators.quantities, snapshot.time_s
        )
        before, machine = self._warm, _counting(models.applied, set_.weight)
        found = self._compensation(machine, values, target)
        if target is not None and (beyond := beyond_stroke(found.link_length_mm, self._stroke_mm)):
            raise _Invalid(State.REFUSED, f"this target is out of reach: {beyond}")
        allowed = limited(found.correction_mm, self._correction_mm, self._period_s, self._limits)
        if allowed.state is State.REFUSED:
            raise _Invalid(State.REFUSED, allowed.reason)
        self._correction_mm = allowed.applied_mm
        state, reason = _worse(set_, allowed.state, allowed.reason)
        self._note_uncertainty(tick, machine, values, found)
        shadow = None if models.shadow is None else self._beside(models.shadow, values, target, snapshot, before)
        if target is None and (allowed.state is State.CLAMPED or (self._adopting and allowed.state is State.SLEWING)):
            found = self._held_back(found, scale_mm, allowed.applied_mm)
        self._adopting = self._adopting and allowed.state is not State.OK
        now_s = snapshot.time_s
        valid_until_s = min(now_s + self._valid_for_s, set_.expires_s)
        numbers = self._numbers(found, allowed.applied_mm, shadow)
        return Setpoint(
            tick, now_s, valid_until_s, now_s - oldest_s, state, reason, mode, numbers, inputs, models.applied.hash
        )

    def _adopted(self, zero: MachineZero | StateError) -> _ZeroVectors:
        """The zero of this tick; with a new one nothing that was measured from the old one is kept."""
        if not isinstance(zero, MachineZero):
            problem = zero.problems[0]
            raise _Invalid(State.NO_ZERO, f"{problem.what}; {problem.next_step}" if problem.next_step else problem.what)
        if zero is not self._zero or self._zero_vectors is None:
            self._zero = zero
            self._zero_vectors = self._vectors(zero)
            self._last_good = None
            self._warm = WarmStart.at_zero(self._model)
        return self._zero_vectors

    def _vectors(self, zero: MachineZero) -> _ZeroVectors:
        return _ZeroVectors(self._wires.scale.zero_vector(zero), self._wires.comparators.zero_vector(zero))

    def _comparators(self, snapshot: Snapshot, zero: _ZeroVectors, applied: LiveModel) -> UsableComparators:
        """Joint and frame comparators, and what the effects need, as a set: the live one, or what `on_stale` makes
        of the last."""
        read = self._wires.comparators.read(snapshot, zero.comparators_mm)
        lost, oldest_s = read.lost, read.oldest_s
        quantities: Mapping[str, FloatArray] = {}
        if applied.quantities:
            needed = applied.read(snapshot)
            lost = ", ".join(filter(None, (lost, needed.lost)))
            oldest_s = min(oldest_s, needed.oldest_s)
            quantities = applied.named(needed)
        live = None if lost else ComparatorSet(read.change_mm, snapshot.time_s, oldest_s, quantities)
        set_ = usable(live, self._last_good, lost, snapshot.time_s, self._loop)
        if live is not None:
            self._last_good = live
        if set_.comparators is None:
            raise _Invalid(set_.state, set_.reason)
        return set_

    def _scales(self, snapshot: Snapshot, zero: _ZeroVectors) -> WiredValues:
        """Live or not at all: without its scales nobody knows where the tip is."""
        scales = self._wires.scale.read(snapshot, zero.scale_mm)
        if scales.lost:
            raise _Invalid(State.STOP if self._scales_seen else State.STARTING, f"the tip is not known: {scales.lost}")
        self._scales_seen = True
        return scales

    def _compensation(self, machine: MachineModel, values: GaugeValues, target: Target | None) -> Compensation:
        found, warm = _compensated(machine, values, target, self._warm)
        code = int(found.reason)
        if code:
            # the next cycle starts from machine zero: a start that failed once may fail for ever
            self._warm = WarmStart.at_zero(self._model)._replace(effects=warm.effects)
            what = "this pose" if target is None else "this target"
            raise _Invalid(State.REFUSED, f"{what} cannot be computed: {MEANING[Reason(code)]}")
        self._warm = warm
        return found

    def _beside(
        self, shadow: LiveModel, values: GaugeValues, target: Target | None, snapshot: Snapshot, before: WarmStart
    ) -> ShadowResult:
        """What the shadow makes of the same cycle; whatever fails in it changes nothing else."""
        needed = shadow.read(snapshot)
        if needed.lost:
            return ShadowResult(shadow.hash, needed.lost)
        start = before._replace(effects=self._shadow)
        found, after = _compensated(shadow.machine, values._replace(quantities=shadow.named(needed)), target, start)
        self._shadow = after.effects
        if int(found.reason):
            return ShadowResult(shadow.hash, MEANING[Reason(int(found.reason))])
        tip_P_mm = found.tip_P_mm if self._wires.tool_on_plate else None
        return ShadowResult(shadow.hash, "", found.correction_mm, found.tip_M_mm, tip_P_mm)

    def _note_uncertainty(self, tick: int, machine: MachineModel, values: GaugeValues, found: Compensation) -> None:
        """Once a second, of the pose that the cycle has found; where the gauges' noise is declared."""
        if self._noise is None or (self._u_tip_um is not None and tick % self._uncertainty_every):
            return
        self._u_tip_um = uncertainty_um(machine, self._noise, values, found.scale_setpoint_mm, self._warm.effects)

    def _held_back(self, found: Compensation, scale_mm: FloatArray, applied_mm: FloatArray) -> Compensation:
        """CMM mode at the limit: the tip moves with what is applied, not with what the comparators ask for.

        The scales less the correction, by uncompensated kinematics: the tip to second order in the correction.
        """
        believed = self._no_comparators._replace(scale_mm=scale_mm - applied_mm)
        tip, _ = compensate_cmm(self._model, believed, self._warm)
        if int(tip.reason):
            raise _Invalid(State.REFUSED, f"the clamped tip cannot be computed: {MEANING[Reason(int(tip.reason))]}")
        return found._replace(
            tip_M_mm=tip.tip_M_mm, tip_B0_mm=tip.tip_B0_mm, tip_P_mm=tip.tip_P_mm, link_length_mm=tip.link_length_mm
        )

    def _numbers(self, found: Compensation, applied_mm: FloatArray, shadow: ShadowResult | None) -> SetpointValues:
        frame = found.frame
        return SetpointValues(
            found.tip_M_mm,
            found.tip_B0_mm,
            found.tip_P_mm if self._wires.tool_on_plate else None,
            frame.origin_M_mm,
            frame.displacement_M_mm,
            frame.rotation_M_rad,
            found.link_length_mm,
            found.nominal_scale_mm + applied_mm,
            applied_mm,
            found.sources,
            self._u_tip_um,
            shadow,
        )


def _counting(applied: LiveModel, weight: float) -> MachineModel:
    """Its effects fade with the set that they belong to."""
    return applied.machine if weight == 1.0 else applied.machine.with_effect_weight(weight)


def _compensated(
    machine: MachineModel, values: GaugeValues, target: Target | None, warm: WarmStart
) -> tuple[Compensation, WarmStart]:
    if target is None:
        return compensate_cmm(machine, values, warm)
    return compensate_machine_tool(machine, np.array(target.tip_mm), target.rotation_B0_rad, values, warm)


def _worse(set_: UsableComparators, state: State, reason: str) -> tuple[State, str]:
    """One state for the stale policy and the limits: a clamp is told first, then hold or fade, then slewing."""
    if set_.state is State.OK:
        return state, reason
    told = state if state is State.CLAMPED else set_.state
    return told, f"{set_.reason}; {reason}" if reason else set_.reason
