"""Compensation, predictions and derivatives of machines whose actuators extend, slide or turn.

The worked cases, computed by other code, give poses for actuators; everything else is asked of them by differences.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from compd.compensation import GaugeValues, WarmStart, command_pose, compensate_cmm, compensate_machine_tool
from compd.configuration import Geometry
from compd.machine_builder import build_model
from compd.model import (
    MachineModel,
    effect_deltas,
    machine_constants,
    observe,
    predict,
    sensitivities,
    sum_deltas,
    tip_by_scales,
    tip_derivatives,
)
from compd.model.effect_memory import EffectMemory
from compd.model.effects import FittedEffect, MachineDetails, Observations, port_size, unmet_needs
from compd.model.kinematics import Movement, Pose, inverse_kinematics
from compd.model.library import load_library
from compd.operation_settings import Wiring
from compd.rotation import rotation_matrix, rotation_vector, to_inner
from tests.support.model_machines import Floats, worked_cases
from tests.unit.model.test_machines import KINDS, built, geometry_of, places_mm

NOTHING, STILL_mm = np.zeros(0), np.zeros(9)
QUANTITIES = {
    **{f"temperature_link_{i}_degC": np.array(20.0 + i) for i in range(1, 7)},
    **{f"force_{axis}_N": np.array(force) for axis, force in zip("xyz", (3.0, -5.0, 20.0), strict=True)},
    "temperature_platform_degC": np.array(24.0),
}
AT_ZERO = {name: float(20.0 if "temperature" in name else 0.0) for name in QUANTITIES}


@cache
def machine(kind: str) -> MachineModel:
    model = built(kind)
    return replace(model, constants=machine_constants(model, MachineDetails()))


@cache
def on_a_frame(kind: str) -> MachineModel:
    """The same machine on a base whose supports are measured from a plate."""
    data = geometry_of(worked_cases("machines")[kind]).model_dump(exclude_none=True, exclude_defaults=True)
    circle = np.deg2rad([[90.0], [210.0], [330.0]])
    ring = np.concatenate([np.cos(circle), np.sin(circle), 0 * circle], axis=1)
    turned = np.concatenate([np.cos(circle + 1.0), np.sin(circle + 1.0), 0 * circle], axis=1)
    data["base"] = {
        "supports_B_mm": (500.0 * ring).tolist(),
        "support_of_joint": [1 + i % 3 for i in range(len(data["rods"]))],
    }
    data["plate_points_M_mm"] = (300.0 * turned - [0.0, 0.0, 900.0]).tolist()
    model = build_model(Geometry.model_validate(data), Wiring(scale=(), joint=(), frame=()))
    return replace(model, constants=machine_constants(model, MachineDetails()))


MOVED_FRAME_mm = np.array([0.02, -0.01, 0.015, 0.03, -0.02, 0.01, 0.02, -0.03, 0.01])


def readings_mm(kind: str) -> Floats:
    """Scales (N, m) of the worked cases since machine zero."""
    model = machine(kind)
    cases = worked_cases("machines")[kind]["cases"]
    return np.array([places_mm(model, case) for case in cases]) - model.zero.actuator_mm


def values(scale_mm: Floats, time_s: float = 0.0, frame_mm: Floats = NOTHING) -> GaugeValues:
    return GaugeValues(scale_mm, NOTHING, frame_mm, QUANTITIES, time_s, AT_ZERO)


def observed(model: MachineModel, scale_mm: Floats, frame_mm: Floats = STILL_mm) -> Observations:
    assert model.constants is not None
    count = len(scale_mm)
    none = np.zeros((count, 0))
    return observe(
        model,
        model.constants,
        scale_mm=scale_mm,
        joint_mm=none,
        frame_mm=np.tile(frame_mm, (count, 1)),
        quantities={name: np.full(count, value) for name, value in QUANTITIES.items()},
        time_s=np.arange(count, dtype=float),
        session_start=np.zeros(count, dtype=bool),
        movement=Movement.unknown(scale_mm, none),
        quantities_at_zero=AT_ZERO,
    )


@pytest.mark.parametrize("kind", KINDS)
def test_the_tip_is_where_the_worked_cases_have_it(kind: str) -> None:
    model, cases = machine(kind), worked_cases("machines")[kind]["cases"]
    for scale_mm, case in zip(readings_mm(kind), cases, strict=True):
        found, _ = compensate_cmm(model, values(scale_mm), WarmStart.at_zero(model))
        assert found.reason == 0
        np.testing.assert_allclose(found.tip_M_mm, case["tip_mm"], atol=1e-9)
        np.testing.assert_allclose(found.correction_mm, 0.0, atol=1e-9)
        rows = observed(model, scale_mm[None])
        np.testing.assert_allclose(rows.tip_M_mm[0], case["tip_mm"], atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_a_target_is_reached_from_the_last_cycle(kind: str) -> None:
    model, cases = machine(kind), worked_cases("machines")[kind]["cases"]
    warm = WarmStart.at_zero(model)
    zero_B = model.frame.zero_rotation_M_B
    for scale_mm, case in zip(readings_mm(kind), cases, strict=True):
        target_mm = to_inner(zero_B, model.frame.zero_origin_M_mm, np.array(case["tip_mm"]))
        wanted = None
        if model.attitude_is_free:
            wanted = rotation_vector(zero_B.T @ rotation_matrix(np.array(case["rotation_vector_rad"])))
        unknown = values(np.full(model.scales, np.nan))
        found, warm = compensate_machine_tool(model, target_mm, wanted, unknown, warm)
        assert found.reason == 0
        np.testing.assert_allclose(found.scale_setpoint_mm, scale_mm, atol=1e-9)
        np.testing.assert_allclose(found.tip_M_mm, case["tip_mm"], atol=1e-9)


def with_effects(model: MachineModel) -> MachineModel:
    """The machine with every effect of the library that it can have."""
    rows = observed(model, np.zeros((1, model.scales)))
    usable = [
        effect
        for effect in load_library().values()
        if effect.live
        and not unmet_needs(effect, rows.available, model.links, AT_ZERO)
        and not effect.remembers
        and "motion" not in effect.needs
    ]
    assert {"link_expansion", "link_elasticity", "scale_gain", "base_joint_position", "link_zero"} <= {
        effect.id for effect in usable
    }
    rng = np.random.default_rng(5)
    fitted = tuple(
        FittedEffect(
            effect,
            rng.uniform(0.2, 0.9, len(columns)) * [0.3 * column.parameter.theta_range[1] for column in columns],
            {constant.name: constant.grid[0] for constant in effect.constants},
        )
        for effect in usable
        if (columns := effect.columns(model.links))
    )
    return replace(model, effects=fitted)


@pytest.mark.parametrize("kind", KINDS)
def test_the_loop_with_effects_is_the_prediction(kind: str) -> None:
    model = with_effects(machine(kind))
    for scale_mm in readings_mm(kind):
        found, _ = compensate_cmm(model, values(scale_mm, 1.0), WarmStart.at_zero(model))
        rows = observed(model, scale_mm[None])
        added = sum_deltas([effect_deltas(fitted, rows)[0] for fitted in model.effects])
        shown = predict(model, rows, added)
        assert found.reason == shown.reason[0] == 0
        np.testing.assert_allclose(found.tip_M_mm, shown.tip_mm[0], atol=1e-9)
        assert np.abs(shown.tip_mm - rows.tip_M_mm).max() > 1e-3
        # at the setpoint the machine with these effects is where the kinematics alone has the tip now
        there = predict(model, observed(model, found.scale_setpoint_mm[None]), added)
        fixed = model.actuators.fixed == 1
        turned = rotation_vector(there.rotation_M_P[0] @ rows.rotation_M_P[0].T)
        np.testing.assert_allclose((there.tip_mm - rows.tip_M_mm)[0, fixed[:3]], 0.0, atol=1e-9)
        np.testing.assert_allclose(turned[fixed[3:]], 0.0, atol=1e-6)
        np.testing.assert_allclose(
            np.sum([found.contributions[cause] for cause in found.contributions], axis=0),
            found.correction_mm,
            atol=1e-12,
        )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("port", ["scale", "link", "base_joint", "platform_joint", "revolute_axis", "tool"])
def test_derivatives_are_those_of_the_prediction(kind: str, port: str) -> None:
    model = machine(kind)
    rows = observed(model, readings_mm(kind))
    size, step = port_size(port, rows), 1e-4
    by_port = sensitivities(model, rows, [port])[port]
    for number in range(size):
        added = np.zeros((len(rows), size))
        added[:, number] = step
        up, down = predict(model, rows, {port: added}), predict(model, rows, {port: -added})
        np.testing.assert_allclose(by_port.tip[:, :, number], (up.tip_mm - down.tip_mm) / (2 * step), atol=2e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_what_the_base_carries_moves_with_the_frame(kind: str) -> None:
    """Rails, circles and hinges turn with the base: loop, prediction and both derivatives agree on it."""
    model = on_a_frame(kind)
    scale_mm = readings_mm(kind)[0]
    found, warm = compensate_cmm(model, values(scale_mm, frame_mm=MOVED_FRAME_mm), WarmStart.at_zero(model))
    rows = observed(model, scale_mm[None], MOVED_FRAME_mm)
    assert found.reason == 0
    assert np.abs(found.contributions["frame"]).max() > 1e-3
    np.testing.assert_allclose(found.tip_M_mm, rows.tip_M_mm[0], atol=1e-9)
    np.testing.assert_allclose(predict(model, rows, {}).tip_mm, rows.tip_M_mm, atol=1e-9)
    still = observed(model, scale_mm[None])
    back = predict(model, observed(model, found.scale_setpoint_mm[None], MOVED_FRAME_mm), {})
    fixed = model.actuators.fixed == 1
    np.testing.assert_allclose((back.tip_mm - still.tip_M_mm)[0, fixed[:3]], 0.0, atol=1e-9)
    by_port = sensitivities(model, rows, ["scale", "frame", "plate"])
    for port in ("frame", "plate"):
        step = 1e-4 * np.eye(9)
        wide = observed(model, np.tile(scale_mm, (9, 1)), MOVED_FRAME_mm)
        up, down = predict(model, wide, {port: step}), predict(model, wide, {port: -step})
        np.testing.assert_allclose(by_port[port].tip[0], (up.tip_mm - down.tip_mm).T / 2e-4, atol=2e-6)
    by_gauge = tip_derivatives(
        model,
        scale_mm=scale_mm,
        joint_mm=NOTHING,
        frame_mm=MOVED_FRAME_mm,
        quantities=QUANTITIES,
        quantities_at_zero=AT_ZERO,
        sigmas={},
        time_s=0.0,
        effects=warm.effects,
    ).by_gauge
    expected = np.concatenate([by_port["scale"].tip[0], by_port["frame"].tip[0]], axis=1)
    np.testing.assert_allclose(by_gauge, expected, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_one_snapshot_has_the_same_derivatives(kind: str) -> None:
    model = with_effects(machine(kind))
    scale_mm = readings_mm(kind)[0]
    _, warm = compensate_cmm(model, values(scale_mm), WarmStart.at_zero(model))
    found = tip_derivatives(
        model,
        scale_mm=scale_mm,
        joint_mm=NOTHING,
        frame_mm=NOTHING,
        quantities=QUANTITIES,
        quantities_at_zero=AT_ZERO,
        sigmas={},
        time_s=0.0,
        effects=warm.effects,
    )
    rows = observed(model, scale_mm[None])
    by_scale = sensitivities(model, rows, ["scale"])["scale"].tip[0]
    np.testing.assert_allclose(found.by_gauge, by_scale, atol=1e-9)
    assert np.isfinite(found.by_theta).all()
    assert isinstance(warm.effects, EffectMemory)


@pytest.mark.parametrize("kind", KINDS)
def test_the_tip_by_the_scales_from_a_pose_alone(kind: str) -> None:
    """As the budget of a setpoint asks it, which has no rows."""
    model = machine(kind)
    scale_mm = readings_mm(kind)
    rows = observed(model, scale_mm)
    rotation_M_B = model.frame.zero_rotation_M_B
    mechanism, lengths = model.links_on(rotation_M_B, model.base_joints_at_0_M_mm[None], scale_mm)
    pose = Pose(rows.origin_M_mm, rows.rotation_M_P, lengths, *[np.zeros(len(rows))] * 3)
    expected = sensitivities(model, rows, ["scale"])["scale"].tip
    base_M_mm = mechanism.base_joints_M_mm
    found = tip_by_scales(model, rotation_M_B, base_M_mm, pose, rows.tip_M_mm, scale_mm)
    np.testing.assert_allclose(found, expected, atol=1e-10)


@pytest.mark.parametrize("kind", KINDS)
def test_without_scales_the_commanded_pose_makes_the_controller_drive_what_is_wanted(kind: str) -> None:
    """A controller that knows the drawing alone, told the corrected pose, drives the scales of the compensation."""
    model = with_effects(machine(kind))
    case = worked_cases("machines")[kind]["cases"][0]
    zero_B = model.frame.zero_rotation_M_B
    target_M, R = np.array(case["tip_mm"]), rotation_matrix(np.array(case["rotation_vector_rad"]))
    wanted = rotation_vector(zero_B.T @ R) if model.attitude_is_free else None
    target_B = to_inner(zero_B, model.frame.zero_origin_M_mm, target_M)
    unknown = values(np.full(model.scales, np.nan), 1.0)
    scales, _ = compensate_machine_tool(model, target_B, wanted, unknown, WarmStart.at_zero(model))
    found = command_pose(model, scales)
    assert found.reason == 0
    assert found.pose_correction is not None
    assert np.abs(found.pose_correction[:3]).max() > 1e-4
    assert len(found.correction_mm) == len(found.scale_setpoint_mm) == 0
    drive = inverse_kinematics(
        model.mechanism(model.base_joints_at_0_M_mm),
        model.actuators,
        target_M + zero_B @ found.pose_correction[:3],
        model.zero.contact.tip_P_mm,
        rotation_matrix(zero_B @ found.pose_correction[3:]) @ R if model.attitude_is_free else R,
        model.zero.actuator_mm,
    )
    np.testing.assert_allclose(drive.actuator_mm - model.zero.actuator_mm, scales.scale_setpoint_mm, atol=1e-7)
    total_mm = np.sum([found.contributions[cause] for cause in found.contributions], axis=0)
    np.testing.assert_allclose(zero_B.T @ total_mm, found.pose_correction[:3], atol=0.03 * np.abs(total_mm).max())
