"""Ways on which every link comes from the wanted side, checked on the simulated mechanism, which shares no code."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.machine_builder import build_model
from compd.planning import plan_ways
from compd.planning.tip_ways import MAX_MM, STEADY_S, TRAVEL_MM, TipWays
from compd.simulation import Mechanism
from tests.support.simulated import HEXAPOD, hexapod, tripod, wiring

PLACES = ((0.0, 0.0, 190.0), (60.0, -70.0, 150.0), (-80.0, 30.0, 210.0))


@pytest.fixture(scope="module")
def ways() -> TipWays:
    return TipWays(build_model(tripod(), wiring()))


@pytest.fixture(scope="module")
def mechanism() -> Mechanism:
    return Mechanism(tripod())


def lengths_mm(mechanism: Mechanism, tip_M_mm: FloatArray) -> FloatArray:
    return mechanism.lengths(mechanism.posture_at(tip_M_mm, np.zeros(3)))


@pytest.mark.parametrize("place", PLACES)
def test_every_side_of_a_tripod_can_be_come_from(ways: TipWays, mechanism: Mechanism, place: tuple[float, ...]) -> None:
    tip_M_mm = np.array(place)
    for signs in product((1.0, -1.0), repeat=3):
        way = ways.way(tip_M_mm, np.array(signs), 0.0)
        assert way is not None, signs
        assert way.end_M_mm is None
        moved = lengths_mm(mechanism, tip_M_mm) - lengths_mm(mechanism, way.via_M_mm)
        assert np.sign(moved).tolist() == list(signs)
        assert np.abs(moved).min() == pytest.approx(TRAVEL_MM, rel=0.2)
        assert np.linalg.norm(way.via_M_mm - tip_M_mm) <= MAX_MM


def test_a_place_is_passed_at_the_speed_of_the_fastest_link(ways: TipWays, mechanism: Mechanism) -> None:
    tip_M_mm = np.array([10.0, -20.0, 180.0])
    way = ways.way(tip_M_mm, np.array([1.0, 1.0, 1.0]), 40.0)
    assert way is not None
    assert way.end_M_mm is not None
    np.testing.assert_allclose((way.via_M_mm + way.end_M_mm) / 2, tip_M_mm, atol=1e-9)
    course = way.end_M_mm - way.via_M_mm
    step_mm = 1e-3 * course / np.linalg.norm(course)
    per_mm = (lengths_mm(mechanism, tip_M_mm + step_mm) - lengths_mm(mechanism, tip_M_mm - step_mm)) / 2e-3
    assert np.abs(per_mm).max() * way.speed_mm_per_s == pytest.approx(40.0, rel=1e-3)
    assert np.linalg.norm(course) / 2 >= STEADY_S * way.speed_mm_per_s - 1e-9


def test_links_whose_direction_does_not_matter(ways: TipWays, mechanism: Mechanism) -> None:
    tip_M_mm = np.array([10.0, -20.0, 180.0])
    assert ways.way(tip_M_mm, np.zeros(3), 0.0) is None
    way = ways.way(tip_M_mm, np.array([0.0, -1.0, 0.0]), 0.0)
    assert way is not None
    assert lengths_mm(mechanism, tip_M_mm)[1] < lengths_mm(mechanism, way.via_M_mm)[1]


def test_a_hexapod_that_keeps_its_attitude_has_ways_for_some_sides_alone() -> None:
    ways, mechanism = TipWays(build_model(hexapod(), wiring(HEXAPOD))), Mechanism(hexapod())
    tip_M_mm = mechanism.tip0_M + np.array([5.0, -8.0, 3.0])
    found = {}
    for signs in product((1.0, -1.0), repeat=6):
        way = found[signs] = ways.way(tip_M_mm, np.array(signs), 0.0)
        if way is not None:
            moved = lengths_mm(mechanism, tip_M_mm) - lengths_mm(mechanism, way.via_M_mm)
            assert np.sign(moved).tolist() == list(signs)
    # six planes through a point part space into 32 regions at most
    assert 2 <= sum(way is not None for way in found.values()) <= 32
    assert found[(1.0,) * 6] is not None
    assert found[(-1.0,) * 6] is not None


def test_ways_of_rows() -> None:
    row = {"tip_x_mm": 0.0, "tip_y_mm": 5.0, "tip_z_mm": 180.0, "speed_mm_per_s": 0.0}
    to, free = plan_ways(
        build_model(tripod(), wiring()),
        [
            {**row, "approach_1": 1, "approach_2": -1, "approach_3": 1},
            {**row, "approach_1": 0, "approach_2": 0, "approach_3": 0},
        ],
    )
    assert to is not None
    assert free is None
