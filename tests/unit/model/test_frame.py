"""The frame from nine distances: exact, and every way to fail."""

from __future__ import annotations

import numpy as np
import pytest

from compd.errors import KinematicsError
from compd.model.kernels.solve_status import Reason, require
from compd.model.kinematics.frame import Frame, FrameGeometry, base_pose, distances_mm, solve_frame
from compd.model.machine import MachineParts, machine_model
from compd.rotation import rotation_matrix
from tests.support.model_machines import Floats, hexapod, move_machine, ring, rotation, tripod, tripod_parts

MODEL = tripod()
FRAME = MODEL.frame
ZERO_MM = MODEL.zero.distances_mm
SHAKEN_MM = np.array([[1.0, 2, 3], [-2, 1, 0], [0, 0, 5]])


def frame_with(geometry: FrameGeometry, supports_M_mm: Floats, guess_M_mm: Floats | None = None) -> Frame:
    """Solved from the distances that these supports have."""
    found, _ = distances_mm(supports_M_mm, geometry.plate_points_M_mm)
    return solve_frame(geometry, found, guess_M_mm)


def test_distances_are_those_between_the_points() -> None:
    b, m = FRAME.zero_supports_M_mm + SHAKEN_MM, FRAME.plate_points_M_mm
    pairs = [(b[0], b[1]), (b[1], b[2]), (b[2], b[0])]
    pairs += [(b[0], m[0]), (b[0], m[2]), (b[1], m[0]), (b[1], m[1]), (b[2], m[1]), (b[2], m[2])]
    np.testing.assert_allclose(distances_mm(b, m)[0], [np.linalg.norm(p - q) for p, q in pairs], rtol=1e-15)


def test_supports_come_back_from_their_distances() -> None:
    supports = FRAME.zero_supports_M_mm + np.random.default_rng(1).normal(0, 2.0, (200, 3, 3))
    frame = frame_with(FRAME, supports)
    require(frame.reason, "frame")
    np.testing.assert_allclose(frame.supports_M_mm, supports, rtol=0, atol=1e-9)
    assert frame.iterations.max() <= 5
    assert frame.residual_mm.max() < 1e-11


def test_warm_start_saves_iterations() -> None:
    supports = FRAME.zero_supports_M_mm + np.random.default_rng(2).normal(0, 2.0, (50, 3, 3))
    cold = frame_with(FRAME, supports)
    warm = frame_with(FRAME, supports, cold.supports_M_mm)
    assert warm.iterations.max() < cold.iterations.min()
    np.testing.assert_allclose(warm.supports_M_mm, cold.supports_M_mm, rtol=0, atol=1e-10)


def test_frame_convention() -> None:
    b = FRAME.zero_supports_M_mm + SHAKEN_MM
    origin, R = base_pose(b)
    np.testing.assert_allclose(origin, b.mean(0), atol=1e-12)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-15)
    in_B = (b - origin) @ R
    np.testing.assert_allclose(in_B[:, 2], 0, atol=1e-12)  # the supports span the plane z = 0
    np.testing.assert_allclose(in_B[0, 0], 0, atol=1e-12)  # b1 lies on +y
    assert in_B[0, 1] > 0
    assert np.cross(in_B[1] - in_B[0], in_B[2] - in_B[0])[2] > 0


def test_base_joints_keep_their_offset_in_the_axes_of_the_base() -> None:
    model = hexapod()
    R, shift = rotation_matrix(np.array([1e-3, -2e-3, 3e-3])), np.array([0.4, -0.2, 0.1])
    pivot = model.frame.zero_origin_M_mm
    rigid = (model.frame.zero_supports_M_mm - pivot) @ R.T + pivot + shift
    frame = frame_with(model.frame, rigid)
    wanted = (model.zero.base_joints_M_mm - pivot) @ R.T + pivot + shift
    np.testing.assert_allclose(frame.base_joints_M_mm, wanted, rtol=0, atol=1e-10)
    np.testing.assert_allclose(frame.displacement_M_mm, shift, atol=1e-10)
    np.testing.assert_allclose(frame.rotation_M_rad, [1e-3, -2e-3, 3e-3], atol=1e-13)


def test_rows_alone_are_as_all_together() -> None:
    changes = np.random.default_rng(3).normal(0, 0.03, (40, 9))
    together = solve_frame(FRAME, ZERO_MM + changes)
    for i in range(len(changes)):
        alone = solve_frame(FRAME, ZERO_MM + changes[i])
        assert all(a.tobytes() == b[i].tobytes() for a, b in zip(alone, together, strict=True))


