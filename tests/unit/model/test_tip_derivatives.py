"""The derivatives of one snapshot's tip, against those of N rows in NumPy, and against effects in plain Python."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.compensation import GaugeValues, WarmStart, compensate_cmm
from compd.model.effect_memory import EffectMemory
from compd.model.effects.effect import Effect, FittedEffect
from compd.model.effects.effect_basis import evaluate_basis
from compd.model.effects.observations import Observations
from compd.model.kinematics.motion import Movement
from compd.model.library import load_library
from compd.model.machine import MachineModel
from compd.model.observer import observe
from compd.model.sensitivity import sensitivities
from compd.model.tip_derivative import TipDerivatives, tip_derivatives
from compd.model.uncertainty import GAUGE_PORTS
from tests.support.effect_derivatives import effect_sensitivity
from tests.support.live_machine import machine

LIVE = [effect for effect in load_library().values() if effect.live]
SIGMA = 0.05


def with_effects(name: str, effects: list[Effect]) -> MachineModel:
    """A shipped machine with these effects, their numbers drawn."""
    model, rng = machine(name).model, np.random.default_rng(1)
    fitted = tuple(
        FittedEffect(
            effect,
            rng.normal(0, 0.01, len(effect.columns(model.links))),
            {constant.name: constant.grid[0] for constant in effect.constants},
        )
        for effect in effects
    )
    return replace(model, effects=fitted)


def after_moving(model: MachineModel) -> tuple[GaugeValues, EffectMemory]:
    """A snapshot away from machine zero, and what the effects remember after it."""
    rng, joints = np.random.default_rng(2), model.joint_weights.shape[1]
    quantities = {name: np.array(rng.normal(21, 1)) for name in model.program.quantities}
    scale_mm, joint_mm, frame_mm = rng.normal(0, 1, model.links), rng.normal(0, 0.01, joints), rng.normal(0, 0.01, 9)
    warm = WarmStart.at_zero(model)
    for step in range(3):
        at_zero = dict.fromkeys(quantities, 22.0)
        values = GaugeValues(scale_mm + 0.01 * step, joint_mm, frame_mm, quantities, 5.0 + 0.01 * step, at_zero)
        _, warm = compensate_cmm(model, values, warm)
    return values, warm.effects


def derivatives(model: MachineModel, values: GaugeValues, effects: EffectMemory) -> TipDerivatives:
    scale_mm, joint_mm, frame_mm, quantities, time_s, at_zero = values
    return tip_derivatives(
        model,
        scale_mm=scale_mm,
        joint_mm=joint_mm,
        frame_mm=frame_mm,
        quantities=quantities,
        quantities_at_zero=at_zero,
        sigmas=dict.fromkeys(quantities, SIGMA),
        time_s=float(time_s),
        effects=effects,
    )


def as_row(model: MachineModel, values: GaugeValues, effects: EffectMemory) -> Observations:
    scale_mm, joint_mm = values.scale_mm[None], values.joint_mm[None]
    motion = effects.motion
    return observe(
        model,
        model.constants,
        scale_mm=scale_mm,
        joint_mm=joint_mm,
        frame_mm=values.frame_mm[None],
        quantities={name: value[None] for name, value in values.quantities.items()},
        time_s=np.array([values.time_s]),
        session_start=np.array([False]),
        movement=Movement.unknown(scale_mm, joint_mm) if motion is None else Movement.from_motions([motion]),
        quantities_at_zero=values.quantities_at_zero,
    )


@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_the_kernel_gives_what_numpy_gives_for_every_port_and_effect(name: str) -> None:
    model = with_effects(name, LIVE)
    values, effects = after_moving(model)
    row, found = as_row(model, values, effects), derivatives(model, values, effects)
    by_port = sensitivities(model, row, {*GAUGE_PORTS, *(port for effect in LIVE for port in effect.ports)})
    by_gauge = np.concatenate([by_port[port].tip[0] for port in GAUGE_PORTS], axis=1)
    np.testing.assert_allclose(found.by_gauge, by_gauge, rtol=1e-7, atol=1e-8)
    by_theta: list[FloatArray] = []
    by_quantity = np.zeros((3, len(values.quantities)))
    for fitted in model.effects:
        memory = effects.memories[fitted.effect.id]
        basis, _ = evaluate_basis(fitted.effect, row, fitted.constants, memory)
        by_theta.append(effect_sensitivity(fitted.effect, row, basis, by_port).tip[0])
        for index, quantity in enumerate(model.program.quantities):
            raised = replace(row, quantities={**row.quantities, quantity: row.quantities[quantity] + SIGMA})
            moved, _ = evaluate_basis(fitted.effect, raised, fitted.constants, memory)
            by_quantity[:, index] += (
                effect_sensitivity(fitted.effect, row, moved - basis, by_port).tip[0] @ fitted.theta
            )
    np.testing.assert_allclose(found.by_theta, np.concatenate(by_theta, axis=1), rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(found.by_quantity, by_quantity, rtol=1e-5, atol=1e-11)
    assert np.abs(by_quantity).max() > 1e-8


def in_python(effect: Effect) -> Effect:
    """The same effect, as somebody writes it without a kernel."""
    return replace(effect, basis=lambda rows, constants, memory: evaluate_basis(effect, rows, constants, memory))


def test_effects_in_plain_python_count_as_those_with_a_kernel() -> None:
    chosen = [load_library()[id_] for id_ in ("link_expansion", "scale_gain", "tool_offset")]
    compiled = with_effects("tripod-cmm.yaml", chosen)
    mixed = with_effects("tripod-cmm.yaml", [in_python(chosen[0]), chosen[1], in_python(chosen[2])])
    assert mixed.program.given == (0, 2)
    values, effects = after_moving(compiled)
    for wanted, given in zip(
        derivatives(compiled, values, effects), derivatives(mixed, values, EffectMemory()), strict=True
    ):
        np.testing.assert_allclose(given, wanted, rtol=1e-9, atol=1e-12)


def test_a_snapshot_without_a_pose_has_no_derivatives() -> None:
    model = with_effects("tripod-cmm.yaml", [])
    values, effects = after_moving(model)
    lost = derivatives(model, values._replace(frame_mm=np.full(9, np.nan)), effects)
    assert np.isnan(lost.by_gauge).all()
