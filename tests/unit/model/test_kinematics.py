"""Forward and inverse kinematics of tripod and hexapod: closing, round trips, derivatives, failures."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import fsolve

from compd.model.kernels.solve_status import AMPLIFICATION_LIMIT, Reason, require
from compd.model.kinematics.frame import solve_frame
from compd.model.kinematics.link_kinematics import Mechanism, Pose, closure_at, forward_kinematics
from compd.model.machine import MachineModel, MachineParts, machine_model
from compd.rotation import rotation_matrix, rotation_vector
from tests.support.model_machines import (
    Floats,
    hexapod,
    hexapod_parts,
    inverse_pose,
    move_machine,
    rotation,
    tips,
    tripod,
    tripod_parts,
)

TRIPOD, HEXAPOD = tripod(), hexapod()
TURNS = [rotation("x", 180), rotation("x", 90), rotation("y", -60) @ rotation("z", 25)]


def at_zero(model: MachineModel) -> Mechanism:
    return model.mechanism(model.zero.base_joints_M_mm)


def forward(model: MachineModel, lengths: Floats, mechanism: Mechanism | None = None) -> Pose:
    """From machine zero."""
    zero = model.zero
    return forward_kinematics(mechanism or at_zero(model), lengths, zero.platform_origin_M_mm, zero.rotation_M_P)


def inverse(model: MachineModel, tip_M_mm: Floats, attitude: Floats | None = None) -> Pose:
    attitude = model.zero.rotation_M_P if attitude is None else attitude
    return inverse_pose(model, at_zero(model), tip_M_mm, model.zero.contact.tip_P_mm, attitude)


def link_vectors(mechanism: Mechanism, pose: Pose) -> Floats:
    """d_i = p + R c_i - a_i, spelt out with NumPy."""
    joints = np.einsum("...ij,...kj->...ki", pose.rotation_M_P, mechanism.platform_joints_P_mm)
    return pose.origin_M_mm[..., None, :] + joints - mechanism.base_joints_M_mm


def test_the_tripod_closes() -> None:
    pose = inverse(TRIPOD, tips(TRIPOD, 200, 1))
    require(pose.reason, "pose")
    links = link_vectors(at_zero(TRIPOD), pose)
    axes = np.einsum("nij,kj->nki", pose.rotation_M_P, TRIPOD.revolute_axes_P)
    np.testing.assert_allclose(np.linalg.norm(links, axis=-1), pose.link_length_mm, rtol=1e-14)
    np.testing.assert_allclose(np.einsum("nki,nki->nk", links, axes), 0, atol=1e-9)
    turned_back = np.einsum("nji,njk->nik", pose.rotation_M_P, pose.rotation_M_P)
    np.testing.assert_allclose(turned_back, np.tile(np.eye(3), (200, 1, 1)), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(pose.rotation_M_P), 1, atol=1e-14)


def test_tripod_against_an_independent_solver() -> None:
    """scipy finds the same pose from the same closure, written with a rotation vector."""
    tip = np.array([40.0, -55.0, 170.0])
    mechanism, tool = at_zero(TRIPOD), TRIPOD.zero.contact.tip_P_mm

    def unsquareness(vector_rad: Floats) -> Floats:
        R = rotation_matrix(vector_rad)
        d = tip + (mechanism.platform_joints_P_mm - tool) @ R.T - mechanism.base_joints_M_mm
        return np.asarray((d * (mechanism.revolute_axes @ R.T)).sum(-1))

    solution = fsolve(unsquareness, np.zeros(3), xtol=1e-13)
    np.testing.assert_allclose(rotation_vector(inverse(TRIPOD, tip).rotation_M_P), solution, atol=1e-11)


@settings(max_examples=60)
@given(st.tuples(*[st.floats(-100, 100)] * 3))
def test_tripod_round_trip(offset_mm: tuple[float, float, float]) -> None:
    tip = TRIPOD.zero.contact.tip_M_mm + offset_mm
    there = inverse(TRIPOD, tip)
    back = forward(TRIPOD, there.link_length_mm)
    assert (there.reason, back.reason) == (Reason.OK, Reason.OK)
    np.testing.assert_allclose(back.origin_M_mm, there.origin_M_mm, rtol=0, atol=1e-9)
    np.testing.assert_allclose(back.rotation_M_P, there.rotation_M_P, rtol=0, atol=1e-12)


@settings(max_examples=60)
@given(st.tuples(*[st.floats(-80, 80)] * 3), st.tuples(*[st.floats(-0.25, 0.25)] * 3))
def test_hexapod_round_trip(offset_mm: tuple[float, float, float], attitude: tuple[float, float, float]) -> None:
    R = rotation_matrix(np.array(attitude))
    there = inverse(HEXAPOD, HEXAPOD.zero.contact.tip_M_mm + offset_mm, R)
    back = forward(HEXAPOD, there.link_length_mm)
    assert (there.reason, back.reason) == (Reason.OK, Reason.OK)
    np.testing.assert_allclose(there.link_length_mm, np.linalg.norm(link_vectors(at_zero(HEXAPOD), there), axis=-1))
    np.testing.assert_allclose(back.origin_M_mm, there.origin_M_mm, rtol=0, atol=1e-9)
    np.testing.assert_allclose(back.rotation_M_P, R, rtol=0, atol=1e-12)


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD])
def test_rows_alone_are_as_all_together(model: MachineModel) -> None:
    """Bit for bit, with geometry that differs from row to row as well."""
    tip = tips(model, 30, 2)
    bases = model.zero.base_joints_M_mm + np.random.default_rng(3).normal(0, 0.1, (30, model.links, 3))
    tool, zero = model.zero.contact.tip_P_mm, model.zero
    there = inverse_pose(model, model.mechanism(bases), tip, tool, zero.rotation_M_P)
    back = forward(model, there.link_length_mm, model.mechanism(bases))
    require(np.maximum(there.reason, back.reason), "pose")
    for i in range(30):
        one = inverse_pose(model, model.mechanism(bases[i]), tip[i], tool, zero.rotation_M_P)
        assert all(a.tobytes() == b[i].tobytes() for a, b in zip(one, there, strict=True))
        one = forward(model, there.link_length_mm[i], model.mechanism(bases[i]))
        assert all(a.tobytes() == b[i].tobytes() for a, b in zip(one, back, strict=True))


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("parts", [tripod_parts(), hexapod_parts()], ids=["tripod", "hexapod"])
def test_a_turned_world_changes_no_length(parts: dict[str, object], turn: Floats) -> None:
    shift = np.array([-300.0, 20.0, 150.0])
    here, there = machine_model(MachineParts(**parts)), machine_model(MachineParts(**move_machine(parts, turn, shift)))  # type: ignore[arg-type]
    tip = tips(here, 50, 4)
    upright = inverse(here, tip)
    turned = inverse(there, tip @ turn.T + shift)
    require(turned.reason, "turned")
    np.testing.assert_allclose(turned.link_length_mm, upright.link_length_mm, rtol=0, atol=1e-9)
    np.testing.assert_allclose(turned.rotation_M_P, turn @ upright.rotation_M_P, rtol=0, atol=1e-12)
    back = forward(there, upright.link_length_mm)
    np.testing.assert_allclose(back.origin_M_mm, upright.origin_M_mm @ turn.T + shift, rtol=0, atol=1e-9)


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD])
def test_derivatives_against_differences(model: MachineModel) -> None:
    pose = inverse(model, tips(model, 1, 5)[0])
    mechanism, h = at_zero(model), 1e-4
    here = closure_at(mechanism, pose.origin_M_mm, pose.rotation_M_P)
    np.testing.assert_allclose(here.length_mm, pose.link_length_mm, rtol=1e-14)
    np.testing.assert_allclose(here.offset_mm, 0, atol=1e-9)
    for axis in range(3):
        step = h * np.eye(3)[axis]
        ends = [closure_at(mechanism, pose.origin_M_mm + s * step, pose.rotation_M_P) for s in (1, -1)]
        slope = [(a - b) / (2 * h) for a, b in zip(*((e.length_mm, e.offset_mm) for e in ends), strict=True)]
        np.testing.assert_allclose(here.length_by_displacement[:, axis], slope[0], atol=1e-7)
        np.testing.assert_allclose(here.offset_by_displacement[:, axis], slope[1], atol=1e-7)
        step = 1e-6 * np.eye(3)[axis]
        ends = [closure_at(mechanism, pose.origin_M_mm, rotation_matrix(s * step) @ pose.rotation_M_P) for s in (1, -1)]
        slope = [(a - b) / 2e-6 for a, b in zip(*((e.length_mm, e.offset_mm) for e in ends), strict=True)]
        np.testing.assert_allclose(here.length_by_rotation_mm[:, axis], slope[0], atol=1e-5)
        np.testing.assert_allclose(here.offset_by_rotation_mm[:, axis], slope[1], atol=1e-5)


def test_forward_with_the_base_joints_as_the_frame_has_them_now() -> None:
    """A frame that moves as a whole takes the tip along: (9) in {M}."""
    R, shift = rotation_matrix(np.array([1e-4, 2e-4, -1e-4])), np.array([0.03, -0.01, 0.02])
    pivot = TRIPOD.frame.zero_origin_M_mm
    supports = (TRIPOD.frame.zero_supports_M_mm - pivot) @ R.T + pivot + shift
    lengths = [np.linalg.norm(supports[i] - supports[(i + 1) % 3]) for i in range(3)]
    m = TRIPOD.frame.plate_points_M_mm
    lengths += [np.linalg.norm(supports[k // 2] - m[j]) for k, j in enumerate((0, 2, 0, 1, 1, 2))]
    frame = solve_frame(TRIPOD.frame, np.array(lengths))
    before = forward(TRIPOD, TRIPOD.zero.link_length_mm)
    after = forward(TRIPOD, TRIPOD.zero.link_length_mm, TRIPOD.mechanism(frame.base_joints_M_mm))
    np.testing.assert_allclose(after.origin_M_mm, (before.origin_M_mm - pivot) @ R.T + pivot + shift, atol=1e-9)
    np.testing.assert_allclose(after.rotation_M_P, R @ before.rotation_M_P, atol=1e-12)


def lengths_with(model: MachineModel, index: int, value: float) -> Floats:
    lengths = model.zero.link_length_mm.copy()
    lengths[index] = value
    return lengths


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD])
@pytest.mark.parametrize(
    ("value", "reasons"),
    [
        (np.nan, {Reason.NOT_FINITE}),
        (np.inf, {Reason.NOT_FINITE}),
        (1e200, {Reason.NOT_FINITE}),
        (0.0, {Reason.UNREACHABLE}),
        (-500.0, {Reason.UNREACHABLE}),
        (3000.0, {Reason.UNREACHABLE}),
        (1.0, {Reason.UNREACHABLE, Reason.NO_CONVERGENCE, Reason.NEAR_SINGULAR, Reason.OTHER_ASSEMBLY}),
    ],
)
def test_lengths_that_cannot_be(model: MachineModel, value: float, reasons: set[Reason]) -> None:
    pose = forward(model, lengths_with(model, 1, value))
    assert Reason(int(pose.reason)) in reasons
    assert np.isnan(pose.origin_M_mm).all()
    assert np.isnan(pose.rotation_M_P).all()
    assert np.isnan(pose.link_length_mm).all()


@pytest.mark.parametrize("model", [TRIPOD, HEXAPOD])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_not_finite_anywhere(model: MachineModel, bad: float) -> None:
    tip = model.zero.contact.tip_M_mm.copy()
    tip[1] = bad
    assert inverse(model, tip).reason == Reason.NOT_FINITE
    bases = model.zero.base_joints_M_mm.copy()
    bases[2, 0] = bad
    assert forward(model, model.zero.link_length_mm, model.mechanism(bases)).reason == Reason.NOT_FINITE
    attitude = model.zero.rotation_M_P.copy()
    attitude[0, 0] = bad
    pose = inverse(model, model.zero.contact.tip_M_mm, attitude)
    assert pose.reason == Reason.NOT_FINITE
    assert np.isnan(pose.link_length_mm).all()


def test_links_all_far_too_long_or_short_are_no_pose() -> None:
    """Nothing near: shorter than base and platform are apart, sideways."""
    for model in (TRIPOD, HEXAPOD):
        assert forward(model, np.full(model.links, 20.0)).reason == Reason.UNREACHABLE


def test_a_hexapod_turned_a_right_angle_is_singular() -> None:
    tip = HEXAPOD.zero.contact.tip_M_mm
    reasons = [int(inverse(HEXAPOD, tip, rotation("z", angle)).reason) for angle in (0.0, 60.0, 89.5, 90.0, -90.0)]
    assert reasons == [Reason.OK, Reason.OK, *[Reason.NEAR_SINGULAR] * 3]
    assert np.isnan(inverse(HEXAPOD, tip, rotation("z", 90.0)).link_length_mm).all()


def test_amplification_is_pose_error_over_length_error() -> None:
    """The limit is met where length errors of 1 nm, drawn at random, move the pose by the limit times 1 nm."""
    tip, rng = HEXAPOD.zero.contact.tip_M_mm, np.random.default_rng(6)
    radius_mm = 120.0
    for angle, inside in ((88.0, True), (89.5, False)):
        attitude = rotation("z", angle)
        mechanism = at_zero(HEXAPOD)
        origin = tip - attitude @ HEXAPOD.zero.contact.tip_P_mm
        here = closure_at(mechanism, origin, attitude)
        J = np.hstack([here.length_by_displacement, here.length_by_rotation_mm / radius_mm])
        moved_by = np.linalg.solve(J, rng.normal(size=(6, 4000)))
        amplification = np.sqrt((moved_by**2).sum(0).mean())
        assert bool(amplification < AMPLIFICATION_LIMIT) is inside
        assert bool(inverse(HEXAPOD, tip, attitude).reason == Reason.OK) is inside


def test_a_tripod_whose_links_lie_in_the_plane_of_its_platform_is_singular() -> None:
    """With the platform level with the base joints no link can hold it against falling."""
    level = np.array([0.0, 0.0, 700.0]) + TRIPOD.zero.contact.tip_P_mm
    assert inverse(TRIPOD, level).reason == Reason.NEAR_SINGULAR
    assert inverse(TRIPOD, level - [0.0, 0.0, 100.0]).reason == Reason.OK


def test_the_mirrored_tripod_is_not_taken_for_the_real_one() -> None:
    """The same lengths close above the base as well; a guess from there gives that pose or a failure, and from
    below never the one above."""
    lengths = TRIPOD.zero.link_length_mm
    above = forward_kinematics(at_zero(TRIPOD), lengths, [0.0, 0.0, 1150.0], np.eye(3))
    assert above.reason == Reason.OK
    assert above.origin_M_mm[2] > 1000
    for z_mm in np.linspace(100.0, 1300.0, 241):
        pose = forward_kinematics(at_zero(TRIPOD), lengths, [1.0, 2.0, z_mm], rotation("x", 1.0))
        if pose.reason == Reason.OK:
            assert (pose.origin_M_mm[2] < 700.0) == (z_mm < 700.0)


def test_wrong_shapes_are_refused_before_any_kernel_sees_them() -> None:
    four = Mechanism(np.zeros((4, 3)), np.zeros((4, 3)), np.zeros((3, 3)))
    with pytest.raises(ValueError, match="n links have base joints"):
        forward_kinematics(four, np.ones(4), np.zeros(3), np.eye(3))
    with pytest.raises(ValueError, match="dimension"):
        forward(TRIPOD, np.ones(6))