@pytest.mark.parametrize("turn", [rotation("x", 180), rotation("x", 90), rotation("y", -60) @ rotation("z", 25)])
def test_a_base_under_or_beside_the_work_is_the_same_frame_turned(turn: Floats) -> None:
    shift = np.array([100.0, -50.0, 400.0])
    turned = machine_model(MachineParts(**move_machine(tripod_parts(), turn, shift)))
    changes = np.random.default_rng(4).normal(0, 0.05, (20, 9))
    here, there = solve_frame(FRAME, ZERO_MM + changes), solve_frame(turned.frame, ZERO_MM + changes)
    require(there.reason, "turned frame")
    np.testing.assert_allclose(there.supports_M_mm, here.supports_M_mm @ turn.T + shift, rtol=0, atol=1e-9)
    np.testing.assert_allclose(there.displacement_M_mm, here.displacement_M_mm @ turn.T, rtol=0, atol=1e-9)
    np.testing.assert_allclose(there.rotation_M_rad, here.rotation_M_rad @ turn.T, rtol=0, atol=1e-12)


def test_derivatives_against_differences() -> None:
    b, m, h = FRAME.zero_supports_M_mm, FRAME.plate_points_M_mm, 1e-4
    _, J = distances_mm(b, m)
    for column in range(9):
        step = np.zeros(9)
        step[column] = h
        plus, minus = b + step.reshape(3, 3), b - step.reshape(3, 3)
        slope = (distances_mm(plus, m)[0] - distances_mm(minus, m)[0]) / (2 * h)
        np.testing.assert_allclose(J[:, column], slope, atol=1e-8)


def spoiled(index: int, value: float) -> Floats:
    distances = ZERO_MM.copy()
    distances[index] = value
    return distances


@pytest.mark.parametrize(
    ("distances", "reason"),
    [
        (spoiled(4, np.nan), Reason.NOT_FINITE),
        (spoiled(0, np.inf), Reason.NOT_FINITE),
        (spoiled(8, -np.inf), Reason.NOT_FINITE),
        (spoiled(3, 1e300), Reason.NOT_FINITE),
        (spoiled(3, 0.0), Reason.UNREACHABLE),
        (spoiled(3, -766.0), Reason.UNREACHABLE),
        (spoiled(0, 900.0), Reason.UNREACHABLE),  # t1 longer than t2 and t3 together
        (spoiled(5, 10.0), Reason.UNREACHABLE),  # u3 too short to meet u4
    ],
)
def test_distances_that_cannot_be(distances: Floats, reason: Reason) -> None:
    frame = solve_frame(FRAME, distances)
    assert Reason(int(frame.reason)) is reason
    for numbers in (frame.supports_M_mm, frame.origin_M_mm, frame.rotation_M_B, frame.base_joints_M_mm):
        assert np.isnan(numbers).all()
    with pytest.raises(KinematicsError, match=reason.name):
        require(frame.reason, "frame")


def test_a_flattened_octahedron_is_near_singular() -> None:
    """Supports sunk into the plane of the plate points: their height is no longer fixed by the distances."""
    reasons = []
    for height in (100.0, 1.0, 0.01, 0.0):
        supports = ring(250, 90, 210, 330, z_mm=height)
        low = FRAME._replace(zero_supports_M_mm=supports, zero_origin_M_mm=np.array([0.0, 0.0, height]))
        reasons.append(int(frame_with(low, supports).reason))
    assert reasons == [Reason.OK, *[Reason.NEAR_SINGULAR] * 3]


def test_the_mirrored_frame_is_not_taken_for_the_real_one() -> None:
    """The same distances close below the plate as well. From wherever Newton starts, it ends in the frame of
    machine zero or says why not."""
    mirrored = FRAME.zero_supports_M_mm * [1, 1, -1]
    assert frame_with(FRAME, FRAME.zero_supports_M_mm, mirrored).reason == Reason.OTHER_ASSEMBLY
    guesses = FRAME.zero_supports_M_mm + np.random.default_rng(8).normal(0, 400, (500, 3, 3))
    frame = frame_with(FRAME, FRAME.zero_supports_M_mm, guesses)
    right = frame.reason == Reason.OK
    np.testing.assert_allclose(
        frame.supports_M_mm[right] - FRAME.zero_supports_M_mm, np.zeros((right.sum(), 3, 3)), rtol=0, atol=1e-9
    )
    assert right.sum() > 100
    assert (frame.reason == Reason.OTHER_ASSEMBLY).sum() > 50


def test_failed_rows_leave_the_others_alone() -> None:
    rows = np.stack([ZERO_MM, spoiled(2, np.nan), ZERO_MM + 0.01, spoiled(0, 2000.0)])
    frame = solve_frame(FRAME, rows)
    assert frame.reason.tolist() == [Reason.OK, Reason.NOT_FINITE, Reason.OK, Reason.UNREACHABLE]
    assert np.isfinite(frame.supports_M_mm[[0, 2]]).all()
    with pytest.raises(KinematicsError) as caught:
        require(frame.reason, "frame")
    assert [problem.where for problem in caught.value.problems] == ["frame, row 1", "frame, row 3"]


def test_supports_on_one_line_have_no_axes() -> None:
    _, R = base_pose(np.array([[0.0, 0, 0], [1, 1, 1], [2, 2, 2]]))
    assert np.isnan(R).all()


def test_points_that_coincide_have_no_distance() -> None:
    found, J = distances_mm(np.ones((3, 3)), FRAME.plate_points_M_mm)
    assert np.isnan(found).all()
    assert np.isnan(J).all()
