"""Both modes of the compensation: that they agree with each other, with the truth, and fail by name."""

from __future__ import annotations

import numpy as np
import pytest

from compd.compensation.compensation import compensate_cmm, compensate_machine_tool
from compd.compensation.values import Compensation, GaugeValues, WarmStart
from compd.errors import KinematicsError
from compd.model import MachineModel, MachineParts, machine_model
from compd.model.kernels import Reason, require
from compd.model.kinematics import Contact, ToolOnPlate
from compd.rotation import rotation_matrix, rotation_vector, to_inner
from tests.support.model_machines import (
    Floats,
    hexapod,
    hexapod_parts,
    move_machine,
    rotation,
    tips,
    tripod,
    tripod_parts,
)

ROWS = 25


def work_on_platform(parts: dict[str, object]) -> MachineModel:
    """Figure 15: the tool stands on the surface plate, the work is carried under it."""
    tool_M, place_P = np.array([0.0, 0.0, 190.0]), np.array([10.0, 5.0, -60.0])
    return machine_model(
        MachineParts(**{**parts, "arrangement": ToolOnPlate(tool_M), "zero_contact": Contact(tool_M, place_P)})
    )  # type: ignore[arg-type]


UNDER = (rotation("x", 180), np.array([0.0, 0.0, 50.0]))
BESIDE = (rotation("y", 90), np.array([-800.0, 0.0, 300.0]))
MACHINES = {
    "tripod": tripod(),
    "hexapod": hexapod(),
    "tripod under the work": machine_model(MachineParts(**move_machine(tripod_parts(), *UNDER))),
    "hexapod beside the work": machine_model(MachineParts(**move_machine(hexapod_parts(), *BESIDE))),
    "tripod with the work on the platform": work_on_platform(tripod_parts()),
    "hexapod with the work on the platform": work_on_platform(hexapod_parts()),
}
every_machine = pytest.mark.parametrize("model", MACHINES.values(), ids=MACHINES.keys())


def targets(model: MachineModel, rows: int = ROWS) -> Floats:
    """Places in {B0}; with the work on the platform, places on it."""
    if isinstance(model.arrangement, ToolOnPlate):
        return model.zero.contact.tip_P_mm + np.random.default_rng(1).uniform(-40, 40, (rows, 3))
    return np.asarray(to_inner(model.frame.zero_rotation_M_B, model.frame.zero_origin_M_mm, tips(model, rows, 1, 50.0)))


def gauges(model: MachineModel, rows: int = ROWS, scale_mm: Floats | None = None) -> GaugeValues:
    """Joints and frame displaced by some micrometres; the scales not read."""
    rng = np.random.default_rng(2)
    joint_mm = rng.normal(0, 0.004, (rows, model.joint_weights.shape[1]))
    unread = np.full((rows, model.links), np.nan)
    return GaugeValues(unread if scale_mm is None else scale_mm, joint_mm, rng.normal(0, 0.02, (rows, 9)), {})


def row(values: GaugeValues, i: int) -> GaugeValues:
    return GaugeValues(values.scale_mm[i], values.joint_mm[i], values.frame_mm[i], {})


def machine_tool(model: MachineModel, values: GaugeValues) -> Compensation:
    result, _ = compensate_machine_tool(model, targets(model), None, values, WarmStart.at_zero(model))
    return result


@every_machine
def test_scales_at_the_setpoint_bring_the_tip_to_the_target(model: MachineModel) -> None:
    """What machine-tool mode asks for, CMM mode finds on the target: (8) and (9) close."""
    values = gauges(model)
    asked = machine_tool(model, values)
    require(asked.reason, "asked")
    found, _ = compensate_cmm(model, values._replace(scale_mm=asked.scale_setpoint_mm), WarmStart.at_zero(model))
    require(found.reason, "found")
    np.testing.assert_allclose(found.tip_M_mm, asked.tip_M_mm + 0 * found.tip_M_mm, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.tip_P_mm, asked.tip_P_mm + 0 * found.tip_P_mm, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.rotation_M_P, asked.rotation_M_P, rtol=0, atol=1e-12)
    tool_on_plate = isinstance(model.arrangement, ToolOnPlate)
    np.testing.assert_allclose(found.tip_P_mm if tool_on_plate else found.tip_B0_mm, targets(model), atol=1e-9)
    assert np.abs(asked.correction_mm).max() > 0.01


@every_machine
def test_both_modes_mean_the_same_by_a_correction(model: MachineModel) -> None:
    """Scales at the uncompensated command: CMM mode takes the same target from them, and the same correction."""
    values = gauges(model)
    asked = machine_tool(model, values)
    found, _ = compensate_cmm(model, values._replace(scale_mm=asked.nominal_scale_mm), WarmStart.at_zero(model))
    np.testing.assert_allclose(found.correction_mm, asked.correction_mm, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.target_B_mm, asked.target_B_mm, rtol=0, atol=1e-9)
    for cause in asked.contributions:
        np.testing.assert_allclose(found.contributions[cause], asked.contributions[cause], rtol=0, atol=1e-9)


