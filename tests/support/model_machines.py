"""Machines for the tests of the physics, from the dimensions in their drawings, and rigid moves of the whole world."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from compd.model import MachineModel, MachineParts, machine_model
from compd.model.kinematics import (
    Actuators,
    Contact,
    Mechanism,
    Pose,
    ToolOnPlate,
    ToolOnPlatform,
    inverse_kinematics,
)
from tests.support.paths import VECTORS

Floats = NDArray[np.float64]

# S on the base joint counts once, the two shanks of the revolute joint half each; three comparators a link.
TRIPOD_WEIGHTS = np.kron(np.eye(3), [1.0, 0.5, 0.5])


def worked_cases(name: str) -> dict[str, Any]:
    """The worked cases of a machine, or a skipped test where they are not at hand."""
    file = VECTORS / f"{name}.json"
    if not file.exists():
        pytest.skip(f"no worked cases: {file} is not there")
    found: dict[str, Any] = json.loads(file.read_text())
    return found


def column(cases: list[dict[str, Any]], key: str) -> Floats:
    """One entry of every case, stacked."""
    return np.array([case[key] for case in cases], dtype=float)


def ring(radius_mm: float, *degrees: float, z_mm: float = 0.0) -> Floats:
    """Points on a circle about z."""
    angle = np.deg2rad(degrees)
    return np.stack([radius_mm * np.cos(angle), radius_mm * np.sin(angle), np.full(len(degrees), z_mm)], -1)


def rotation(axis: str, degrees: float) -> Floats:
    """Rotation about one axis."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    i = "xyz".index(axis)
    R = np.eye(3)
    j, k = (i + 1) % 3, (i + 2) % 3
    R[j, j], R[j, k], R[k, j], R[k, k] = c, -s, s, c
    return R


def inverse_pose(
    model: MachineModel, mechanism: Mechanism, tip_M_mm: Floats, tip_P_mm: Floats, rotation_M_P: Floats
) -> Pose:
    """The pose at a contact, from the actuators of machine zero."""
    return inverse_kinematics(mechanism, model.actuators, tip_M_mm, tip_P_mm, rotation_M_P, model.zero.actuator_mm).pose


def extending(links: int) -> dict[str, Any]:
    """Parts of a machine whose actuators extend one link each: three with hinges on the platform, or six."""
    hinges = 6 - links
    return {
        "hinges": np.array([[i, 0] for i in range(hinges)], dtype=np.int64).reshape(-1, 2),
        "actuators": Actuators(
            np.zeros(links, dtype=np.int64),
            np.tile([1.0, 0.0, 0.0], (links, 1)),
            np.tile([0.0, 1.0, 0.0], (links, 1)),
            np.ones(links),
            np.arange(links),
            np.zeros(links),
            np.array([1, 1, 1] + 3 * [int(links == 6)]),
        ),
        "actuator_guess_mm": np.ones(links),
    }


def tripod_parts() -> dict[str, Any]:
    """The tripod's parts at machine zero, as `machine_model` takes them."""
    tool = np.array([0.0, 0.0, -60.0])
    axes = np.array([(-np.sin(a), np.cos(a), 0.0) for a in np.deg2rad([90.0, 210.0, 330.0])])
    supports = ring(250, 90, 210, 330, z_mm=700)
    return {
        "supports_M_mm": supports,
        "rotation_M_B": np.eye(3),
        "plate_points_M_mm": ring(350, 150, 270, 30),
        "base_joints_M_mm": supports,
        "support_of_joint": [0, 1, 2],
        "platform_joints_P_mm": ring(80, 90, 210, 330),
        "revolute_axes_P": axes,
        "arrangement": ToolOnPlatform(tool),
        "zero_contact": Contact(np.array([0.0, 0.0, 190.0]), tool),
        "zero_rotation_M_P": None,
        "joint_weights": TRIPOD_WEIGHTS,
        **extending(3),
        "weight_N": 80.0,
        "weight_at_P_mm": np.zeros(3),
    }


def hexapod_parts() -> dict[str, Any]:
    """The hexapod's parts: pairs of joints 16 degrees apart on the base, 96 degrees apart on the platform."""
    tool = np.array([0.0, 0.0, -80.0])
    return {
        "supports_M_mm": ring(300, 90, 210, 330, z_mm=900),
        "rotation_M_B": np.eye(3),
        "plate_points_M_mm": ring(420, 150, 270, 30),
        "base_joints_M_mm": ring(300, 82, 98, 202, 218, 322, 338, z_mm=900),
        "support_of_joint": [0, 0, 1, 1, 2, 2],
        "platform_joints_P_mm": ring(120, 42, 138, 162, 258, 282, 18),
        "revolute_axes_P": np.empty((0, 3)),
        "arrangement": ToolOnPlatform(tool),
        "zero_contact": Contact(np.array([0.0, 0.0, 320.0]), tool),
        "zero_rotation_M_P": np.eye(3),
        "joint_weights": np.kron(np.eye(6), [1.0, 1.0]),
        **extending(6),
        "weight_N": 120.0,
        "weight_at_P_mm": np.zeros(3),
    }


def tripod() -> MachineModel:
    """The coordinate measuring machine on three links."""
    return machine_model(MachineParts(**tripod_parts()))


def hexapod() -> MachineModel:
    """The machine with six extending struts."""
    return machine_model(MachineParts(**hexapod_parts()))


def move_machine(parts: dict[str, Any], R: Floats, shift_mm: Floats) -> dict[str, Any]:
    """The same machine with the whole world turned and shifted: base under the work, or beside it."""
    contact = parts["zero_contact"]
    attitude = parts["zero_rotation_M_P"]
    tool = parts["arrangement"]
    if isinstance(tool, ToolOnPlate):
        tool = ToolOnPlate(tool.tool_M_mm @ R.T + shift_mm)
    return {
        **parts,
        **{key: parts[key] @ R.T + shift_mm for key in ("supports_M_mm", "plate_points_M_mm", "base_joints_M_mm")},
        "arrangement": tool,
        "zero_contact": Contact(contact.tip_M_mm @ R.T + shift_mm, contact.tip_P_mm),
        "zero_rotation_M_P": None if attitude is None else R @ attitude,
    }


def tips(model: MachineModel, rows: int, seed: int, reach_mm: float = 80.0) -> Floats:
    """Places of the tip around machine zero, in {M}."""
    rng = np.random.default_rng(seed)
    return model.zero.contact.tip_M_mm + rng.uniform(-reach_mm, reach_mm, (rows, 3))
