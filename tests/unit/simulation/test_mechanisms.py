"""The simulated truth of every kind of machine: the worked cases, and gauges that lead back to the tip."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from compd.operation_settings import Wiring
from compd.rotation import rotation_matrix, rotation_vector
from compd.simulation.causes.catalogue import CAUSES
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.workspace import posture_at_scales
from compd.simulation.truth.world import World
from tests.support.model_machines import worked_cases
from tests.unit.model.test_machines import KINDS, geometry_of

TOLERANCE_MM = 1e-9


@cache
def mechanism(kind: str) -> Mechanism:
    return Mechanism(geometry_of(worked_cases("machines")[kind]))


@pytest.mark.parametrize("kind", KINDS)
def test_the_truth_meets_the_worked_cases(kind: str) -> None:
    data, truth = worked_cases("machines")[kind], mechanism(kind)
    radius = np.array([actuator.get("radius_mm", 1.0) for actuator in data["actuators"]])
    zero_mm = np.array(data["home"]["actuators"]) * radius
    assert truth.posture0[0] == pytest.approx(data["home"]["origin_mm"], abs=TOLERANCE_MM)
    for case in data["cases"]:
        scale_mm = np.array(case["actuators"]) * radius - zero_mm
        posture = posture_at_scales(truth, scale_mm)
        assert posture[0] == pytest.approx(case["origin_mm"], abs=TOLERANCE_MM)
        assert pytest.approx(rotation_matrix(np.array(case["rotation_vector_rad"])), abs=1e-10) == posture[1:].T
        assert truth.scales_at(posture) == pytest.approx(scale_mm, abs=TOLERANCE_MM)
        turn = rotation_vector(posture[1:].T @ truth.posture0[1:])
        reached = truth.posture_at(np.array(case["tip_mm"]), turn)
        assert truth.scales_at(reached) == pytest.approx(scale_mm, abs=1e-7)


@pytest.mark.parametrize("kind", KINDS)
def test_a_machine_whose_frame_turns_turns_as_a_whole(kind: str) -> None:
    geometry = geometry_of(worked_cases("machines")[kind])
    links = int(geometry.links)
    ring = [(0.0, 300.0, 0.0), (-150 * 3**0.5, -150.0, 0.0), (150 * 3**0.5, -150.0, 0.0)]
    base = geometry.base.model_copy(
        update={"supports_B_mm": tuple(ring), "support_of_joint": (1, 2, 3, 1, 2, 3)[:links]}
    )
    plate = ((400.0, 0.0, 0.0), (-200.0, 340.0, 0.0), (-200.0, -340.0, 0.0))
    truth = Mechanism(geometry.model_copy(update={"base": base, "plate_points_M_mm": plate}))
    turn, shift_mm = rotation_matrix(np.array([2e-4, -3e-4, 1e-4])), np.array([0.02, -0.01, 0.03])
    supports_M = truth.supports0_M @ turn.T + shift_mm
    scale_mm = 5.0 * np.random.default_rng(2).uniform(-1, 1, truth.scales)
    still = posture_at_scales(truth, scale_mm)
    posture = truth.closure.with_base_turned(truth.base_turn(supports_M)).by_lengths(
        truth.base_joints_M(supports_M, 0.0, scale_mm), truth.joints_P, truth.lengths_at(scale_mm), still
    )
    assert posture[0] == pytest.approx(turn @ still[0] + shift_mm, abs=TOLERANCE_MM)
    assert posture[1:] == pytest.approx(still[1:] @ turn.T, abs=1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_every_cause_that_applies_can_act(kind: str) -> None:
    geometry = geometry_of(worked_cases("machines")[kind])
    wiring = Wiring(scale=(), joint=(), frame=())
    for cause in CAUSES.values():
        if not cause.applies_to(mechanism(kind)):
            continue
        hidden = cause(cause.max_strength, mechanism(kind), np.random.default_rng(3))
        world = World(geometry, wiring, 1, causes=(hidden,))
        world.force_M_N = np.array([5.0, 0.0, -20.0])
        world.start_tour()
        world.advance(30.0)
        assert world.mode == "tour"
        assert np.isfinite(world.reference_tip_mm()).all()
        assert not [name for name in world.names if name.startswith("frame_")]
