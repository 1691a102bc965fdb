"""Names of points as ids of dwells, and what the distances between the points say of them."""

from __future__ import annotations

import numpy as np
import pytest

from compd.joining.by_name import assign_by_name, check_names
from tests.support.points_at_rest import in_own_frame


@pytest.mark.parametrize(
    ("ids", "names", "dwell"),
    [
        (["A", "B", "C"], ["c", "a", "B"], [2, 0, 1]),
        (["1", "2", "3"], ["P003", "P001", "P002"], [2, 0, 1]),
        (["1", "2"], ["1", "P001", "2"], [0, -1, 1]),
        (["1", "2"], ["A1", "B1", "2"], [-1, -1, 1]),
        (["P1", "2"], ["P001", "2"], [-1, 1]),
        (["1", "2", "1"], ["1", "2", "1"], [0, 1, 2]),
        (["1", "2"], ["1", "1", "2", "1"], [0, 0, 1, 0]),
        (["1", "2", "1"], ["1", "1", "2", "1"], [0, 0, 1, 2]),
        (["1", "2", "1", "1"], ["1", "1", "2"], [-1, -1, 1]),
        (["1", "", "2"], ["1", "2", "9"], [0, 2, -1]),
    ],
)
def test_which_dwell_a_name_is(ids: list[str], names: list[str], dwell: list[int]) -> None:
    assert assign_by_name(ids, [1] * len(ids), names).dwell.tolist() == dwell


def test_what_has_no_partner_is_listed() -> None:
    named = assign_by_name(["1", "2", "3", "3"], [1, 1, 1, 1], ["1", "9", "home", "3", "3", "3"])
    assert named.unknown == ("9", "home")
    assert named.without == ("2",)
    assert named.unclear == ("3",)


def test_names_at_rows_of_visits() -> None:
    """Two visits of three rows, five points: neither as many as visits nor as rows."""
    assert assign_by_name(["1", "2", "1"], [2, 1, 1], ["1", "1", "1", "2"]).dwell.tolist() == [0, 0, 2, 1]
    assert assign_by_name(["1", "2", "1"], [3, 1, 3], ["1", "1", "1", "1", "1", "2"]).unclear == ("1",)


def test_visits_are_not_guessed_in_a_list_that_is_sorted_by_name() -> None:
    ids = ["1", "2", "3", "1", "2"]
    assert assign_by_name(ids, [1] * 5, ["1", "2", "3", "1", "2"]).dwell.tolist() == [0, 1, 2, 3, 4]
    by_name = assign_by_name(ids, [1] * 5, ["1", "1", "2", "2", "3"])
    assert by_name.dwell.tolist() == [-1, -1, -1, -1, 2]
    assert by_name.unclear == ("1", "2")


def test_swapped_names_are_found_by_the_distances() -> None:
    rng = np.random.default_rng(1)
    place_mm = rng.uniform(-100, 100, (20, 3))
    points_mm = in_own_frame(place_mm + rng.normal(0, 0.01, place_mm.shape))
    right = check_names(place_mm, points_mm, np.arange(20), 0.05)
    assert (len(right.wrong), right.why) == (0, "")
    assert right.rms_mm < 0.03
    dwell = np.arange(20)
    dwell[[4, 9]] = dwell[[9, 4]]
    swapped = check_names(place_mm, points_mm, dwell, 0.05)
    assert swapped.wrong.tolist() == [4, 9]
    assert swapped.nearest.tolist() == [4, 9]
    assert swapped.off_mm.min() > 1
    moved_mm = points_mm.copy()
    moved_mm[7] += [0, 0, 30]
    elsewhere = check_names(place_mm, moved_mm, np.arange(20), 0.05)
    assert (elsewhere.wrong.tolist(), elsewhere.nearest.tolist()) == ([7], [-1])


def test_two_places_are_enough_where_points_are_measured_in_the_machines_frame() -> None:
    place_mm = np.array([[0, 0, 200.0], [0, 0, 200.0], [50, 0, 200.0], [50, 0, 200.0]])
    points_mm = place_mm + np.array([0.02, -0.01, 0.005])
    assert check_names(place_mm, points_mm, np.arange(4), 0.05).why
    right = check_names(place_mm, points_mm, np.arange(4), 0.05, in_M=True)
    assert (right.why, len(right.wrong)) == ("", 0)
    dwell = np.array([0, 1, 3, 0])
    wrong = check_names(place_mm, points_mm, dwell, 0.05, in_M=True)
    assert wrong.wrong.tolist() == [3]
    assert wrong.nearest.tolist() == [2]


def test_names_in_another_order_altogether_are_refused() -> None:
    rng = np.random.default_rng(2)
    place_mm = rng.uniform(-100, 100, (20, 3))
    check = check_names(place_mm, in_own_frame(place_mm), np.roll(np.arange(20), 3), 0.05)
    assert check.why or len(check.wrong) > 10
    assert "too few" in check_names(place_mm[:2], place_mm[:2], np.arange(2), 0.05).why
