"""Which dwell each point belongs to, from distances alone: found in any order, or refused with the reason."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.joining.assignment import Assignment, NoAssignment
from compd.joining.by_distance import MIN_POINTS, assign_by_distance
from tests.support.points_at_rest import MACHINE_MM, NOISE_MM, in_own_frame, measured, random_places


def assigned(expected_mm: FloatArray, points_mm: FloatArray, in_M: bool = False) -> Assignment:
    result = assign_by_distance(expected_mm, points_mm, np.nan, in_M)
    assert isinstance(result, Assignment), result
    return result


def refused(expected_mm: FloatArray, points_mm: FloatArray) -> NoAssignment:
    result = assign_by_distance(expected_mm, points_mm, np.nan)
    assert isinstance(result, NoAssignment), result
    return result


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("count", "of"), [(5, 5), (6, 40), (40, 40), (150, 200)])
@pytest.mark.parametrize("error_mm", [MACHINE_MM, 0.3])
def test_points_in_any_order(seed: int, count: int, of: int, error_mm: float) -> None:
    rng = np.random.default_rng(seed)
    expected_mm = random_places(rng, of)
    wanted = rng.permutation(of)[:count]
    result = assigned(expected_mm, measured(rng, expected_mm[wanted], error_mm))
    assert result.dwell[~result.unclear].tolist() == wanted[~result.unclear].tolist()
    assert result.unclear.sum() <= 0.02 * count
    assert result.rms_mm == pytest.approx(np.sqrt(2) * np.hypot(error_mm, NOISE_MM), rel=0.6)


@pytest.mark.parametrize("seed", range(5))
def test_repeats_and_a_point_measured_beside_the_machine(seed: int) -> None:
    rng = np.random.default_rng(seed)
    expected_mm = random_places(rng, 30)
    wanted = rng.permutation(np.concatenate([np.arange(30), rng.integers(0, 30, 10)]))
    points_mm = measured(rng, expected_mm[wanted], 0.0)
    assert assigned(expected_mm, points_mm).dwell.tolist() == wanted.tolist()
    with_other = np.insert(points_mm, 7, in_own_frame(np.array([[400.0, 300.0, -250.0]])), axis=0)
    assert assigned(expected_mm, with_other).dwell.tolist() == np.insert(wanted, 7, -1).tolist()


def test_a_place_visited_twice_has_no_clear_dwell() -> None:
    rng = np.random.default_rng(1)
    expected_mm = random_places(rng, 20)
    visits = np.concatenate([np.arange(20), [4, 9]])
    wanted = rng.permutation(20)
    result = assigned(expected_mm[visits], measured(rng, expected_mm[wanted]))
    assert result.dwell.tolist() == [-1 if place in (4, 9) else place for place in wanted.tolist()]
    assert set(wanted[result.unclear].tolist()) == {4, 9}
    again = np.tile(expected_mm, (2, 1))
    assert "at which visit" in refused(again, measured(rng, expected_mm)).why


def test_symmetrical_places_are_refused() -> None:
    rng = np.random.default_rng(1)
    square = np.array([(x, y, z) for x in (-40.0, 0.0, 40.0) for y in (-40.0, 0.0, 40.0) for z in (0.0, 30.0)])
    assert "symmetrical" in refused(square, measured(rng, rng.permutation(square))).why
    # in {M} nothing is ambiguous
    wanted = rng.permutation(len(square))
    assert assigned(square, square[wanted] + 0.01, in_M=True).dwell.tolist() == wanted.tolist()
    # three more places on one side, and the frame is clear; one alone might be a point beside the machine
    marked = np.vstack([square, [[61.0, 17.0, 8.0], [55.0, -20.0, 3.0], [70.0, 30.0, 20.0]]])
    wanted = rng.permutation(len(marked))
    assert assigned(marked, measured(rng, marked[wanted])).dwell.tolist() == wanted.tolist()


@pytest.mark.parametrize(
    ("points", "why"),
    [
        (lambda rng, place_mm: rng.uniform(-100, 100, place_mm.shape), "no choice of dwells|at no dwell"),
        (lambda rng, place_mm: measured(rng, place_mm) * [1, 1, -1], "mirror image"),
        (lambda rng, place_mm: measured(rng, place_mm) / 25.4, "no choice of dwells"),
        (lambda rng, place_mm: measured(rng, place_mm[: MIN_POINTS - 1]), "too few different places"),
        (lambda rng, place_mm: np.linspace(0, 1, 9)[:, None] * [10.0, 20.0, 30.0], "on one line"),
        (
            lambda rng, place_mm: np.vstack([measured(rng, place_mm[:20]), in_own_frame(random_places(rng, 10))]),
            "at no dwell",
        ),
    ],
    ids=["others", "mirrored", "inches", "four", "line", "a third elsewhere"],
)
def test_what_does_not_fit_is_refused(
    points: Callable[[np.random.Generator, FloatArray], FloatArray], why: str
) -> None:
    rng = np.random.default_rng(3)
    place_mm = random_places(rng, 30)
    assert re.search(why, refused(place_mm, points(rng, place_mm)).why)


@pytest.mark.parametrize("seed", range(40))
def test_never_a_wrong_dwell(seed: int) -> None:
    """Machines of every kind of layout: what is joined is joined rightly, else it is refused."""
    rng = np.random.default_rng(1000 + seed)
    count = int(rng.integers(5, 60))
    expected_mm = random_places(rng, count) * [1.0, 1.0, rng.choice([0.0, 0.05, 1.0])]
    if rng.random() < 0.3:
        expected_mm = np.round(expected_mm, -1)
        expected_mm = np.unique(expected_mm, axis=0)
        expected_mm = rng.permutation(expected_mm)
    wanted = rng.permutation(len(expected_mm))[: int(rng.integers(3, len(expected_mm) + 1))]
    result = assign_by_distance(
        expected_mm, measured(rng, expected_mm[wanted], float(rng.choice([0.005, 0.05, 0.3]))), np.nan
    )
    if isinstance(result, Assignment):
        clear = result.dwell >= 0
        assert result.dwell[clear].tolist() == wanted[clear].tolist()
