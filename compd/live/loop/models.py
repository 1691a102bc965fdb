"""The models within a cycle: other ones adopted, the applied one and the shadow evaluated."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from compd.compensation import Compensation, GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool
from compd.live.loop.commands import Target
from compd.live.loop.cycle_state import CycleState
from compd.live.loop.setpoint import ShadowResult
from compd.live.machine import LiveModel, Models
from compd.live.memory import Snapshot
from compd.model import EffectMemory, MachineModel, carry_over
from compd.model.external import ExternalModel, OwnKinematicsError, given_pose
from compd.model.kernels import Reason

ModelT = TypeVar("ModelT", bound=MachineModel)


def adopt_models(state: CycleState, models: Models) -> CycleState:
    """The state from which to compute with other models than in the cycle before.

    An effect that was in the old model with the same definition and the same constants keeps its memory. A model that
    ran as the shadow and is applied now keeps what its effects remember from there.
    """
    old = state.models
    if old is None:
        return state._replace(models=models)
    machine, memory, shadow_memory = old.applied.machine, state.warm_start.effects, state.shadow_memory
    if old.shadow is not None and models.applied is old.shadow:
        machine, memory = old.shadow.machine, shadow_memory
    elif models.shadow is not None and models.shadow is not old.shadow:
        shadow_memory = carry_over(memory, machine, models.shadow.machine)
    state = state._replace(models=models, shadow_memory=shadow_memory)
    if models.applied is old.applied:
        return state
    last_good = state.last_good
    if last_good is not None and not set(models.applied.quantities) <= set(last_good.quantities):
        # the new effects need gauges that the last good set does not have
        last_good = None
    effects = carry_over(memory, machine, models.applied.machine)
    return state._replace(
        warm_start=state.warm_start._replace(effects=effects), last_good=last_good, adopting=True, tip_noise_um=None
    )


def compensate(
    machine: MachineModel, values: GaugeValues, target: Target | None, warm_start: WarmStart
) -> tuple[Compensation, WarmStart]:
    """The compensation in CMM mode, or in machine-tool mode where there is a target, and the next warm start."""
    if target is None:
        return compensate_cmm(machine, values, warm_start)
    machine = at_target(machine, target)
    return compensate_machine_tool(machine, np.array(target.tip_mm), target.rotation_B0_rad, values, warm_start)


def at_target(machine: ModelT, target: Target | None) -> ModelT:
    """The machine; one whose pose a client gives, at the pose of its target.

    Raises OwnKinematicsError where the target lacks the derivatives that the machine needs.
    """
    if target is None or not isinstance(machine, ExternalModel):
        return machine
    return machine.with_pose(given_pose(target.tip_mm, target.rotation_B0_rad, target.tip_by_scale, machine.links))


def evaluate_shadow(
    shadow: LiveModel,
    values: GaugeValues,
    target: Target | None,
    snapshot: Snapshot,
    warm_start: WarmStart,
    memory: EffectMemory,
    tool_on_plate: bool,
) -> tuple[ShadowResult, EffectMemory]:
    """What the shadow model asks for in the same cycle, and what its effects then remember. It fails by itself only.

    values : of the applied model; the quantities are read anew, for the shadow's effects. warm_start : the one with
    which the applied model started.
    """
    quantities = shadow.read(snapshot)
    if quantities.lost:
        return ShadowResult(shadow.hash, str(quantities.lost)), memory
    if not shadow.needed_at_zero <= values.quantities_at_zero.keys():
        missing = ", ".join(sorted(shadow.needed_at_zero - values.quantities_at_zero.keys()))
        return ShadowResult(shadow.hash, f"machine zero has no {missing}"), memory
    values = values._replace(quantities=shadow.by_name(quantities))
    try:
        compensation, after = compensate(shadow.machine, values, target, warm_start._replace(effects=memory))
    except OwnKinematicsError as error:
        return ShadowResult(shadow.hash, str(error)), memory
    if code := int(compensation.reason):
        return ShadowResult(shadow.hash, Reason(code).meaning), after.effects
    tip_P_mm = compensation.tip_P_mm if tool_on_plate else None
    result = ShadowResult(shadow.hash, "", compensation.correction_mm, compensation.tip_M_mm, tip_P_mm)
    return result, after.effects
