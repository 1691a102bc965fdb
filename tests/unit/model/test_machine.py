"""The machine model: from the configuration, frozen, and refused where machine zero cannot be."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from compd.configuration import Geometry, load
from compd.errors import KinematicsError
from compd.machine_builder import build_model, joint_weights
from compd.model.kinematics.tool import Contact, ToolOnPlate
from compd.model.machine import MachineModel, MachineParts, machine_model
from compd.rotation import rotation_matrix
from tests.support.model_machines import hexapod, hexapod_parts, rotation, tripod, tripod_parts
from tests.support.paths import CONFIG


def built(name: str, changes: dict[str, dict[str, object]] | None = None, plate_M_mm: object = None) -> MachineModel:
    """A shipped configuration's machine, with some keys of its geometry changed."""
    configuration = load(CONFIG / name)
    geometry = configuration.geometry.model_dump()
    for section, keys in (changes or {}).items():
        geometry[section] = {**geometry[section], **keys}
    geometry["plate_points_M_mm"] = plate_M_mm or geometry["plate_points_M_mm"]
    return build_model(Geometry.model_validate(geometry), configuration.wiring)


@pytest.mark.parametrize(("name", "wanted"), [("tripod-cmm.yaml", tripod()), ("hexapod.yaml", hexapod())])
def test_the_shipped_machines_are_those_of_the_drawings(name: str, wanted: MachineModel) -> None:
    model = built(name)
    np.testing.assert_allclose(model.zero.link_length_mm, wanted.zero.link_length_mm, rtol=0, atol=1e-6)
    np.testing.assert_allclose(model.zero.distances_mm, wanted.zero.distances_mm, rtol=0, atol=1e-6)
    np.testing.assert_allclose(model.zero.base_joints_M_mm, wanted.zero.base_joints_M_mm, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(model.frame.support_of_joint, wanted.frame.support_of_joint)
    np.testing.assert_array_equal(model.joint_weights, wanted.joint_weights)
    assert (model.links, model.attitude_is_free) == (wanted.links, wanted.links == 6)
    assert model.weight_N == wanted.weight_N


def test_two_shanks_count_half_each() -> None:
    wiring = load(CONFIG / "tripod-cmm.yaml").wiring
    np.testing.assert_array_equal(joint_weights(wiring, 3), np.kron(np.eye(3), [1.0, 0.5, 0.5]))


@pytest.mark.parametrize(
    ("rotation", "y_sign"), [((np.pi, 0.0, 0.0), -1), ((0.0, np.pi / 2, 0.0), 1), ((0.3, -0.4, 0.5), 1)]
)
def test_a_tripods_base_may_stand_in_any_pose(rotation: tuple[float, float, float], y_sign: int) -> None:
    """Under or beside the work: the tip goes with it, and no attitude has to be given. A base turned over has its
    supports the other way round, so the plate points go the other way round, too."""
    upright = tripod()
    turn = rotation_matrix(np.array(rotation))
    tip = turn @ np.array([0.0, 0.0, -510.0]) + [0.0, 0.0, 800.0]
    base = {"rotation_B0_in_M_rad": rotation, "origin_B0_in_M_mm": (0.0, 0.0, 800.0)}
    plate = tuple(map(tuple, upright.frame.plate_points_M_mm * [1, y_sign, 1]))
    model = built("tripod-cmm.yaml", {"base": base, "tool": {"zero_tip_M_mm": tuple(tip)}}, plate)
    np.testing.assert_allclose(model.zero.link_length_mm, upright.zero.link_length_mm, atol=1e-9)
    np.testing.assert_allclose(model.zero.rotation_M_P, turn, atol=1e-12)


def test_the_tool_on_the_plate_from_a_configuration() -> None:
    configuration = load(CONFIG / "tripod-cmm.yaml")
    geometry = configuration.geometry.model_dump()
    geometry["tool"] = {"on": "plate", "at_M_mm": (0.0, 0.0, 190.0), "zero_tip_P_mm": (0.0, 0.0, -60.0)}
    model = build_model(Geometry.model_validate(geometry), configuration.wiring)
    assert isinstance(model.arrangement, ToolOnPlate)
    np.testing.assert_array_equal(model.zero.contact.tip_M_mm, [0.0, 0.0, 190.0])
    np.testing.assert_allclose(model.zero.link_length_mm, tripod().zero.link_length_mm, atol=1e-9)


def test_nobody_changes_a_model() -> None:
    model = tripod()
    with pytest.raises(FrozenInstanceError):
        model.weight_N = 0.0  # type: ignore[misc]
    arrays = [*model.frame, model.platform_joints_P_mm, model.revolute_axes_P, model.joint_weights]
    arrays += [part for part in model.zero if isinstance(part, np.ndarray)]
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"zero_contact": Contact(np.array([0, 0, np.nan]), np.zeros(3))}, "NOT_FINITE"),
        ({"zero_contact": Contact(np.array([0, 0, 640.0]), np.array([0, 0, -60.0]))}, "links at machine zero: NEAR_SI"),
        ({"plate_points_M_mm": np.array([[-300.0, 175, 700], [0, -350, 700], [300, 175, 700]])}, "frame at machine z"),
        ({"support_of_joint": [0, 1, 3]}, "names a support that is not there"),
        ({"support_of_joint": [-1, 1, 2]}, "names a support that is not there"),
    ],
)
def test_a_machine_zero_that_cannot_be(changes: dict[str, object], match: str) -> None:
    with pytest.raises(KinematicsError, match=match):
        machine_model(MachineParts(**{**tripod_parts(), **changes}))


def test_a_hexapod_zeroed_in_its_singular_pose_is_refused() -> None:
    with pytest.raises(KinematicsError, match="NEAR_SINGULAR"):
        machine_model(MachineParts(**{**hexapod_parts(), "zero_rotation_M_P": rotation("z", 90)}))


@pytest.mark.parametrize("key", ["supports_M_mm", "plate_points_M_mm", "platform_joints_P_mm", "joint_weights"])
def test_wrong_shapes_are_refused(key: str) -> None:
    with pytest.raises(ValueError, match=key):
        machine_model(MachineParts(**{**tripod_parts(), key: np.ones((2, 3))}))
