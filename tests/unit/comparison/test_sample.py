"""A sample of a long recording is compared as a recording in memory, and says what it leaves uncertain."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import compd
from compd.comparison import AlignedRecording, thinned
from compd.comparison.recording_comparison import compare
from compd.comparison.sampling_error import drawn_together, rms_standard_error
from compd.recording import sample
from tests.support.fixed_end_recordings import DISTANCE, PINS
from tests.support.fixed_end_recordings import recorded as recorded_from_places
from tests.support.measured import gauges, hidden, record, tripod
from tests.support.pose_recordings import hexapod, poses

ROWS = 600
EFFECTS = [
    hidden("link_expansion", 0.9),
    hidden("link_expansion_lag", 0.3, tau=900.0),
    replace(hidden("backlash", 0.9, 1.1, 0.8), covariance=np.eye(3)),
]


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sample, "BLOCK_ROWS", 70)


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    columns = gauges(ROWS, 3)
    columns["time_s"] = np.arange(ROWS) * 0.2  # so close that speeds are known
    return record(tmp_path, columns, EFFECTS)


def test_a_row_of_the_sample_is_observed_between_its_own_neighbours(recorded: Path) -> None:
    whole, drawn = compd.open_recording(recorded), compd.open_sample(recorded, rows=90)
    assert 60 <= drawn.recording.rows <= 120
    kept = np.searchsorted(whole.recording.row, drawn.recording.row)
    np.testing.assert_array_equal(drawn.rows.velocity_mm_per_s, whole.rows.velocity_mm_per_s[kept])
    np.testing.assert_array_equal(drawn.rows.tip_M_mm, whole.rows.tip_M_mm[kept])
    np.testing.assert_array_equal(drawn.measured_mm, whole.measured_mm[kept])
    np.testing.assert_array_equal(drawn.rows.time_s, whole.rows.time_s[kept])


def test_it_is_the_same_each_time_and_has_rows_of_every_session(recorded: Path) -> None:
    first, second = (compd.open_sample(recorded, rows=90) for _ in range(2))
    assert first.recording.row.tolist() == second.recording.row.tolist()
    assert np.diff(first.recording.time_s).max() < 8.0
    assert np.unique(first.recording.session).tolist() == [1, 2, 3, 4]
    assert first.rows.session_start.sum() == 4


def test_a_short_recording_is_its_own_sample(recorded: Path) -> None:
    drawn = compd.open_sample(recorded)
    assert drawn.recording.sample is None
    assert compare(drawn).as_json() == compare(compd.open_recording(recorded)).as_json()


PLACES: dict[str, tuple[Any, Any]] = {
    "fixed balls": (DISTANCE, tripod),
    "pins": (PINS, tripod),
    "attitudes, in the machine's frame": (False, hexapod),
    "attitudes, in the instrument's frame": (True, hexapod),
}


@pytest.mark.parametrize("name", PLACES)
def test_what_is_placed_from_the_recording_itself_is_placed_by_the_sample(tmp_path: Path, name: str) -> None:
    reference, machine = PLACES[name]
    effects = [hidden("link_elasticity", 20.0)]
    if isinstance(reference, dict):
        path = recorded_from_places(tmp_path, reference, tuple(effects))
    else:
        path = poses(tmp_path, tuple(effects), moved=reference)
    whole = compare(compd.open_recording(path, machine()), effects)
    few = compare(compd.open_sample(path, machine(), rows=90), effects)
    assert few.rows < 0.8 * whole.rows
    np.testing.assert_allclose(few.rms_by_axis_um, whole.rms_by_axis_um, rtol=0.2)


def wrong_by(recorded: Path, rows: int) -> tuple[float, float, AlignedRecording]:
    """Difference of a sample's rms and that of all rows, um; and the standard error that is told."""
    whole, drawn = compare(compd.open_recording(recorded)), compare(compd.open_sample(recorded, rows=rows))
    return drawn.rms_um - whole.rms_um, drawn.rms_sampling_error_um, drawn.aligned


@pytest.mark.parametrize("rows", [90, 200])
def test_its_standard_error_is_told(recorded: Path, rows: int) -> None:
    difference_um, error_um, aligned = wrong_by(recorded, rows)
    assert abs(difference_um) < 3 * error_um
    comparison = compare(aligned)
    report = comparison.as_json()["sample"]
    assert (report["rows"], report["of"]) == (aligned.recording.rows, ROWS)
    assert report["residual_rms_standard_error_um"] == error_um
    assert report["residual_rms_standard_error_xyz_um"].keys() == {"x", "y", "z"}
    assert f"{aligned.recording.rows:,} of {ROWS:,} rows over 0.0333 h were compared: a sample." in comparison.basis
    assert f"An event shorter than about {report['longest_gap_s']:.2g} s" in comparison.basis


def test_of_fewer_rows_than_were_drawn_these_are_told(recorded: Path) -> None:
    drawn = compd.open_sample(recorded, rows=200)
    thin = compare(thinned(drawn, drawn.recording.rows // 2)).as_json()["sample"]
    whole = compare(drawn).as_json()["sample"]
    assert thin["rows"] == pytest.approx(whole["rows"] / 2, abs=8)
    assert thin["longest_gap_rows"] == pytest.approx(2 * whole["longest_gap_rows"], rel=0.1)
    assert thin["residual_rms_standard_error_um"] > whole["residual_rms_standard_error_um"]


@pytest.mark.parametrize("of_visit", [1, 4])
def test_the_standard_error_is_the_scatter_of_many_samples(of_visit: int) -> None:
    rng = np.random.default_rng(1)
    groups, picked = 3000, 300
    visit = np.repeat(np.arange(groups), of_visit)
    size = np.repeat(rng.uniform(0.5, 2.0, groups), of_visit)[:, None]
    residual = size * rng.normal(0.0, 1.0, (len(visit), 3))
    rms, errors = [], []
    for _ in range(300):
        rows = np.isin(visit, rng.choice(groups, picked, replace=False))
        rms.append(np.sqrt(np.mean(residual[rows] ** 2)))
        errors.append(rms_standard_error(residual[rows], visit[rows], len(visit)))
    assert np.mean(errors) == pytest.approx(np.std(rms), rel=0.12)


def test_all_rows_leave_nothing_uncertain_and_one_visit_everything() -> None:
    residual = np.random.default_rng(2).normal(0.0, 1.0, (40, 2))
    assert rms_standard_error(residual, drawn_together(None, 40), 40) == 0.0
    assert np.isnan(rms_standard_error(residual, drawn_together(np.zeros(40, dtype=np.int64), 40), 400))
    assert rms_standard_error(residual * 0.0, drawn_together(None, 40), 400) == 0.0
