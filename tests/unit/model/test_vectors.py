"""The worked cases of both machines, met to 1e-9 mm and 1e-12 rad."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from compd.compensation import GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool
from compd.model.kinematics.frame import solve_frame
from compd.model.kinematics.link_kinematics import forward_kinematics
from compd.model.kinematics.statics import link_forces
from compd.model.kinematics.tool import Contact, ToolOnPlatform
from compd.model.machine import MachineModel, MachineParts, machine_model
from tests.support.model_machines import TRIPOD_WEIGHTS, Floats, column, extending, inverse_pose, worked_cases

LENGTH_MM = 1e-9
ANGLE_RAD = 1e-12


def near(found: Floats, wanted: Floats, tolerance: float) -> None:
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=tolerance)


@pytest.fixture(scope="module")
def tripod_cases() -> dict[str, Any]:
    return worked_cases("tripod")


@pytest.fixture(scope="module")
def hexapod_cases() -> dict[str, Any]:
    return worked_cases("hexapod")


@pytest.fixture(scope="module")
def tripod(tripod_cases: dict[str, Any]) -> MachineModel:
    geometry = {key: np.array(value, dtype=float) for key, value in tripod_cases["geometry"].items()}
    supports = geometry["base_points_B"] + geometry["origin_B0_in_M"]
    return machine_model(
        MachineParts(
            supports_M_mm=supports,
            base_joints_M_mm=supports,
            support_of_joint=[0, 1, 2],
            rotation_M_B=np.eye(3),
            plate_points_M_mm=geometry["plate_points_M"],
            platform_joints_P_mm=geometry["platform_joints_P"],
            revolute_axes_P=geometry["revolute_axes_P"],
            arrangement=ToolOnPlatform(geometry["tool_P"]),
            zero_contact=Contact(geometry["zero_tip_M"], geometry["tool_P"]),
            zero_rotation_M_P=None,
            joint_weights=TRIPOD_WEIGHTS,
            **extending(3),
            weight_N=80.0,
            weight_at_P_mm=np.zeros(3),
        )
    )


@pytest.fixture(scope="module")
def hexapod(hexapod_cases: dict[str, Any]) -> MachineModel:
    geometry = {key: np.array(value, dtype=float) for key, value in hexapod_cases["geometry"].items()}
    origin = geometry["origin_B0_in_M"]
    return machine_model(
        MachineParts(
            supports_M_mm=geometry["support_points_B"] + origin,
            base_joints_M_mm=geometry["base_joints_B"] + origin,
            support_of_joint=geometry["support_of_leg"].astype(int) - 1,
            rotation_M_B=np.eye(3),
            plate_points_M_mm=geometry["plate_points_M"],
            platform_joints_P_mm=geometry["platform_joints_P"],
            revolute_axes_P=np.empty((0, 3)),
            arrangement=ToolOnPlatform(geometry["tool_P"]),
            zero_contact=Contact(geometry["zero_platform_origin_M"] + geometry["tool_P"], geometry["tool_P"]),
            zero_rotation_M_P=np.eye(3),
            joint_weights=np.zeros((6, 0)),
            **extending(6),
            weight_N=120.0,
            weight_at_P_mm=np.zeros(3),
        )
    )


def changes(cases: list[dict[str, Any]]) -> Floats:
    return np.concatenate([column(cases, "dt_mm"), column(cases, "du_mm")], -1)


def test_lengths_at_machine_zero(tripod: MachineModel, tripod_cases: dict[str, Any]) -> None:
    geometry = tripod_cases["geometry"]
    near(tripod.zero.link_length_mm, geometry["l0"], LENGTH_MM)
    near(tripod.zero.distances_mm, [*geometry["t0"], *geometry["u0"]], LENGTH_MM)


def test_frame(tripod: MachineModel, tripod_cases: dict[str, Any]) -> None:
    cases = tripod_cases["frame"]
    frame = solve_frame(tripod.frame, tripod.zero.distances_mm + changes(cases))
    assert not frame.reason.any()
    near(frame.supports_M_mm, column(cases, "supports_M"), LENGTH_MM)
    near(frame.origin_M_mm, column(cases, "origin_B_in_M"), LENGTH_MM)
    near(frame.rotation_M_B, column(cases, "rotation_M_B"), ANGLE_RAD)


def test_tripod_inverse_and_forward(tripod: MachineModel, tripod_cases: dict[str, Any]) -> None:
    cases = tripod_cases["kinematics"]
    mechanism = tripod.mechanism(tripod.zero.base_joints_M_mm)
    tool, zero = tripod.zero.contact.tip_P_mm, tripod.zero
    inverse = inverse_pose(tripod, mechanism, column(cases, "tip_M"), tool, zero.rotation_M_P)
    lengths = column(cases, "lengths")
    forward = forward_kinematics(mechanism, lengths, zero.platform_origin_M_mm, zero.rotation_M_P)
    for pose in (inverse, forward):
        assert not pose.reason.any()
        near(pose.origin_M_mm, column(cases, "platform_origin_M"), LENGTH_MM)
        near(pose.rotation_M_P, column(cases, "rotation_M_P"), ANGLE_RAD)
        near(pose.link_length_mm, lengths, LENGTH_MM)


def test_cmm_mode(tripod: MachineModel, tripod_cases: dict[str, Any]) -> None:
    cases = tripod_cases["cmm_mode"]
    values = GaugeValues(column(cases, "scale_mm"), column(cases, "joint_mm"), changes(cases), {})
    result, _ = compensate_cmm(tripod, values, WarmStart.at_zero(tripod))
    assert not result.reason.any()
    near(result.tip_M_mm, column(cases, "tip_M"), LENGTH_MM)
    near(result.link_length_mm, column(cases, "lengths"), LENGTH_MM)


def test_machine_tool_mode(tripod: MachineModel, tripod_cases: dict[str, Any]) -> None:
    cases = tripod_cases["machine_tool_mode"]
    joint_mm = column(cases, "joint_mm")
    values = GaugeValues(np.full((len(cases), 3), np.nan), joint_mm, changes(cases), {})
    targets = column(cases, "target_B0")
    result, _ = compensate_machine_tool(tripod, targets, None, values, WarmStart.at_zero(tripod))
    assert not result.reason.any()
    near(result.target_B_mm, column(cases, "target_B"), LENGTH_MM)
    near(result.link_length_mm, column(cases, "lengths"), LENGTH_MM)
    near(result.scale_setpoint_mm, column(cases, "scale_setpoint_mm"), LENGTH_MM)
    near(result.nominal_scale_mm, column(cases, "nominal_scale_mm"), LENGTH_MM)


def test_statics(tripod: MachineModel, tripod_cases: dict[str, Any]) -> None:
    cases = tripod_cases["statics"]
    mechanism = tripod.mechanism(tripod.zero.base_joints_M_mm)
    tip_M_mm = column(cases, "tip_M")
    pose = inverse_pose(tripod, mechanism, tip_M_mm, tripod.zero.contact.tip_P_mm, tripod.zero.rotation_M_P)
    forces = link_forces(
        mechanism,
        pose.origin_M_mm,
        pose.rotation_M_P,
        column(cases, "force_on_tip_M_N"),
        tip_M_mm,
        column(cases, "platform_weight_N"),
        np.zeros(3),
    )
    assert not forces.reason.any()
    near(forces.axial_N, column(cases, "axial_force_N"), 1e-9)


def test_hexapod(hexapod: MachineModel, hexapod_cases: dict[str, Any]) -> None:
    cases = hexapod_cases["poses"]
    near(hexapod.zero.link_length_mm, hexapod_cases["geometry"]["l0"], LENGTH_MM)
    frame = solve_frame(hexapod.frame, hexapod.zero.distances_mm + changes(cases))
    near(frame.base_joints_M_mm, column(cases, "base_joints_M"), LENGTH_MM)
    values = GaugeValues(column(cases, "scale_mm"), np.zeros((len(cases), 0)), changes(cases), {})
    result, warm = compensate_cmm(hexapod, values, WarmStart.at_zero(hexapod))
    assert not result.reason.any()
    near(result.link_length_mm, column(cases, "lengths"), LENGTH_MM)
    near(warm.origin_M_mm, column(cases, "platform_origin_M"), LENGTH_MM)
    near(result.rotation_M_P, column(cases, "rotation_M_P"), ANGLE_RAD)
    near(result.tip_M_mm, column(cases, "tip_M"), LENGTH_MM)


def test_one_at_a_time_is_as_all_at_once(tripod: MachineModel, tripod_cases: dict[str, Any]) -> None:
    cases = tripod_cases["cmm_mode"]
    warm = WarmStart.at_zero(tripod)
    values = GaugeValues(column(cases, "scale_mm"), column(cases, "joint_mm"), changes(cases), {})
    together, _ = compensate_cmm(tripod, values, warm)
    for i in range(len(cases)):
        alone, _ = compensate_cmm(tripod, GaugeValues(*(part[i] for part in values[:3]), {}), warm)
        assert alone.tip_M_mm.tobytes() == together.tip_M_mm[i].tobytes()
        assert alone.scale_setpoint_mm.tobytes() == together.scale_setpoint_mm[i].tobytes()
