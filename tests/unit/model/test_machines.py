"""The eight kinds of machine, from their configuration to forward and inverse kinematics and derivatives.

The worked cases were computed by other code, and are at hand where ../shared is.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from compd.calibration import rows_at
from compd.configuration import Geometry
from compd.machine_builder import build_model
from compd.model import MachineModel, machine_constants, sensitivities
from compd.model.effects import MachineDetails
from compd.model.kinematics import forward_kinematics, inverse_kinematics, links_at
from compd.operation_settings import Wiring
from compd.rotation import rotation_matrix
from tests.support.model_machines import Floats, worked_cases

KINDS = ("6-UPS", "6-PUS", "6-RUS", "3-SPR", "3-RPS", "3-PRS", "linear delta", "rotary delta")
TOLERANCE_MM = 1e-9


def geometry_of(machine: dict[str, Any]) -> Geometry:
    """The machine as a person writes it."""
    rods = [row for row in machine["rows"] if row["kind"] == "rod"]
    ends = [(row["base_joint_mm"], row["platform_joint_mm"]) for row in rods]
    hinges = [
        {
            "rod": 1 + ends.index((row["base_joint_mm"], row["platform_joint_mm"])),
            "axis_B" if "base" in row["kind"] else "axis_P": row["axis"],
        }
        for row in machine["rows"]
        if row["kind"] != "rod"
    ]
    home = machine["home"]
    tip = home["origin_mm"] + rotation_matrix(np.array(home["rotation_vector_rad"])) @ machine["tool_in_platform_mm"]
    return Geometry.model_validate(
        {
            "actuators": [
                _actuator(actuator, at) for actuator, at in zip(machine["actuators"], home["actuators"], strict=True)
            ],
            "rods": [
                {
                    "actuator": row["actuator"],
                    "base_B_mm": row["base_joint_mm"],
                    "platform_P_mm": row["platform_joint_mm"],
                    "length_mm": row.get("length_mm", 0.0),
                }
                for row in rods
            ],
            "hinges": hinges,
            "target_fixes": list(machine["target_fixes"]),
            "platform": {"weight_N": 10.0},
            "tool": {
                "on": "platform",
                "at_P_mm": machine["tool_in_platform_mm"],
                "zero_tip_M_mm": tip.tolist(),
                "zero_rotation_P_in_M_rad": home["rotation_vector_rad"],
            },
        }
    )


def _actuator(actuator: dict[str, Any], at: float) -> dict[str, Any]:
    # the guess of machine zero is a rough one
    if actuator["kind"] == "slides":
        return {"kind": "slides", "along_B": actuator["along"], "zero_mm": round(at, -1)}
    if actuator["kind"] == "turns":
        circle = {"radius_mm": actuator["radius_mm"], "cosine_B": actuator["cosine_direction"]}
        return {"kind": "turns", **circle, "sine_B": actuator["sine_direction"], "zero_rad": round(at, 1)}
    return {"kind": "extends"}


@cache
def built(kind: str) -> MachineModel:
    return build_model(geometry_of(worked_cases("machines")[kind]), Wiring(scale=(), joint=(), frame=()))


def places_mm(model: MachineModel, case: dict[str, Any]) -> Floats:
    return np.asarray(case["actuators"]) * model.actuators.radius_mm


@pytest.mark.parametrize("kind", KINDS)
def test_machine_zero_is_the_home_of_the_worked_cases(kind: str) -> None:
    model, home = built(kind), worked_cases("machines")[kind]["home"]
    np.testing.assert_allclose(model.zero.actuator_mm, places_mm(model, home), atol=TOLERANCE_MM)
    np.testing.assert_allclose(model.zero.platform_origin_M_mm, home["origin_mm"], atol=TOLERANCE_MM)


@pytest.mark.parametrize("kind", KINDS)
def test_forward_inverse_and_derivatives(kind: str) -> None:
    machine, model = worked_cases("machines")[kind], built(kind)
    model = replace(model, constants=machine_constants(model, MachineDetails()))
    zero, tool_P = model.zero, np.array(machine["tool_in_platform_mm"])
    # at actuator 0: zero.base_joints_M_mm are those of machine zero
    base_M = np.array([row["base_joint_mm"] for row in machine["rows"] if row["kind"] == "rod"])
    for case in machine["cases"]:
        at_mm = places_mm(model, case)
        joints_M, lengths = links_at(model.actuators, base_M, at_mm)
        mechanism = model.mechanism(joints_M)
        pose = forward_kinematics(mechanism, lengths, zero.platform_origin_M_mm, zero.rotation_M_P)
        R = rotation_matrix(np.array(case["rotation_vector_rad"]))
        np.testing.assert_allclose(pose.origin_M_mm, case["origin_mm"], atol=TOLERANCE_MM)
        np.testing.assert_allclose(pose.rotation_M_P, R, atol=TOLERANCE_MM / 100)
        fixes_attitude = bool(model.actuators.fixed[3:].any())
        reached = inverse_kinematics(
            model.mechanism(base_M),
            model.actuators,
            case["tip_mm"],
            tool_P,
            R if fixes_attitude else zero.rotation_M_P,
            zero.actuator_mm,
        )
        np.testing.assert_allclose(reached.actuator_mm, at_mm, atol=TOLERANCE_MM)
        tip, rotation, _ = sensitivities(model, rows_at(model, (at_mm - zero.actuator_mm)[None]), ["scale"])["scale"]
        by_mm = np.concatenate([tip[0], rotation[0]])
        np.testing.assert_allclose(by_mm * model.actuators.radius_mm, case["tip_by_actuator"], atol=TOLERANCE_MM)
