"""Speeds in a recording: known in steady motion and at rest, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.comparison.alignment.velocity import velocities


def speeds(time_s: list[float], scale_mm: list[float], at_point: list[bool] | None = None) -> FloatArray:
    """Of one scale (and of a comparator that moves a thousandth of it)."""
    starts = np.zeros(len(time_s), dtype=bool)
    starts[0] = True
    values = np.array(scale_mm)[:, None]
    at = np.array([False] * len(time_s) if at_point is None else at_point)
    found = velocities(np.array(time_s), starts, at, values, values / 1000)
    np.testing.assert_allclose(found[:, 1], found[:, 0] / 1000)
    return np.asarray(found[:, 0])


def test_steady_motion_has_its_speed_even_where_rows_are_unevenly_spaced() -> None:
    time_s = [0.0, 0.2, 0.4, 1.0, 1.3]
    found = speeds(time_s, [5 * t for t in time_s])
    assert found[1:-1] == pytest.approx([5.0, 5.0, 5.0])
    assert np.isnan(found[[0, -1]]).all(), "an end row may have stood still or not"


def test_a_row_that_has_not_moved_since_its_neighbour_stands_still() -> None:
    found = speeds([0.0, 25.0, 27.0, 50.0, 50.2, 50.4], [0.0, 80.0, 80.0, -3.0, -3.0, -2.0])
    assert found[1:5].tolist() == [0.0, 0.0, 0.0, 0.0]
    assert np.isnan(found[[0, 5]]).all(), "far from the others without a point; and under way"


def test_between_visits_nothing_is_known_but_at_a_point_the_machine_stands() -> None:
    time_s, scale_mm = [0.0, 25.0, 50.0], [0.0, 80.0, -40.0]
    assert np.isnan(speeds(time_s, scale_mm)).all(), "80 mm in 25 s is the move, not this row"
    assert speeds(time_s, scale_mm, [True, True, False])[:2].tolist() == [0.0, 0.0]


def test_where_the_speed_changes_the_nearer_neighbour_knows() -> None:
    # at rest, away with 10 mm/s after a start, and rows every 0.2 s; then a turn that no row has seen
    found = speeds([0.0, 1.0, 1.2, 1.4, 2.4, 3.4], [0.0, 8.0, 10.0, 12.0, 14.0, 7.0])
    assert found[1] == pytest.approx(10.0)
    assert found[2] == pytest.approx(10.0)
    assert np.isnan(found[4])
