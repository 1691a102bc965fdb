"""Planned rows as a person reads them: each once, and nothing that is the same everywhere."""

from __future__ import annotations

from typing import Any

from compd.report.diagnosis_evidence import planned_rows_table


def row(number: int, **changed: Any) -> dict[str, Any]:
    return {
        "row": number,
        "purpose": "place",
        "time_s": 0.0,
        "tip_x_mm": -80.863,
        "tip_y_mm": 72.4,
        "force_x_N": 0.0,
        "approach_1": 1,
        "approach_2": -1,
        "approach_3": 0,
        "speed_mm_per_s": 0.0,
        **changed,
    }


def test_a_row_that_comes_twice_is_there_once_with_how_often() -> None:
    table = planned_rows_table([row(1), row(2, tip_x_mm=2.2), row(3)])
    assert list(table.head) == ["purpose", "tip x, mm", "times"]
    assert list(table.rows) == [("place", "-80.863", "2"), ("place", "2.200", "1")]


def test_what_is_the_same_everywhere_is_said_once_with_units_and_time_0_not_at_all() -> None:
    table = planned_rows_table([row(1), row(2, tip_x_mm=2.2)])
    assert table.caption == "The same in every row: tip y, mm 72.4; force x, N 0; speed, mm/s 0; approach +1 -1 0."


def test_rows_that_wait_for_each_other_keep_their_order_and_times() -> None:
    steps = [row(1), row(2, time_s=60.0), row(3, time_s=60.0), row(4)]
    table = planned_rows_table(steps)
    assert list(table.head) == ["purpose", "time, s", "times"]
    assert [cells[1:] for cells in table.rows] == [("0", "1"), ("60", "2"), ("0", "1")]


def test_columns_of_a_machine_of_ones_own_keep_their_names_where_they_have_no_known_unit() -> None:
    table = planned_rows_table(
        [{"row": 1, "purpose": "star", "time_s": 0, "elevation_deg": 20, "moved": value} for value in (1, -1)]
    )
    assert list(table.head) == ["purpose", "moved"]
    assert table.caption == "The same in every row: elevation, deg 20."
