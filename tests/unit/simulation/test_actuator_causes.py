"""Rails and cranks that are not quite as drawn: the same as a machine whose drawing has these rails and cranks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.configuration import Configuration, Geometry, load
from compd.errors import CompdError
from compd.machine_kinds import KINDS, machine_text
from compd.simulation.campaign.simulate_campaign import simulate_campaign
from compd.simulation.causes.catalogue import build_cause, possible_causes
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.strengths import NOTHING
from compd.simulation.truth.world import World
from tests.support.simulated import tripod, wiring

UM, URAD = 1e-3, 1e-6
WAY_MM = 20.0
SEED = 4


@pytest.fixture
def machine(tmp_path: Path, kind: str) -> Configuration:
    path = tmp_path / "machine.yaml"
    path.write_text(machine_text("machine", kind, KINDS[kind].usual), encoding="utf-8")
    return load(path)


def tip_after(geometry: Geometry, configuration: Configuration, scale_mm: FloatArray, *causes: Cause) -> FloatArray:
    """The tip (3,) with the scales at these values, of a machine with no other error."""
    world = World(geometry, configuration.wiring, 1, strengths=NOTHING, causes=causes)
    world.advance_to(scale_mm, world.posture, 10.0, 1.0)
    return world.reference_tip_mm()


def redrawn(geometry: Geometry, actuators: list[dict[str, Any]], base_B_mm: list[FloatArray]) -> Geometry:
    data = geometry.model_dump(by_alias=True, exclude_unset=True)
    data["actuators"] = actuators
    for rod, place in zip(data["rods"], base_B_mm, strict=True):
        rod["base_B_mm"] = tuple(place.tolist())
    return Geometry.model_validate(data)


def ways_mm(count: int) -> FloatArray:
    return WAY_MM * np.random.default_rng(SEED).uniform(-1, 1, count)


@pytest.mark.parametrize("kind", ["6-rus", "rotary-delta"])
def test_a_crank_radius_is_that_of_another_drawing(machine: Configuration) -> None:
    geometry = machine.geometry
    mechanism = Mechanism(geometry)
    cause = build_cause("crank_radius", 80.0, mechanism, SEED)
    grown_mm = UM * cause.part_strengths
    scale_mm, parts = ways_mm(mechanism.scales), geometry.mechanism
    actuators = [
        {**actuator.model_dump(), "radius_mm": actuator.radius_mm + grown}
        for actuator, grown in zip(parts.actuators, grown_mm, strict=True)
    ]
    radii_mm = np.array([actuator.radius_mm for actuator in parts.actuators])
    # the joint is where it was at machine zero, so that the circle's middle is elsewhere
    base_B_mm = []
    for rod, joint_M in zip(parts.rods, mechanism.joints0_M, strict=True):
        arm_B = (mechanism.rotation_M_B0.T @ joint_M - np.array(rod.base_B_mm)) / radii_mm[rod.actuator - 1]
        base_B_mm.append(np.array(rod.base_B_mm) - grown_mm[rod.actuator - 1] * arm_B)
    other = redrawn(geometry, actuators, base_B_mm)
    expected = tip_after(other, machine, scale_mm * (1 + grown_mm / radii_mm))
    seen = tip_after(geometry, machine, scale_mm, cause)
    assert np.abs(seen - tip_after(geometry, machine, scale_mm)).max() > 1 * UM
    assert seen == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("kind", ["6-pus", "3-prs", "linear-delta"])
def test_the_direction_of_a_rail_is_that_of_another_drawing(machine: Configuration) -> None:
    geometry = machine.geometry
    mechanism = Mechanism(geometry)
    cause = build_cause("rail_direction", 500.0, mechanism, SEED)
    scale_mm, parts = ways_mm(mechanism.scales), geometry.mechanism
    along_B = np.array([actuator.along_B for actuator in parts.actuators])
    turned_B = along_B + np.cross(URAD * cause.part_strengths, along_B)
    stretched = np.linalg.norm(turned_B, axis=1)
    turned_B /= stretched[:, None]
    actuators = [
        {**actuator.model_dump(), "along_B": tuple(along.tolist())}
        for actuator, along in zip(parts.actuators, turned_B, strict=True)
    ]
    base_B_mm = []
    for rod, joint_M in zip(parts.rods, mechanism.joints0_M, strict=True):
        way_mm = (joint_M - np.array(rod.base_B_mm)) @ along_B[rod.actuator - 1]
        base_B_mm.append(joint_M - way_mm * turned_B[rod.actuator - 1])
    expected = tip_after(redrawn(geometry, actuators, base_B_mm), machine, scale_mm * stretched)
    seen = tip_after(geometry, machine, scale_mm, cause)
    assert np.abs(seen - tip_after(geometry, machine, scale_mm)).max() > 1 * UM
    assert seen == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("kind", KINDS)
def test_a_machine_has_the_causes_of_its_own_parts_alone(machine: Configuration, kind: str) -> None:
    possible = possible_causes(Mechanism(machine.geometry), machine.wiring)
    assert ("rail_direction" in possible) == (KINDS[kind].actuator == "slides")
    assert ("crank_radius" in possible) == (KINDS[kind].actuator == "turns")
    assert not [name for name in possible if "comparator" in name]


def test_a_machine_with_joint_comparators_has_their_causes() -> None:
    possible = possible_causes(Mechanism(tripod()), wiring())
    assert {"joint_comparator_gain", "joint_comparator_drift"} <= set(possible)
    assert not {"rail_direction", "crank_radius"} & set(possible)


@pytest.mark.parametrize("kind", ["3-spr"])
def test_a_campaign_keeps_the_configuration_of_its_machine(tmp_path: Path, machine: Configuration) -> None:
    path = tmp_path / "machine.yaml"
    before = path.read_bytes()
    with pytest.raises(CompdError, match="would replace the machine's configuration"):
        simulate_campaign(path, tmp_path / "machine.csv", overwrite=True)
    assert path.read_bytes() == before
