"""Effects in both modes: the tip as the recordings' model predicts it, the share of each, memory, row by row."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from compd.compensation.compensation import compensate_cmm, compensate_machine_tool
from compd.compensation.values import GaugeValues, WarmStart
from compd.model import MachineModel, deltas_by_effect, machine_constants, observe, predict, sum_deltas
from compd.model.effects import Effect, FittedEffect, Observations
from compd.model.kernels import Reason
from compd.model.kinematics import Movement, ToolOnPlate, update_motion
from tests.support.effect_rows import DETAILS, HEXAPOD, LIBRARY, TRIPOD, constants_of, random_inputs

ON_PLATE = replace(TRIPOD, arrangement=ToolOnPlate(TRIPOD.zero.contact.tip_M_mm))
LIVE = [effect for effect in LIBRARY.values() if effect.live]
ROWS = 24


def fitted(effect: Effect, model: MachineModel) -> FittedEffect:
    """With plausible numbers, so that every effect moves the tip; a scale's cyclic error is 1 % of its period."""
    share = 0.1 if effect.id == "scale_cyclic" else 0.3
    theta = [share * column.parameter.theta_range[1] for column in effect.columns(model.links)]
    return FittedEffect(effect, np.array(theta), constants_of(effect))


def carrying(model: MachineModel, *effects: Effect) -> MachineModel:
    return replace(
        model, effects=tuple(fitted(effect, model) for effect in effects), constants=machine_constants(model, DETAILS)
    )


def possible(model: MachineModel) -> list[Effect]:
    return [effect for effect in LIVE if "revolute_axes" not in effect.needs or len(model.revolute_axes_P)]


def values_of(arguments: dict[str, Any]) -> GaugeValues:
    return GaugeValues(**{name: arguments[name] for name in GaugeValues._fields})


def row(values: GaugeValues, i: int) -> GaugeValues:
    """One snapshot."""
    return GaugeValues(
        values.scale_mm[i],
        values.joint_mm[i],
        values.frame_mm[i],
        {name: value[i] for name, value in values.quantities.items()},
        np.asarray(values.time_s)[i],
        values.quantities_at_zero,
    )


def seen_as_recording(model: MachineModel, values: GaugeValues) -> Observations:
    """The same readings as rows of one session, each link moving as it does from one to the next."""
    motion, motions = None, []
    for i in range(ROWS):
        one = row(values, i)
        motion = update_motion(motion, float(one.time_s), one.scale_mm, one.joint_mm)
        motions.append(motion)
    movement = Movement(
        *(
            np.array([getattr(one, name) for one in motions])
            for name in ("direction", "velocity_mm_per_s", "joint_velocity_mm_per_s")
        )
    )
    return observe(
        model,
        machine_constants(model, DETAILS),
        **values._asdict(),
        session_start=np.arange(ROWS) == 0,
        movement=movement,
    )


CASES = [
    pytest.param(model, effect, id=f"{effect.id} on {name}")
    for name, model in (("tripod", TRIPOD), ("hexapod", HEXAPOD))
    for effect in possible(model)
]


@pytest.mark.parametrize(("model", "effect"), CASES)
def test_the_tip_is_where_the_workbench_predicts_it(model: MachineModel, effect: Effect) -> None:
    values = values_of(random_inputs(model, ROWS))
    machine = carrying(model, effect)
    found, _ = compensate_cmm(machine, values, WarmStart.at_zero(machine))
    rows = seen_as_recording(model, values)
    each, _ = deltas_by_effect(machine.effects, rows, {})
    predicted = predict(model, rows, sum_deltas(list(each.values())))
    assert not found.reason.any()
    assert found.tip_M_mm == pytest.approx(predicted.tip_mm, abs=1e-9)
    assert found.link_length_mm == pytest.approx(predicted.link_length_mm, abs=1e-9)
    plain, _ = compensate_cmm(model, values, WarmStart.at_zero(model))
    assert np.abs(found.tip_M_mm - plain.tip_M_mm).max() > 1e-5, "an effect that moves nothing tests nothing"


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD, ON_PLATE], ids=["tripod", "hexapod", "tool on plate"])
def test_snapshots_one_by_one_are_as_all_rows_together(model: MachineModel) -> None:
    """Every effect at once, bit for bit: memory goes from snapshot to snapshot as from row to row."""
    machine = carrying(model, *possible(model))
    values = values_of(random_inputs(model, ROWS))
    start = WarmStart.at_zero(machine)
    together_, after = compensate_cmm(machine, values, start)
    warm = start
    for i in range(ROWS):
        one, warm = compensate_cmm(machine, row(values, i), start._replace(effects=warm.effects))
        assert one.tip_M_mm.tobytes() == together_.tip_M_mm[i].tobytes()
        assert one.tip_P_mm.tobytes() == np.broadcast_to(together_.tip_P_mm, (ROWS, 3))[i].tobytes()
        assert one.correction_mm.tobytes() == together_.correction_mm[i].tobytes()
        for name, contribution in one.contributions.items():
            assert contribution.tobytes() == together_.contributions[name][i].tobytes(), name
    for name, memory in warm.effects.memories.items():
        for a, b in zip(memory or (), after.effects.memories[name] or (), strict=True):
            assert np.array_equal(a, b, equal_nan=True), name


