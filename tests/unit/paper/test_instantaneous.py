"""The instantaneous frame: right to first order, and refused for a degenerate machine."""

from __future__ import annotations

import numpy as np
import pytest

from compd.errors import KinematicsError
from compd.model.kinematics import Frame, FrameGeometry, distances_mm, solve_frame
from compd.model.machine import MachineParts, machine_model
from instantaneous import base_pose_jacobian, frame_difference, instantaneous_frame, inverse_frame_jacobian
from tests.support.model_machines import Floats, move_machine, rotation, tripod, tripod_parts

FRAME = tripod().frame


def test_derivatives_against_differences() -> None:
    b, h = FRAME.zero_supports_M_mm, 1e-4
    pose_J = base_pose_jacobian(FRAME)

    def solved(supports_M_mm: Floats) -> Frame:
        return solve_frame(FRAME, distances_mm(supports_M_mm, FRAME.plate_points_M_mm)[0])

    for column in range(9):
        step = np.zeros(9)
        step[column] = h
        plus, minus = b + step.reshape(3, 3), b - step.reshape(3, 3)
        there, back = solved(plus), solved(minus)
        moved_by = (there.displacement_M_mm - back.displacement_M_mm) / (2 * h)
        turned_by = (there.rotation_M_rad - back.rotation_M_rad) / (2 * h)
        np.testing.assert_allclose(pose_J[:3, column], moved_by, atol=1e-8)
        np.testing.assert_allclose(pose_J[3:, column], turned_by, atol=1e-10)


@pytest.mark.parametrize(
    "model", [tripod(), machine_model(MachineParts(**move_machine(tripod_parts(), rotation("x", 100), np.ones(3))))]
)
def test_instantaneous_frame_is_right_to_first_order(model: object) -> None:
    """Half the deformation leaves a quarter of the difference: it is of second order."""
    geometry: FrameGeometry = model.frame  # type: ignore[attr-defined]
    zero, _ = distances_mm(geometry.zero_supports_M_mm, geometry.plate_points_M_mm)
    changes = np.random.default_rng(7).normal(0, 0.4, (30, 9))
    whole, half = (
        frame_difference(solve_frame(geometry, zero + size * changes), instantaneous_frame(geometry, size * changes))
        for size in (1.0, 0.5)
    )
    for large, small in zip(whole, half, strict=True):
        assert large.min() > 0
        assert np.median(large / small) == pytest.approx(4.0, rel=0.05)
    # at the size of a warming frame the two differ by nanometres
    small_changes = changes / 20
    nearly = frame_difference(solve_frame(geometry, zero + small_changes), instantaneous_frame(geometry, small_changes))
    assert nearly.supports_mm.max() < 2e-5


def test_instantaneous_frame_of_a_degenerate_machine_is_refused() -> None:
    flat = FRAME._replace(zero_supports_M_mm=FRAME.zero_supports_M_mm * [1, 1, 0])
    with pytest.raises(KinematicsError, match="do not fix the supports"):
        inverse_frame_jacobian(flat)
