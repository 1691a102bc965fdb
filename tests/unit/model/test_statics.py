"""Link forces against virtual work: what the load does, the links take up."""

from __future__ import annotations

import numpy as np
import pytest

from compd.model.kernels.solve_status import Reason, require
from compd.model.kinematics.link_kinematics import forward_kinematics
from compd.model.kinematics.statics import link_forces
from compd.model.machine import MachineModel
from tests.support.model_machines import hexapod, inverse_pose, rotation, tips, tripod

TRIPOD, HEXAPOD = tripod(), hexapod()


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD])
def test_work_of_the_load_is_work_of_the_links(model: MachineModel) -> None:
    """Lengthen one link by a little: the load's work at the tip and at the weight is axial force times length."""
    rng = np.random.default_rng(1)
    mechanism = model.mechanism(model.zero.base_joints_M_mm)
    tool, weight_N, weight_at_P = model.zero.contact.tip_P_mm, 80.0, np.array([5.0, -3.0, 20.0])
    h = 1e-3
    for tip in tips(model, 8, 2):
        pose = inverse_pose(model, mechanism, tip, tool, model.zero.rotation_M_P)
        force = rng.normal(0, 50, 3)
        forces = link_forces(mechanism, pose.origin_M_mm, pose.rotation_M_P, force, tip, weight_N, weight_at_P)
        require(forces.reason, "forces")
        for link in range(model.links):
            longer = pose.link_length_mm[None] + np.array([[h], [-h]]) * np.eye(model.links)[link]
            ends = forward_kinematics(mechanism, longer, pose.origin_M_mm, pose.rotation_M_P)
            tip_there = ends.origin_M_mm + ends.rotation_M_P @ tool
            weight_there = ends.origin_M_mm + ends.rotation_M_P @ weight_at_P
            work = force @ (tip_there[0] - tip_there[1]) - weight_N * (weight_there[0] - weight_there[1])[2]
            assert forces.axial_N[link] == pytest.approx(work / (2 * h), abs=1e-5)


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD])
def test_forces_and_moments_add_up_to_nothing(model: MachineModel) -> None:
    mechanism = model.mechanism(model.zero.base_joints_M_mm)
    tip, force = tips(model, 1, 3)[0], np.array([10.0, -20.0, 30.0])
    pose = inverse_pose(model, mechanism, tip, model.zero.contact.tip_P_mm, model.zero.rotation_M_P)
    forces = link_forces(mechanism, pose.origin_M_mm, pose.rotation_M_P, force, tip, 80.0, np.zeros(3))
    joints = pose.origin_M_mm + mechanism.platform_joints_P_mm @ pose.rotation_M_P.T
    along = (joints - mechanism.base_joints_M_mm) / pose.link_length_mm[:, None]
    on_platform = -forces.axial_N[:, None] * along  # tension pulls the platform towards the base joint
    if len(mechanism.revolute_axes):
        on_platform = on_platform + forces.lateral_N[:, None] * (mechanism.revolute_axes @ pose.rotation_M_P.T)
    weight = np.array([0.0, 0.0, -80.0])
    np.testing.assert_allclose(on_platform.sum(0) + force + weight, 0, atol=1e-9)
    moments = np.cross(mechanism.base_joints_M_mm, on_platform).sum(0)  # every link's force passes its base joint
    np.testing.assert_allclose(moments + np.cross(tip, force) + np.cross(pose.origin_M_mm, weight), 0, atol=1e-7)


def test_a_hanging_platform_pulls_its_links_alike() -> None:
    zero = TRIPOD.zero
    forces = link_forces(
        TRIPOD.mechanism(zero.base_joints_M_mm),
        zero.platform_origin_M_mm,
        zero.rotation_M_P,
        np.zeros(3),
        zero.contact.tip_M_mm,
        80.0,
        np.zeros(3),
    )
    steepness = 450.0 / zero.link_length_mm[0]
    np.testing.assert_allclose(forces.axial_N, 80.0 / 3 / steepness, rtol=1e-12)
    np.testing.assert_allclose(forces.lateral_N, 0, atol=1e-12)


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD])
def test_rows_alone_are_as_all_together(model: MachineModel) -> None:
    mechanism = model.mechanism(model.zero.base_joints_M_mm)
    tip = tips(model, 20, 4)
    pose = inverse_pose(model, mechanism, tip, model.zero.contact.tip_P_mm, model.zero.rotation_M_P)
    force = np.random.default_rng(5).normal(0, 50, (20, 3))
    rest = (80.0, np.zeros(3))
    together = link_forces(mechanism, pose.origin_M_mm, pose.rotation_M_P, force, tip, *rest)
    for i in range(20):
        alone = link_forces(mechanism, pose.origin_M_mm[i], pose.rotation_M_P[i], force[i], tip[i], *rest)
        assert all(a.tobytes() == b[i].tobytes() for a, b in zip(alone, together, strict=True))


def test_no_force_where_none_can_be_known() -> None:
    zero = HEXAPOD.zero
    mechanism = HEXAPOD.mechanism(zero.base_joints_M_mm)
    load = (np.zeros(3), zero.contact.tip_M_mm, 120.0, np.zeros(3))
    singular = link_forces(mechanism, zero.platform_origin_M_mm, rotation("z", 90.0), *load)
    assert singular.reason == Reason.NEAR_SINGULAR
    assert np.isnan(singular.axial_N).all()
    for bad in (np.nan, np.inf):
        unknown = link_forces(
            mechanism, zero.platform_origin_M_mm, zero.rotation_M_P, np.array([0.0, bad, 0.0]), *load[1:]
        )
        assert unknown.reason == Reason.NOT_FINITE
        assert np.isnan(unknown.axial_N).all()
