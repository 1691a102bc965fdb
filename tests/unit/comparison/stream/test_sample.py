"""The sample of a long recording: evenly drawn, whole visits, observed as in the whole recording."""

from __future__ import annotations

import numpy as np
import pytest

from compd.comparison.alignment.align_recording import align_recording
from compd.comparison.stream.sample import draw_sample
from compd.recording import Recording, read_recording
from tests.support.measured import gauges, record, tripod
from tests.support.streams import in_blocks

ROWS = 600


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    columns = gauges(ROWS, 3)
    columns["time_s"] = np.arange(ROWS) * 0.2  # so close that speeds are known
    return read_recording(record(tmp_path_factory.mktemp("sample"), columns), tripod())


def test_a_row_of_the_sample_is_observed_between_its_own_neighbours(recording: Recording) -> None:
    whole = align_recording(recording, tripod())
    sample = draw_sample(in_blocks(recording, tripod(), 70), 90)
    kept = np.searchsorted(recording.row, sample.aligned.recording.row)
    np.testing.assert_array_equal(sample.aligned.rows.velocity_mm_per_s, whole.rows.velocity_mm_per_s[kept])
    np.testing.assert_array_equal(sample.aligned.rows.tip_M_mm, whole.rows.tip_M_mm[kept])
    np.testing.assert_array_equal(sample.aligned.measured_mm, whole.measured_mm[kept])


def test_it_is_spread_evenly_with_whole_visits(recording: Recording) -> None:
    sample = draw_sample(in_blocks(recording, tripod(), 70), 90)
    chosen = sample.aligned.recording
    assert 60 <= chosen.rows <= 120
    assert np.diff(chosen.time_s).max() < 8.0
    assert recording.visit is not None
    assert chosen.visit is not None
    inside = np.unique(chosen.visit)[1:-1]
    edges = recording.visit[69::70]  # a visit may be cut where a block ends
    for visit in inside[~np.isin(inside, edges)]:
        assert (chosen.visit == visit).sum() == (recording.visit == visit).sum()


def test_it_is_the_same_each_time_and_counts_all_rows(recording: Recording) -> None:
    first, second = (draw_sample(in_blocks(recording, tripod(), 70), 90) for _ in range(2))
    assert first.aligned.recording.row.tolist() == second.aligned.recording.row.tolist()
    assert first.rows == ROWS
    assert first.rows_of_session == {1: 150, 2: 150, 3: 150, 4: 150}
    assert (first.begin_s, first.end_s) == (0.0, recording.time_s[-1])


def test_a_short_recording_is_its_own_sample(recording: Recording) -> None:
    sample = draw_sample(in_blocks(recording, tripod(), 70))
    assert sample.aligned.recording.row.tolist() == recording.row.tolist()
    assert sample.aligned.rows.session_start.sum() == 4