@every_machine
def test_the_shares_add_up_and_each_is_what_its_gauges_do_alone(model: MachineModel) -> None:
    values = gauges(model)
    both = machine_tool(model, values)
    np.testing.assert_allclose(sum(both.contributions.values()), both.correction_mm, rtol=0, atol=1e-12)
    no_frame = machine_tool(model, values._replace(frame_mm=np.zeros((ROWS, 9))))
    no_joints = machine_tool(model, values._replace(joint_mm=0 * values.joint_mm))
    np.testing.assert_allclose(both.contributions["joints"], no_frame.correction_mm, rtol=0, atol=1e-9)
    np.testing.assert_allclose(both.contributions["frame"], no_joints.correction_mm, rtol=0, atol=1e-9)
    np.testing.assert_allclose(both.scale_setpoint_mm, both.nominal_scale_mm + both.correction_mm, rtol=0, atol=1e-12)


@every_machine
def test_gauges_at_zero_ask_for_no_correction(model: MachineModel) -> None:
    quiet = GaugeValues(np.zeros(model.links), np.zeros(model.joint_weights.shape[1]), np.zeros(9), {})
    result, warm = compensate_cmm(model, quiet, WarmStart.at_zero(model))
    np.testing.assert_allclose(result.correction_mm, 0, atol=1e-9)
    np.testing.assert_allclose(result.tip_M_mm, model.zero.contact.tip_M_mm, atol=1e-9)
    np.testing.assert_allclose(result.tip_P_mm, model.zero.contact.tip_P_mm, atol=1e-9)
    np.testing.assert_allclose(result.frame.displacement_M_mm, 0, atol=1e-12)
    np.testing.assert_allclose(warm.origin_M_mm, model.zero.platform_origin_M_mm, atol=1e-9)


@every_machine
def test_rows_alone_are_as_all_together(model: MachineModel) -> None:
    """Bit for bit, in every number of the result and of the next start."""
    start = WarmStart.at_zero(model)
    values = gauges(model)
    wanted = targets(model)
    asked, asked_next = compensate_machine_tool(model, wanted, None, values, start)
    values = values._replace(scale_mm=asked.nominal_scale_mm)
    found, found_next = compensate_cmm(model, values, start)
    for i in range(ROWS):
        one, one_next = compensate_machine_tool(model, wanted[i], None, row(values, i), start)
        assert_same_bits(one, asked, i)
        assert all(a.tobytes() == b[i].tobytes() for a, b in zip(one_next[:3], asked_next[:3], strict=True))
        one, one_next = compensate_cmm(model, row(values, i), start)
        assert_same_bits(one, found, i)
        assert all(a.tobytes() == b[i].tobytes() for a, b in zip(one_next[:3], found_next[:3], strict=True))


def assert_same_bits(one: Compensation, many: Compensation, i: int) -> None:
    for name in ("rotation_M_P", "link_length_mm", "target_B_mm", "nominal_scale_mm", "scale_setpoint_mm"):
        assert getattr(one, name).tobytes() == getattr(many, name)[i].tobytes(), name
    for name in ("tip_M_mm", "tip_B0_mm", "tip_P_mm"):
        every = np.broadcast_to(getattr(many, name), (ROWS, 3))
        assert getattr(one, name).tobytes() == every[i].tobytes(), name
    for cause, contribution in one.contributions.items():
        assert contribution.tobytes() == many.contributions[cause][i].tobytes(), cause
    assert all(a.tobytes() == b[i].tobytes() for a, b in zip(one.frame, many.frame, strict=True))


@pytest.mark.parametrize("turn", [UNDER, BESIDE], ids=["under", "beside"])
@pytest.mark.parametrize("parts", [tripod_parts(), hexapod_parts()], ids=["tripod", "hexapod"])
def test_a_turned_world_asks_for_the_same_setpoint(parts: dict[str, object], turn: tuple[Floats, Floats]) -> None:
    here, there = machine_model(MachineParts(**parts)), machine_model(MachineParts(**move_machine(parts, *turn)))  # type: ignore[arg-type]
    values = gauges(here)
    upright, _ = compensate_machine_tool(here, targets(here), None, values, WarmStart.at_zero(here))
    turned, _ = compensate_machine_tool(there, targets(here), None, values, WarmStart.at_zero(there))
    np.testing.assert_allclose(turned.scale_setpoint_mm, upright.scale_setpoint_mm, rtol=0, atol=1e-9)
    np.testing.assert_allclose(turned.target_B_mm, upright.target_B_mm, rtol=0, atol=1e-9)


def test_a_hexapods_attitude_is_that_asked_for_in_the_base_at_zero() -> None:
    model = MACHINES["hexapod beside the work"]
    wanted_B0_rad = np.array([0.02, -0.05, 0.1])
    one = row(gauges(model), 0)
    target = targets(model)[0]
    result, _ = compensate_machine_tool(model, target, wanted_B0_rad, one, WarmStart.at_zero(model))
    in_B0 = model.frame.zero_rotation_M_B.T @ result.rotation_M_P
    np.testing.assert_allclose(rotation_vector(in_B0), wanted_B0_rad, atol=1e-14)
    straight, _ = compensate_machine_tool(model, target, None, one, WarmStart.at_zero(model))
    np.testing.assert_allclose(straight.rotation_M_P, model.zero.rotation_M_P, atol=1e-15)


