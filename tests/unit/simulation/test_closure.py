"""The truth's own closure against the worked cases, and against itself."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from compd.arrays import FloatArray
from compd.configuration import Geometry
from compd.errors import KinematicsError
from compd.simulation.truth.closure import homogeneous
from compd.simulation.truth.closure_kernels import CLOSED_MM
from compd.simulation.truth.frame import distances_mm
from compd.simulation.truth.mechanism import Mechanism
from tests.support.paths import VECTORS
from tests.support.simulated import hexapod, tripod


def vectors(machine: str) -> dict[str, Any]:
    path = VECTORS / f"{machine}.json"
    if not path.exists():
        pytest.skip(f"the worked cases are not beside the checkout: {path}")
    return dict(json.loads(path.read_text()))


@pytest.fixture(params=[tripod, hexapod])
def mechanism(request: pytest.FixtureRequest) -> Mechanism:
    return Mechanism(request.param())


def supports_from_distances(machine: Mechanism, change_mm: FloatArray) -> FloatArray:
    """Where the supports are when the nine distances have changed so; t1..t3, u1..u6."""
    wanted = distances_mm(machine.supports0_M, machine.plate0_M) + change_mm

    def error(coordinates: FloatArray) -> FloatArray:
        return distances_mm(coordinates.reshape(3, 3), machine.plate0_M) - wanted

    solution = least_squares(error, machine.supports0_M.ravel(), xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    assert np.abs(error(solution)).max() < 1e-9
    return np.asarray(solution.reshape(3, 3))


def test_tripod_at_the_worked_places() -> None:
    machine = Mechanism(tripod())
    for case in vectors("tripod")["kinematics"]:
        posture = machine.closure.by_lengths(
            machine.joints0_M, machine.joints_P, np.array(case["lengths"]), machine.posture0
        )
        assert posture[0] == pytest.approx(case["platform_origin_M"], abs=1e-9)
        np.testing.assert_allclose(posture[1:].T, case["rotation_M_P"], atol=2e-12)
        by_tip = machine.posture_at(np.array(case["tip_M"]), np.zeros(3))
        np.testing.assert_allclose(by_tip, posture, atol=1e-9)


def test_tripod_with_displaced_joints_and_frame_follows_the_signs_of_equation_1() -> None:
    machine = Mechanism(tripod())
    for case in vectors("tripod")["cmm_mode"]:
        supports_M = supports_from_distances(machine, np.array(case["dt_mm"] + case["du_mm"]))
        base_along_mm = -np.array(case["joint_mm"][0::3])  # S reads short as its ball comes the link's way
        platform_along_mm = (np.array(case["joint_mm"][1::3]) + np.array(case["joint_mm"][2::3])) / 2
        posture = machine.closure.by_lengths(
            machine.base_joints_M(supports_M),
            machine.joints_P,
            machine.lengths0_mm + np.array(case["scale_mm"]) + base_along_mm - platform_along_mm,
            machine.posture0,
        )
        assert homogeneous(machine.tip0_P) @ posture == pytest.approx(case["tip_M"], abs=1e-6)


def test_hexapod_with_displaced_frame() -> None:
    machine = Mechanism(hexapod())
    for case in vectors("hexapod")["poses"]:
        supports_M = supports_from_distances(machine, np.array(case["dt_mm"] + case["du_mm"]))
        base_M = machine.base_joints_M(supports_M)
        np.testing.assert_allclose(base_M, case["base_joints_M"], atol=1e-6)
        posture = machine.closure.by_lengths(
            base_M, machine.joints_P, machine.lengths0_mm + np.array(case["scale_mm"]), machine.posture0
        )
        assert homogeneous(machine.tip0_P) @ posture == pytest.approx(case["tip_M"], abs=1e-6)


def test_forces_of_the_worked_cases() -> None:
    machine = Mechanism(tripod())
    for case in vectors("tripod")["statics"]:
        posture = machine.posture_at(np.array(case["tip_M"]), np.zeros(3))
        axial_N, _ = machine.closure.forces(
            posture,
            machine.joints0_M,
            machine.joints_P,
            [(machine.weight_M, machine.weight_at_P), (np.array(case["force_on_tip_M_N"]), machine.tip0_P)],
        )
        assert axial_N == pytest.approx(case["axial_force_N"], abs=1e-9)


def test_forces_carry_the_load(mechanism: Mechanism) -> None:
    load_M = np.array([3.0, -5.0, 11.0])
    posture = mechanism.posture0
    axial_N, lateral_M = mechanism.closure.forces(
        posture, mechanism.joints0_M, mechanism.joints_P, [(load_M, mechanism.tip0_P)]
    )
    links_M = homogeneous(mechanism.joints_P) @ posture - mechanism.joints0_M
    on_base_M = axial_N[:, None] * links_M / np.linalg.norm(links_M, axis=1, keepdims=True) + lateral_M
    tip_M = homogeneous(mechanism.tip0_P) @ posture
    assert on_base_M.sum(axis=0) == pytest.approx(load_M, abs=1e-9)
    assert np.cross(mechanism.joints0_M, on_base_M).sum(axis=0) == pytest.approx(np.cross(tip_M, load_M), abs=1e-6)


def test_closed_to_far_below_a_nanometre(mechanism: Mechanism) -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        lengths_mm = mechanism.lengths0_mm + rng.uniform(-30, 30, mechanism.links)
        posture = mechanism.closure.by_lengths(mechanism.joints0_M, mechanism.joints_P, lengths_mm, mechanism.posture0)
        links_M = homogeneous(mechanism.joints_P) @ posture - mechanism.joints0_M
        assert np.abs(np.linalg.norm(links_M, axis=1) - lengths_mm).max() < 10 * CLOSED_MM
        np.testing.assert_allclose(posture[1:] @ posture[1:].T, np.eye(3), atol=1e-12)
        if len(mechanism.axes_P):
            assert np.abs(((mechanism.axes_P @ posture[1:]) * links_M).sum(axis=1)).max() < 1e-9


@pytest.mark.parametrize("factor", [0.05, 10.0])
def test_links_that_cannot_meet_are_said_so(factor: float) -> None:
    machine = Mechanism(tripod())
    lengths_mm = machine.lengths0_mm * [factor, 1.0, 1.0]
    with pytest.raises(KinematicsError, match="cannot meet"):
        machine.closure.by_lengths(machine.joints0_M, machine.joints_P, lengths_mm, machine.posture0)


@pytest.mark.parametrize("turn_rad", [(np.pi, 0.0, 0.0), (0.0, np.pi / 2, 0.0)])
def test_base_under_or_beside_the_work(turn_rad: tuple[float, float, float]) -> None:
    """Figure 14: the same machine, turned as a whole, has the same lengths and a turned tip."""
    upright = tripod()
    turned = tripod(turn_rad)
    first, second = Mechanism(upright), Mechanism(turned)
    np.testing.assert_allclose(second.lengths0_mm, first.lengths0_mm, atol=1e-9)
    lengths_mm = first.lengths0_mm + np.array([12.0, -7.0, 3.0])
    tips_B0 = []
    for machine in (first, second):
        posture = machine.closure.by_lengths(machine.joints0_M, machine.joints_P, lengths_mm, machine.posture0)
        tip_M = homogeneous(machine.tip0_P) @ posture
        tips_B0.append((tip_M - machine.supports0_M.mean(axis=0)) @ machine.rotation_M_B0)
    np.testing.assert_allclose(tips_B0[1], tips_B0[0], atol=1e-9)


def test_zero_posture_is_the_configured_one(mechanism: Mechanism) -> None:
    geometry: Geometry = mechanism.geometry
    assert geometry.tool.on == "platform"
    assert homogeneous(mechanism.tip0_P) @ mechanism.posture0 == pytest.approx(geometry.tool.zero_tip_M_mm, abs=1e-9)