@pytest.mark.parametrize(("model", "effect"), CASES)
def test_scales_at_the_setpoint_bring_the_tip_to_the_target(model: MachineModel, effect: Effect) -> None:
    machine = carrying(model, effect)
    values = row(values_of(random_inputs(model, ROWS)), 5)
    start = WarmStart.at_zero(machine)
    target_B0_mm = model.zero.contact.tip_M_mm - model.frame.zero_origin_M_mm + np.array([12.0, -7.0, 3.0])
    asked, _ = compensate_machine_tool(
        machine, target_B0_mm, None, values._replace(scale_mm=np.full(model.links, np.nan)), start
    )
    assert asked.reason == Reason.OK
    found, _ = compensate_cmm(machine, values._replace(scale_mm=asked.scale_setpoint_mm), start)
    # what two looks leave of a cyclic error of 0.2 um in each of four terms
    assert found.tip_B0_mm == pytest.approx(target_B0_mm, abs=3e-5 if effect.id == "scale_cyclic" else 1e-6)


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD, ON_PLATE], ids=["tripod", "hexapod", "tool on plate"])
def test_the_shares_of_joints_frame_and_effects_add_up_to_the_correction(model: MachineModel) -> None:
    machine = carrying(model, *possible(model))
    values = values_of(random_inputs(model, ROWS))
    start = WarmStart.at_zero(machine)
    found, _ = compensate_cmm(machine, values, start)
    target = machine.zero.contact.tip_P_mm if model is ON_PLATE else np.array([1.0, 2.0, -505.0])
    if model is HEXAPOD:
        target = model.zero.contact.tip_M_mm - model.frame.zero_origin_M_mm
    asked, _ = compensate_machine_tool(machine, np.tile(target, (ROWS, 1)), None, values, start)
    for result in (found, asked):
        assert not result.reason.any()
        assert list(result.contributions) == ["joints", "frame", *(one.effect.id for one in machine.effects)]
        assert sum(result.contributions.values()) == pytest.approx(result.correction_mm, abs=1e-10)


def test_a_share_is_what_the_effect_adds_to_those_before_it() -> None:
    first, second = LIBRARY["link_zero"], LIBRARY["tool_offset"]
    values = row(values_of(random_inputs(TRIPOD, ROWS)), 3)
    corrections = [np.zeros(3)]
    for effects in ((), (first,), (first, second)):
        machine = carrying(TRIPOD, *effects)
        corrections.append(compensate_cmm(machine, values, WarmStart.at_zero(machine))[0].correction_mm)
    result, _ = compensate_cmm(machine, values, WarmStart.at_zero(machine))
    assert result.contributions["link_zero"] == pytest.approx(corrections[2] - corrections[1], abs=1e-12)
    assert result.contributions["tool_offset"] == pytest.approx(corrections[3] - corrections[2], abs=1e-12)


def test_what_happens_at_the_reference_never_acts_on_the_machine() -> None:
    machine = carrying(TRIPOD, *(effect for effect in LIBRARY.values() if not effect.live))
    values = values_of(random_inputs(TRIPOD, ROWS))
    with_, after = compensate_cmm(machine, values, WarmStart.at_zero(machine))
    without, _ = compensate_cmm(TRIPOD, values, WarmStart.at_zero(TRIPOD))
    assert with_.tip_M_mm.tobytes() == without.tip_M_mm.tobytes()
    assert list(with_.contributions) == ["joints", "frame"]
    assert after.effects.memories == {}


def test_a_pose_out_of_reach_costs_no_memory() -> None:
    machine = carrying(TRIPOD, LIBRARY["link_expansion_lag"], LIBRARY["backlash"])
    values = values_of(random_inputs(TRIPOD, ROWS))
    warm = WarmStart.at_zero(machine)
    for i in range(4):
        _, warm = compensate_cmm(machine, row(values, i), warm)
    refused, kept = compensate_cmm(machine, row(values, 4)._replace(scale_mm=np.full(3, 1e5)), warm)
    assert refused.reason != Reason.OK
    assert np.isnan(refused.contributions["backlash"]).all()
    assert kept.effects.motion.direction.tolist() == warm.effects.motion.direction.tolist()
    lagged = kept.effects.memories["link_expansion_lag"]
    assert lagged is not None
    assert np.isfinite(lagged).all()


def test_going_over_to_commanded_scales_is_no_reversal() -> None:
    machine = carrying(TRIPOD, LIBRARY["backlash"], LIBRARY["link_zero"])
    values = row(values_of(random_inputs(TRIPOD, ROWS)), 0)
    warm = WarmStart.at_zero(machine)
    for step in range(3):
        _, warm = compensate_cmm(machine, values._replace(scale_mm=np.full(3, 0.1 * step), time_s=float(step)), warm)
    assert warm.effects.motion is not None
    assert warm.effects.motion.direction.tolist() == [1, 1, 1]
    there, warm = compensate_machine_tool(
        machine, np.array([0.0, 0.0, -510.0]), None, values._replace(time_s=3.0), warm
    )
    assert there.reason == Reason.OK
    assert warm.effects.motion.direction.tolist() == [1, 1, 1]