def test_a_tripod_has_no_attitude_to_ask_for() -> None:
    model = MACHINES["tripod"]
    with pytest.raises(KinematicsError, match="follows from its tip"):
        compensate_machine_tool(model, np.zeros(3), np.zeros(3), row(gauges(model), 0), WarmStart.at_zero(model))


def test_on_figure_15_the_touched_place_is_where_the_tool_is_in_the_platform() -> None:
    """Worked by hand on the hexapod: the platform's pose is known, the tool stands still."""
    model = MACHINES["hexapod with the work on the platform"]
    R, origin = rotation_matrix(np.array([0.03, 0.02, -0.04])), np.array([12.0, -7.0, 405.0])
    joints = model.platform_joints_P_mm @ R.T + origin
    scale_mm = np.linalg.norm(joints - model.zero.base_joints_M_mm, axis=1) - model.zero.link_length_mm
    values = GaugeValues(scale_mm, np.zeros(12), np.zeros(9), {})
    result, _ = compensate_cmm(model, values, WarmStart.at_zero(model))
    np.testing.assert_allclose(result.tip_P_mm, R.T @ (np.array([0.0, 0.0, 190.0]) - origin), atol=1e-9)
    np.testing.assert_allclose(result.tip_M_mm, [0.0, 0.0, 190.0], atol=0)


@every_machine
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_gauge_without_a_number_gives_a_reason_and_no_number(model: MachineModel, bad: float) -> None:
    values = gauges(model, scale_mm=np.zeros((ROWS, model.links)))
    start = WarmStart.at_zero(model)
    kinds = {"joint_mm": 3, "frame_mm": 5, "scale_mm": 2}
    for row_, (kind, index) in enumerate(kinds.items(), start=1):
        getattr(values, kind)[row_, index] = bad
    found, after = compensate_cmm(model, values, start)
    assert found.reason.tolist() == [0, 1, 1, 1, *[0] * (ROWS - 4)]
    assert_blank(found, [1, 2, 3])
    for i in (1, 2, 3):
        assert all(np.array_equal(kept[i], first) for kept, first in zip(after[:3], start[:3], strict=True))
    asked = machine_tool(model, values)
    assert asked.reason.tolist() == [0, 1, 1, 0, *[0] * (ROWS - 4)]  # machine-tool mode needs no scale
    assert_blank(asked, [1, 2])
    one, kept_start = compensate_cmm(model, row(values, 1), start)
    assert one.reason == Reason.NOT_FINITE
    assert np.isnan(one.correction_mm).all()
    assert all(np.array_equal(a, b) for a, b in zip(kept_start[:3], start[:3], strict=True))


def assert_blank(result: Compensation, rows: list[int]) -> None:
    """nan in exactly these rows."""
    others = [i for i in range(ROWS) if i not in rows]
    others_named = ("frame", "contributions", "reason")
    numbers = [value for name, value in result._asdict().items() if name not in others_named and value is not None]
    for value in [*numbers, *result.contributions.values()]:
        assert np.isnan(value[rows]).all()
        assert np.isfinite(value[others]).all()


def test_the_reason_is_that_of_the_step_that_failed_first() -> None:
    model = MACHINES["tripod"]
    one = row(gauges(model, scale_mm=np.zeros((ROWS, 3))), 0)
    start = WarmStart.at_zero(model)
    torn = one._replace(frame_mm=np.array([900.0, 0, 0, 0, 0, 0, 0, 0, 0]))
    assert compensate_cmm(model, torn, start)[0].reason == Reason.UNREACHABLE
    far = one._replace(scale_mm=np.array([5000.0, 0, 0]))
    assert compensate_cmm(model, far, start)[0].reason == Reason.UNREACHABLE
    level = np.array([0.0, 0.0, -60.0])  # the platform's joints level with the base joints
    assert compensate_machine_tool(model, level, None, one, start)[0].reason == Reason.NEAR_SINGULAR


def test_a_warm_start_changes_the_last_bits_at_most() -> None:
    model = MACHINES["tripod"]
    values = gauges(model)
    cold, after = compensate_machine_tool(model, targets(model), None, values, WarmStart.at_zero(model))
    warm, _ = compensate_machine_tool(model, targets(model), None, values, after)
    np.testing.assert_allclose(warm.scale_setpoint_mm, cold.scale_setpoint_mm, rtol=0, atol=1e-10)
    assert warm.frame.iterations.max() < cold.frame.iterations.max()


def test_a_long_run_of_warm_starts_does_not_drift() -> None:
    """The attitude is handed on ten thousand times and stays a rotation."""
    model = MACHINES["tripod"]
    values = row(gauges(model, scale_mm=np.full((ROWS, 3), [5.0, -3.0, 2.0])), 0)
    warm = WarmStart.at_zero(model)
    for _ in range(10_000):
        _, warm = compensate_cmm(model, values, warm)
    np.testing.assert_allclose(warm.rotation_M_P.T @ warm.rotation_M_P, np.eye(3), atol=1e-15)
