"""Poses far from machine zero are those of its assembly, from scales and from targets, over the whole workspace.

What is right is walked from machine zero in hundredths of the way, by the inverse alone.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from compd.calibration.pose_candidates import rows_at
from compd.compensation.pose_command import scales_of_command
from compd.configuration import load
from compd.machine_builder import build_model
from compd.machine_kinds import KINDS, machine_text
from compd.machine_reach import amplification, amplifications, machine_reach
from compd.model import MachineModel
from compd.model.kinematics import Mechanism, inverse_kinematics
from compd.rotation import compose, rotation_matrix
from tests.support.model_machines import Floats

STEPS = 100
POSES = 400
SHARE_OF_REACH = 0.95
MOST_TURN_RAD = np.deg2rad(20.0)
MOST_AMPLIFIED = 4.0
MACHINES = pytest.mark.parametrize("kind", KINDS)


class Walked(NamedTuple):
    """N poses: scale_mm (N, m), origin_M_mm (N, 3), rotation_M_P (N, 3, 3), tip_M_mm (N, 3)."""

    scale_mm: Floats
    origin_M_mm: Floats
    rotation_M_P: Floats
    tip_M_mm: Floats


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("machines")


def model_of(directory: Path, kind: str) -> MachineModel:
    path = directory / f"{kind}.yaml"
    path.write_text(machine_text("mine", kind, KINDS[kind].usual), encoding="utf-8")
    configuration = load(path)
    return build_model(configuration.geometry, configuration.wiring)


def walked(model: MachineModel, turned: bool) -> Walked:
    """Poses over all that the machine reaches; on none of their ways is it near a singularity or a rod on its side."""
    zero, fixed = model.zero, model.actuators.fixed == 1
    low, high = np.zeros(6), np.zeros(6)
    for way in machine_reach(model).ways:
        place = "xyzabc".index(way.coordinate)
        far = SHARE_OF_REACH * way.reach if place < 3 else min(way.reach, MOST_TURN_RAD if turned else 0.0)
        (low if way.sign < 0 else high)[place] = way.sign * far
    change = low + (high - low) * np.random.default_rng(1).random((POSES, 6))
    mechanism = Mechanism(model.base_joints_at_0_M_mm, model.platform_joints_P_mm, model.revolute_axes_P, model.hinges)
    most = MOST_AMPLIFIED * amplification(
        model.mechanism(zero.base_joints_M_mm), zero.platform_origin_M_mm, zero.rotation_M_P
    )
    actuator_mm = np.broadcast_to(zero.actuator_mm, (POSES, model.scales))
    attitude = np.broadcast_to(zero.rotation_M_P, (POSES, 3, 3))
    good = np.ones(POSES, dtype=bool)
    for share in np.arange(1, STEPS + 1) / STEPS:
        if fixed[3:].any():
            attitude = compose(rotation_matrix(share * change[:, 3:]), zero.rotation_M_P)
        tip_M_mm = zero.contact.tip_M_mm + share * change[:, :3]
        found = inverse_kinematics(mechanism, model.actuators, tip_M_mm, zero.contact.tip_P_mm, attitude, actuator_mm)
        pose, at = found.pose, mechanism._replace(base_joints_M_mm=found.base_joints_M_mm)
        good &= (pose.reason == 0) & (amplifications(at, pose.origin_M_mm, pose.rotation_M_P) <= most)
        # a step beyond three times what the tip moves: the rod is square to its rail, and has another side
        step_mm = np.abs(found.actuator_mm - actuator_mm).max(axis=1)
        good &= step_mm <= 3.0 * np.abs(change[:, :3]).max(axis=1) / STEPS + 10.0 * MOST_TURN_RAD
        actuator_mm = np.where(good[:, None], found.actuator_mm, actuator_mm)
        if not fixed[3:].any():
            attitude = np.where(good[:, None, None], pose.rotation_M_P, attitude)
    tips = pose.origin_M_mm + pose.rotation_M_P @ zero.contact.tip_P_mm
    return Walked(*(values[good] for values in (actuator_mm - zero.actuator_mm, *pose[:2], tips)))


@MACHINES
def test_a_row_at_rest_is_in_the_assembly_of_machine_zero(directory: Path, kind: str) -> None:
    model = model_of(directory, kind)
    right = walked(model, turned=True)
    rows = rows_at(model, right.scale_mm)
    assert len(right.scale_mm) > POSES / 4
    np.testing.assert_allclose(rows.origin_M_mm, right.origin_M_mm, rtol=0, atol=1e-6)
    np.testing.assert_allclose(rows.rotation_M_P, right.rotation_M_P, rtol=0, atol=1e-8)


@MACHINES
def test_the_order_and_number_of_rows_change_no_pose(directory: Path, kind: str) -> None:
    model = model_of(directory, kind)
    scale_mm = walked(model, turned=True).scale_mm[:40]
    together = rows_at(model, scale_mm).origin_M_mm
    alone = [rows_at(model, one[None]).origin_M_mm[0] for one in scale_mm[::-1]]
    np.testing.assert_array_equal(together, alone[::-1])


@MACHINES
def test_a_far_target_is_reached_in_the_assembly_of_machine_zero(directory: Path, kind: str) -> None:
    model = model_of(directory, kind)
    right = walked(model, turned=False)
    np.testing.assert_allclose(model.reach(right.tip_M_mm).scale_mm, right.scale_mm, rtol=0, atol=1e-6)
    # the kinds of machine are written with {B0} as {M}
    commanded_mm = scales_of_command(model, right.tip_M_mm, None)
    np.testing.assert_allclose(commanded_mm, right.scale_mm, rtol=0, atol=1e-6)


def test_a_reading_that_no_pose_has_leaves_the_others_alone(directory: Path) -> None:
    model = model_of(directory, "linear-delta")
    scale_mm = np.full((3, 3), 400.0) * [[1.0], [np.nan], [1.0]]
    scale_mm[2, 0] = -1e4
    rows = rows_at(model, scale_mm)
    np.testing.assert_array_equal(np.isfinite(rows.origin_M_mm).all(axis=1), [True, False, False])
    zero_mm = model.zero.platform_origin_M_mm
    np.testing.assert_allclose(np.linalg.norm(rows.origin_M_mm[0] - zero_mm), 400.0, atol=1e-6)
