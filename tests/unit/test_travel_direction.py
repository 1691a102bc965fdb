"""Recordings, the running daemon and effects see the same direction of travel on the same scales."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from compd.arrays import FloatArray
from compd.gauge import good
from compd.live.loop import Directions
from compd.live.machine import Wire
from compd.model.kinematics import track_motion
from compd.travel_direction import row_directions

STEPS_UM = st.floats(-3.0, 3.0)
WALKS = st.lists(st.tuples(STEPS_UM, STEPS_UM), min_size=1, max_size=60)


def by_recording(scale_mm: FloatArray) -> FloatArray:
    return np.nan_to_num(row_directions(scale_mm, None))


def by_effects(scale_mm: FloatArray) -> FloatArray:
    """As effects see it, live and fitted: with the motion from one snapshot to the next."""
    movement, _ = track_motion(None, np.arange(len(scale_mm)) * 0.005, scale_mm, np.zeros((len(scale_mm), 0)))
    return movement.direction


def by_daemon(scale_mm: FloatArray) -> FloatArray:
    """As the daemon writes it into READINGS, cycle by cycle."""
    wires = [Wire(f"scale_{link}", f"scale {link}", link, 1, 1.0) for link in range(scale_mm.shape[1])]
    directions = Directions(wires)
    directions_seen = []
    for row in scale_mm.tolist():
        readings = tuple(good(value, 0.0) for value in row)
        directions.update(SimpleNamespace(inputs=SimpleNamespace(snapshot=SimpleNamespace(readings=readings))))
        directions_seen.append(directions.now)
    return np.array(directions_seen, dtype=float)


@given(WALKS)
def test_recorded_live_and_fitted_directions_are_the_same(steps_um: Sequence[tuple[float, float]]) -> None:
    scale_mm = np.cumsum(np.array(steps_um), axis=0) * 1e-3
    recorded = by_recording(scale_mm)
    assert np.array_equal(recorded, by_effects(scale_mm))
    assert np.array_equal(recorded, by_daemon(scale_mm))


@given(WALKS)
def test_mirrored_scales_travel_the_other_way(steps_um: Sequence[tuple[float, float]]) -> None:
    scale_mm = np.cumsum(np.array(steps_um), axis=0) * 1e-3
    assert np.array_equal(by_recording(-scale_mm), -by_recording(scale_mm))


@pytest.mark.parametrize("directions", [by_recording, by_effects, by_daemon])
@pytest.mark.parametrize(
    ("scale_um", "last"),
    [
        ([0.0, 1.5, 2.3, 1.4, 1.2], -1),  # back by more than 1 um from the farthest position, in two steps
        ([0.0, 0.4, 0.8, 1.2], 1),  # creep adds up
        ([0.0, 5.0, 4.5, 4.9, 4.2], 1),  # back by 0.8 um only
        ([0.0, 0.9, 0.1, 0.8], 0),  # noise, no movement
        ([0.0, 5.0, 3.0, 2.5, 3.4], -1),  # forth by 0.9 um only
    ],
)
def test_a_reversal_is_measured_from_the_farthest_position(directions, scale_um: list[float], last: int) -> None:
    assert directions(np.array([scale_um]).T * 1e-3)[-1, 0] == last


def test_every_session_begins_anew() -> None:
    scale_mm = np.array([[0.0], [1.0], [2.0], [2.0], [1.0]])
    direction = row_directions(scale_mm, np.array([1, 1, 1, 2, 2]))[:, 0]
    assert np.array_equal(direction, [math.nan, 1, 1, math.nan, -1], equal_nan=True)


def test_a_row_without_a_value_keeps_the_direction() -> None:
    scale_mm = np.array([[0.0], [1.0], [math.nan], [1.0005]])
    assert np.array_equal(row_directions(scale_mm, None)[:, 0], [math.nan, 1, 1, 1], equal_nan=True)
