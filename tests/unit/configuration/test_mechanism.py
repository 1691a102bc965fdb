"""Mistakes in the actuators, rods and hinges of a configuration are told with their place."""

from __future__ import annotations

from typing import Any

import pytest

from compd.configuration import Geometry
from compd.configuration.geometry_checks import contradictions

RADIUS_MM, PLATFORM_MM = 200.0, 60.0


def delta() -> dict[str, Any]:
    """A linear delta: three slides, each with two parallel rods."""
    rods = []
    for actuator, (x, y) in enumerate([(0.0, 1.0), (-0.866, -0.5), (0.866, -0.5)], start=1):
        for side in (-20.0, 20.0):
            across = (-y * side, x * side)
            base = [RADIUS_MM * x + across[0], RADIUS_MM * y + across[1], 400.0]
            platform = [PLATFORM_MM * x + across[0], PLATFORM_MM * y + across[1], 0.0]
            rods.append({"actuator": actuator, "base_B_mm": base, "platform_P_mm": platform, "length_mm": 300.0})
    return {
        "actuators": [{"kind": "slides", "along_B": [0, 0, 1]}] * 3,
        "rods": rods,
        "target_fixes": ["x", "y", "z"],
        "platform": {"weight_N": 5.0},
        "tool": {"on": "platform", "at_P_mm": [0, 0, -30], "zero_tip_M_mm": [0, 0, 105]},
    }


def found(data: dict[str, Any]) -> list[tuple[Any, str]]:
    return [(problem.location, problem.what) for problem in contradictions(Geometry.model_validate(data))]


def test_a_delta_has_six_links_and_three_scales() -> None:
    geometry = Geometry.model_validate(delta())
    assert (geometry.links, geometry.scales) == (6, 3)
    assert contradictions(geometry) == []


@pytest.mark.parametrize(
    ("change", "location", "words"),
    [
        ({"kinematics": "tripod_3spr"}, ("rods",), "a second time"),
        ({"target_fixes": ["x", "y"]}, ("target_fixes",), "2 coordinates for 3 actuators"),
        ({"target_fixes": ["x", "x", "z"]}, ("target_fixes",), "2 coordinates for 3 actuators"),
        ({"hinges": [{"rod": 1, "axis_P": [1, 0, 0]}]}, ("rods",), "leave -1 degrees of freedom"),
        ({"rods": []}, (), "does not state how the links are built"),
        ({"plate_points_M_mm": [[0, 1, 0], [1, 0, 0], [-1, 0, 0]]}, ("base", "supports_B_mm"), "is missing"),
    ],
)
def test_each_contradiction_is_told_at_its_key(change: dict[str, Any], location: Any, words: str) -> None:
    problems = [what for where, what in found(delta() | change) if where == location]
    assert any(words in what for what in problems), found(delta() | change)


def test_rods_that_repeat_or_have_no_actuator() -> None:
    data = delta()
    data["rods"][1] = dict(data["rods"][0])
    data["rods"][2] = {**data["rods"][2], "actuator": 4}
    data["rods"][3] = {**data["rods"][3], "length_mm": 0.0}
    problems = dict(found(data))
    assert problems[("rods", 1)] == "repeats rod 1"
    assert problems[("rods", 2, "actuator")] == "is not there"
    assert problems[("rods", 3)] == "has no length"


def test_a_hinge_has_one_axis() -> None:
    data = delta()
    data["rods"] = data["rods"][:5]
    for hinge in ({"rod": 1}, {"rod": 1, "axis_P": [1, 0, 0], "axis_B": [1, 0, 0]}):
        assert (("hinges", 0), "needs one axis: axis_P, fixed to the platform, or axis_B, fixed to the base") in found(
            data | {"hinges": [hinge]}
        )
