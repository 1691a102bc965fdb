"""How often the error on another day lies where it was to be expected, and how wide the limits are."""

from __future__ import annotations

from tests.scoreboard.measures import OtherDay, other_day_limits


def test_only_days_of_which_something_was_expected_count():
    results = [
        {"other_day": {"final_rms_um": 0.2, "expected_um": [0.1, 0.3]}},
        {"other_day": {"final_rms_um": 0.4, "expected_um": [0.1, 0.3]}},
        {"other_day": {"final_rms_um": 0.4, "expected_um": None}},
        {"other_day": {"final_rms_um": 0.4, "expected_um": [None, None]}},
        {"other_day": None},
        {},
    ]
    assert list(other_day_limits(results)) == [OtherDay(0.2, 0.1, 0.3), OtherDay(0.4, 0.1, 0.3)]
    assert [day.inside for day in other_day_limits(results)] == [True, False]
