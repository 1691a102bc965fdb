"""Thinning: about so many rows, evenly, visits whole, sessions where they were, the same each time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.recording_comparison import compare
from compd.comparison.thinning import thinned
from tests.support.external_recordings import record_external

ROWS = 1200


def recording(path: Path, rows_of_visit: int = 1) -> AlignedRecording:
    """Four sessions, of which the first rows are marked."""
    rows = np.arange(ROWS)
    columns = {"session": 1.0 + rows * 4 // ROWS, "temperature_bed_degC": 20 + rows / 100}
    if rows_of_visit > 1:
        columns["visit"] = 1.0 + rows // rows_of_visit
    return record_external(path, columns, {"x": np.sin(rows / 50)}, model_mm={"x": rows // rows_of_visit / 10.0})


def test_a_short_recording_stays_as_it_is(tmp_path: Path) -> None:
    aligned = recording(tmp_path / "run.csv")
    assert thinned(aligned, ROWS) is aligned


def test_rows_are_drawn_evenly_and_belong_together(tmp_path: Path) -> None:
    aligned = recording(tmp_path / "run.csv")
    few = thinned(aligned, 100)
    assert len(few.rows) == few.recording.rows == len(few.measured_mm) == 100
    kept = np.searchsorted(aligned.rows.time_s, few.rows.time_s)
    assert ((kept // 12) == np.arange(100)).all()  # one of every twelve
    assert len(np.unique(kept % 12)) > 6  # not in step with anything
    np.testing.assert_array_equal(few.measured_mm, aligned.measured_mm[kept])
    np.testing.assert_array_equal(few.recording.row, aligned.recording.row[kept])
    np.testing.assert_array_equal(few.predicted_mm({}), aligned.predicted_mm({})[kept])
    bed = aligned.rows.quantities["temperature_bed_degC"]
    np.testing.assert_array_equal(few.rows.quantities["temperature_bed_degC"], bed[kept])


def test_it_is_the_same_each_time(tmp_path: Path) -> None:
    aligned = recording(tmp_path / "run.csv")
    np.testing.assert_array_equal(thinned(aligned, 100).rows.time_s, thinned(aligned, 100).rows.time_s)


@pytest.mark.parametrize("rows_of_visit", [2, 3, 5])
def test_visits_stay_whole(tmp_path: Path, rows_of_visit: int) -> None:
    few = thinned(recording(tmp_path / "run.csv", rows_of_visit), 120)
    visit = few.recording.visit
    assert visit is not None
    assert np.unique(visit, return_counts=True)[1].tolist() == [rows_of_visit] * (120 // rows_of_visit)


def test_every_session_begins_with_its_first_row_that_was_kept(tmp_path: Path) -> None:
    few = thinned(recording(tmp_path / "run.csv"), 100)
    assert np.flatnonzero(few.rows.session_start).tolist() == [0, 25, 50, 75]


def test_the_residual_and_its_noise_are_about_those_of_all_rows(tmp_path: Path) -> None:
    aligned = recording(tmp_path / "run.csv", 2)
    everything, few = compare(aligned), compare(thinned(aligned, 400))
    assert few.rms_um == pytest.approx(everything.rms_um, rel=0.1)
    assert few.floor.um == pytest.approx(everything.floor.um, rel=0.1)
