"""Which dwell each point belongs to, from order and distances alone: found, or refused with the reason."""

from __future__ import annotations

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.joining.assignment import Assignment, NoAssignment
from compd.joining.by_order import assign_by_order
from compd.joining.distances import distances_rms_mm, is_spread, lay_over
from tests.support.points_at_rest import MACHINE_MM, NOISE_MM, in_own_frame, measured, random_places


def assigned(expected_mm: FloatArray, points_mm: FloatArray) -> Assignment:
    result = assign_by_order(expected_mm, points_mm, np.nan)
    assert isinstance(result, Assignment), result
    return result


def refused(expected_mm: FloatArray, points_mm: FloatArray) -> NoAssignment:
    result = assign_by_order(expected_mm, points_mm, np.nan)
    assert isinstance(result, NoAssignment), result
    return result


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("first", "count"), [(0, 40), (0, 25), (7, 25), (15, 25), (39 - 4, 5)])
def test_instrument_that_began_later_or_ended_earlier(seed: int, first: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    expected_mm = random_places(rng, 40)
    result = assigned(expected_mm, measured(rng, expected_mm[first : first + count]))
    assert result.dwell.tolist() == list(range(first, first + count))
    assert result.rms_mm == pytest.approx(np.sqrt(2) * np.hypot(MACHINE_MM, NOISE_MM), rel=0.6)
    assert result.next_best is None or result.next_best[1] > 100 * result.rms_mm


@pytest.mark.parametrize("seed", range(5))
def test_repeats_missing_and_extra_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    expected_mm = random_places(rng, 40)
    wanted = np.delete(np.repeat(np.arange(40), np.where(np.arange(40) % 5 == 2, 3, 1)), [30])
    missing = int(np.setdiff1d(np.arange(40), wanted)[0]) if len(np.setdiff1d(np.arange(40), wanted)) else -1
    points_mm = in_own_frame(expected_mm[wanted]) + rng.normal(0, NOISE_MM, (len(wanted), 3))
    result = assigned(expected_mm, points_mm)
    assert result.dwell.tolist() == wanted.tolist()
    assert missing == -1 or missing not in result.dwell
    with_extra = np.insert(points_mm, 20, [[1.0, 2.0, 3.0]], axis=0)
    assert assigned(expected_mm, with_extra).dwell.tolist() == np.insert(wanted, 20, -1).tolist()


def test_the_same_place_later_is_the_later_dwell() -> None:
    rng = np.random.default_rng(2)
    route = rng.integers(0, 8, 60)
    route = route[np.insert(np.diff(route) != 0, 0, True)]
    expected_mm = random_places(rng, 8)[route]
    skipped = np.delete(np.arange(len(route)), 11)
    result = assigned(expected_mm, in_own_frame(expected_mm[skipped]) + rng.normal(0, NOISE_MM, (len(skipped), 3)))
    assert result.dwell.tolist() == skipped.tolist()


def test_a_raster_whose_steps_are_all_alike() -> None:
    """Only distances over several steps tell where the rows of the raster end."""
    rng = np.random.default_rng(3)
    raster = np.array([(20 * x if y % 2 == 0 else 80 - 20 * x, 20 * y, 0) for y in range(5) for x in range(5)], float)
    expected_mm = np.concatenate([[[-50.0, 10.0, 5.0]] * 1, raster, [[-50.0, 10.0, 5.0]]])
    assert assigned(expected_mm, measured(rng, raster[3:])).dwell.tolist() == list(range(4, 26))


def test_one_motion_again_and_again_is_refused_unless_all_of_it_was_measured() -> None:
    rng = np.random.default_rng(4)
    cycle_mm = random_places(rng, 10)
    expected_mm = np.tile(cycle_mm, (4, 1))
    no = refused(expected_mm, measured(rng, expected_mm[:20]))
    assert "two assignments fit equally well" in no.why
    assert no.value.count("mm rms") == 2
    assert assigned(expected_mm, measured(rng, expected_mm)).dwell.tolist() == list(range(40))


def test_other_points_are_refused_and_the_place_named() -> None:
    rng = np.random.default_rng(5)
    expected_mm = random_places(rng, 40)
    assert "no order of the dwells" in refused(expected_mm, random_places(rng, 30)).why
    points_mm = measured(rng, expected_mm)
    points_mm[25:] = random_places(rng, 15)
    no = refused(expected_mm, points_mm)
    assert "15 of 40 points fit no dwell" in no.why
    assert (no.point, no.dwell) == (25, 25)


def test_an_instrument_that_began_before_the_recording_and_ended_after_it() -> None:
    rng = np.random.default_rng(5)
    place_mm = random_places(rng, 40)
    result = assigned(place_mm[9:33], measured(rng, place_mm))
    assert result.dwell.tolist() == [-1] * 9 + list(range(24)) + [-1] * 7


def test_a_wrong_unit_and_a_mirror_are_named() -> None:
    rng = np.random.default_rng(6)
    expected_mm = random_places(rng, 30)
    points_mm = measured(rng, expected_mm)
    assert "inches read as mm?" in refused(expected_mm, points_mm / 25.4).value
    assert "m read as mm?" in refused(expected_mm, points_mm / 1000).value
    assert "mirror image" in refused(expected_mm, points_mm * [1, -1, 1]).why


def test_a_machine_cannot_be_that_wrong() -> None:
    rng = np.random.default_rng(7)
    expected_mm = random_places(rng, 30)
    assert assigned(expected_mm, measured(rng, expected_mm, 0.3)).count == 30
    no = refused(expected_mm, measured(rng, expected_mm, 3.0))
    assert "1 mm or less" in no.allowed


@pytest.mark.parametrize(
    "place_mm",
    [np.zeros((5, 3)), np.outer(np.arange(6.0), [10, 20, 30]), np.array([[0, 0, 0], [50, 0, 0.0]])],
    ids=["one place", "a line", "two"],
)
def test_too_few_places(place_mm: FloatArray) -> None:
    assert "too few different places" in refused(place_mm, in_own_frame(place_mm)).why


def test_three_points_that_are_no_line() -> None:
    expected_mm = np.array([[0, 0, 0], [50, 0, 0], [0, 80, 0.0]])
    assert assigned(expected_mm, in_own_frame(expected_mm)).dwell.tolist() == [0, 1, 2]


def test_lengths_along_a_link() -> None:
    rng = np.random.default_rng(8)
    length_mm = rng.uniform(-50, 50, (40, 1))
    points_mm = np.delete(length_mm, 22, axis=0)[5:] + 123.4 + rng.normal(0, 1e-4, (34, 1))
    assert assigned(length_mm, points_mm).dwell.tolist() == [*range(5, 22), *range(23, 40)]
    assert isinstance(assign_by_order(length_mm, -points_mm, np.nan), NoAssignment), (
        "the other direction is another one"
    )


def test_distances_know_no_frame() -> None:
    rng = np.random.default_rng(9)
    place_mm = random_places(rng, 12)
    assert distances_rms_mm(place_mm, in_own_frame(place_mm)) < 1e-9
    np.testing.assert_allclose(lay_over(in_own_frame(place_mm), place_mm)(in_own_frame(place_mm)), place_mm, atol=1e-9)
    assert not is_spread(place_mm[:2])


@pytest.mark.long
@pytest.mark.sample
def test_any_measurement_is_joined_rightly_or_refused() -> None:
    """Places visited again, repeats, a missing and a strange point, all at random: of 60, most are joined."""
    joined = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        expected_mm = random_places(rng, int(rng.integers(6, 60)))
        if seed % 2:
            route = rng.integers(0, max(4, len(expected_mm) // 3), len(expected_mm))
            expected_mm = expected_mm[route[np.insert(np.diff(route) != 0, 0, True)]]
        count = len(expected_mm)
        visited = np.arange(rng.integers(0, count // 4 + 1), count - rng.integers(0, count // 4 + 1))
        visited = np.delete(visited, int(rng.integers(0, len(visited))))
        wanted = np.repeat(visited, np.where(rng.random(len(visited)) < 0.2, 2, 1))
        error_mm = rng.normal(0.0, rng.choice([0.001, 0.02, 0.1]), expected_mm.shape)
        points_mm = in_own_frame((expected_mm + error_mm)[wanted]) + rng.normal(0, NOISE_MM, (len(wanted), 3))
        if rng.random() < 0.3:
            strange = int(rng.integers(0, len(wanted)))
            points_mm = np.insert(points_mm, strange, random_places(rng, 1), axis=0)
            wanted = np.insert(wanted, strange, -1)
        result = assign_by_order(expected_mm, points_mm, np.nan)
        if isinstance(result, Assignment):
            joined += 1
            assert not ((result.dwell != wanted) & (result.dwell >= 0)).any(), seed
    assert joined > 45


def test_one_point_far_from_all_others_is_named() -> None:
    """It makes a line of all points: a decimal point that was lost, for instance."""
    rng = np.random.default_rng(2)
    points_mm = measured(rng, random_places(rng, 20))
    points_mm[7, 1] = 171118176.0
    result = refused(random_places(rng, 20), points_mm)
    assert "one of them is far from all others" in result.why
    assert result.point == 7
