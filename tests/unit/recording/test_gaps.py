"""Gaps of a quantity are filled from the nearest row in time, where they are few."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from compd.comparison import ComparisonCriteria, compare, open_recording
from compd.comparison.residual_trends import Trend
from compd.statistics import filled
from tests.support.external import measured_places, write_external

NAN = np.nan


def test_an_empty_cell_has_the_value_of_the_nearest_row_in_time() -> None:
    time_s = np.array([0.0, 1.0, 5.0, 6.0, *np.arange(10.0, 60.0)])
    values = np.array([NAN, 1.0, NAN, 3.0, *np.arange(50.0)])
    values[-1] = NAN
    found = filled(values, time_s, ComparisonCriteria.max_filled_share)
    assert found[:4].tolist() == [1.0, 1.0, 3.0, 3.0]
    assert found[-1] == 48.0
    np.testing.assert_array_equal(found[4:-1], values[4:-1])


def test_many_gaps_or_nothing_at_all_stay() -> None:
    values, time_s = np.arange(50.0), np.arange(50.0)
    values[:6] = NAN
    assert ComparisonCriteria.max_filled_share * 50 < 6
    assert np.isnan(filled(values, time_s, ComparisonCriteria.max_filled_share)).sum() == 6
    assert np.isnan(filled(np.full(50, NAN), time_s, ComparisonCriteria.max_filled_share)).all()


def trends(directory: Path, empty: list[int]) -> tuple[Trend, ...]:
    columns = measured_places()
    room = 20 + np.cumsum(np.random.default_rng(2).normal(0, 0.2, 120))
    columns["reference_x_mm"] = columns["reference_x_mm"] + 0.02 * (room - 20)
    room[empty] = NAN
    columns |= {"temperature_room_degC": room, "visit": np.arange(120.0) // 2}
    return compare(open_recording(write_external(directory, columns))).trends


def test_one_empty_cell_changes_no_trend(tmp_path: Path) -> None:
    whole, gap = trends(tmp_path, []), trends(tmp_path, [7])
    assert [trend.covariate for trend in gap] == [trend.covariate for trend in whole]
    assert gap[0].covariate == "temperature_room"
    np.testing.assert_allclose(gap[0].slope, whole[0].slope, rtol=0.01)


def test_a_recording_with_gaps_filled_keeps_its_own_values(tmp_path: Path) -> None:
    columns = measured_places()
    room = np.arange(120.0)
    room[7] = NAN
    aligned = open_recording(write_external(tmp_path, {**columns, "temperature_room_degC": room}))
    whole = aligned.gaps_filled
    assert whole.rows.quantities["temperature_room_degC"][7] in (6.0, 8.0)
    assert np.isnan(aligned.rows.quantities["temperature_room_degC"][7])
    assert np.isnan(whole.recording.quantities["temperature_room_degC"][7])
