"""Drives: trapezoids that arrive, setpoints that are followed within speed and acceleration."""

from __future__ import annotations

import numpy as np
import pytest

from compd.simulation.truth.motion import (
    ACCELERATION_MM_PER_S2,
    SPEED_MM_PER_S,
    Move,
    SetpointMotion,
    TourMotion,
    braking,
    standing,
)


@pytest.mark.parametrize("way_mm", [0.001, 3.0, 150.0])
def test_a_move_keeps_speed_and_acceleration_and_arrives(way_mm: float) -> None:
    move = Move(np.array([1.0, -2.0, 0.0]), np.array([1.0 + way_mm, -2.0 - way_mm / 3, 0.0]))
    times_s = np.linspace(0.0, move.duration_s, 4001)
    path_mm = np.array([move.position_mm(time_s) for time_s in times_s])
    step_s = times_s[1]
    speed = np.diff(path_mm, axis=0) / step_s
    np.testing.assert_array_equal(path_mm[0], move.start_mm)
    np.testing.assert_array_equal(path_mm[-1], move.end_mm)
    assert np.abs(speed).max() <= SPEED_MM_PER_S * (1 + 1e-9)
    assert np.abs(np.diff(speed, axis=0)).max() / step_s <= ACCELERATION_MM_PER_S2 * (1 + 1e-3)
    assert np.abs(speed[-1]).max() < 2 * ACCELERATION_MM_PER_S2 * step_s


def test_a_move_to_where_it_is_takes_no_time() -> None:
    here = np.array([1.0, 2.0])
    assert Move(here, here).duration_s == 0.0
    np.testing.assert_array_equal(Move(here, here).position_mm(0.0), here)


def test_a_tour_dwells_at_its_points_and_counts_the_time_it_moved() -> None:
    points_mm = np.array([[5.0, 0.0], [0.0, 9.0], [-4.0, -4.0]])
    tour = TourMotion(standing(np.zeros(2)), points_mm, 1.0, np.random.default_rng(1))
    visited: list[int] = []
    moved_s = 0.0
    for _ in range(3000):
        moved_s += tour.advance(0.01)
        if tour.phase == "dwelling":
            np.testing.assert_array_equal(tour.position_mm, points_mm[tour.point - 1])
            if not visited or visited[-1] != tour.point:
                visited.append(tour.point)
    assert set(visited) == {1, 2, 3}
    assert 0 < moved_s < 30.0
    assert 30.0 - moved_s == pytest.approx(len(visited), abs=1.1)  # a second at each point


def test_a_tour_does_not_depend_on_the_step() -> None:
    points_mm = np.random.default_rng(4).uniform(-20, 20, (5, 3))
    once = TourMotion(standing(np.zeros(3)), points_mm, 0.5, np.random.default_rng(1))
    many = TourMotion(standing(np.zeros(3)), points_mm, 0.5, np.random.default_rng(1))
    moved_s = once.advance(40.0)
    assert sum(many.advance(0.008) for _ in range(5000)) == pytest.approx(moved_s, abs=1e-6)
    assert once.point == many.point
    np.testing.assert_allclose(once.position_mm, many.position_mm, atol=1e-6)


@pytest.mark.parametrize("step_s", [0.001, 0.02, 0.5])
def test_follower_arrives_exactly_and_keeps_its_speed(step_s: float) -> None:
    drives = SetpointMotion(standing(np.zeros(3)))
    drives.setpoint_mm = np.array([40.0, -0.002, 0.0])
    positions = [drives.position_mm]
    while drives.phase == "moving":
        drives.advance(step_s)
        positions.append(drives.position_mm)
        assert len(positions) * step_s < 10.0
    np.testing.assert_array_equal(drives.position_mm, drives.setpoint_mm)
    path_mm = np.array(positions)
    assert np.abs(np.diff(path_mm, axis=0)).max() <= SPEED_MM_PER_S * step_s * (1 + 1e-9)
    assert path_mm[:, 0].max() <= 40.0 + 0.01  # brakes in time


def test_follower_comes_from_one_side_whatever_the_steps() -> None:
    """A play of a micrometre would show a turn at the end."""
    rng = np.random.default_rng(1)
    drives = SetpointMotion(standing(np.zeros(3)))
    for _ in range(100):
        start_mm = drives.position_mm
        drives.setpoint_mm = rng.uniform(-60.0, 60.0, 3)
        way = np.sign(drives.setpoint_mm - start_mm)
        while drives.phase == "moving":
            drives.advance(rng.uniform(0.015, 0.045))
            assert np.all(way * drives.position_mm <= way * drives.setpoint_mm)


def test_follower_takes_new_setpoints_on_the_way() -> None:
    drives = SetpointMotion(standing(np.zeros(1)))
    drives.setpoint_mm = np.array([40.0])
    drives.advance(0.3)
    drives.setpoint_mm = np.array([-1.0])
    drives.advance(10.0)
    np.testing.assert_array_equal(drives.position_mm, [-1.0])
    assert drives.advance(1.0) == 0.0


def test_any_motion_goes_on_as_fast_as_it_was() -> None:
    """Second differences of the path, whatever is ordered in the middle of a move or of braking."""
    rng = np.random.default_rng(2)
    step_s, path_mm, most = 0.002, [], 0.0
    drives = SetpointMotion(standing(np.zeros(3)))
    move = Move(np.zeros(3), np.array([30.0, -10.0, 0.0]))
    for _ in range(200):
        if rng.random() < 0.2:
            time_s = rng.uniform(0.0, move.duration_s)
            before_mm, speeds = move.position_mm(time_s - 1e-4), move.speeds_mm_per_s(time_s)
            assert (move.position_mm(time_s) - before_mm) / 1e-4 == pytest.approx(speeds, abs=0.03)
        drives.setpoint_mm = rng.uniform(-20.0, 20.0, 3) if rng.random() < 0.8 else drives.setpoint_mm
        for _ in range(int(rng.integers(1, 300))):
            drives.advance(step_s)
            path_mm.append(drives.position_mm)
            most = max(most, float(np.abs(drives.speeds_mm_per_s).max()))
    assert np.abs(np.diff(np.array(path_mm), 2, axis=0)).max() <= ACCELERATION_MM_PER_S2 * step_s**2 * (1 + 1e-6)
    assert 0.9 * SPEED_MM_PER_S < most <= SPEED_MM_PER_S * (1 + 1e-9)


def test_braking_ends_where_the_speed_ends() -> None:
    start = braking(np.array([1.0, 2.0, 3.0]), np.array([50.0, -25.0, 0.0]))
    assert start.duration_s == pytest.approx(0.2)
    np.testing.assert_allclose(start.end_mm, [6.0, 0.75, 3.0])
    np.testing.assert_allclose(start.position_mm(0.1), [4.75, 0.75, 3.0])
    np.testing.assert_allclose(start.speeds_mm_per_s(0.05), [37.5, -12.5, 0.0])
