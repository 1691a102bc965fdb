"""How rows are divided for cross-validation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.comparison import open_recording
from compd.diagnosis.search.cross_validation import row_splits
from compd.diagnosis.search_criteria import FoldCriteria
from compd.errors import RecordingError
from tests.support.external import Floats, measured_places, write_external
from tests.support.hidden_effects import record_with_effects


def splits(directory: Path, columns: dict[str, Floats], folds: str | list[str] | None = None):  # type: ignore[no-untyped-def]
    return row_splits(open_recording(write_external(directory, columns, folds=folds)))


def test_folds_keep_points_and_sessions_whole(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {})
    by_session, by_sector = row_splits(aligned)
    assert len(np.unique(by_session)) == 4
    assert len(np.unique(by_sector)) == FoldCriteria.sectors
    point, session = aligned.recording.point, aligned.recording.session
    assert point is not None
    assert session is not None
    for labels, fold in ((session, by_session), (point, by_sector)):
        assert all(len(np.unique(fold[labels == label])) == 1 for label in np.unique(labels))


def test_of_many_sessions_neighbours_are_left_out_together(tmp_path: Path) -> None:
    """Memory grows with the folds: a thousand sessions would take gigabytes."""
    session = np.arange(120) // 2
    by_time = splits(tmp_path, {**measured_places(), "session": session.astype(float)})[0]
    assert len(np.unique(by_time)) == FoldCriteria.max_folds
    assert (np.diff(by_time) >= 0).all()
    assert all(len(np.unique(by_time[session == label])) == 1 for label in np.unique(session))


def test_places_without_points_are_divided_into_sectors(tmp_path: Path) -> None:
    columns = measured_places()
    by_time, by_sector = splits(tmp_path, columns)
    assert len(np.unique(by_time)) == 8
    assert np.bincount(by_sector).tolist() == [24] * 5
    assert (by_sector[:60] == by_sector[60:]).all()  # the same place measured again
    x, y = (columns[f"model_{axis}_mm"] - columns[f"model_{axis}_mm"].mean() for axis in "xy")
    assert (np.diff(by_sector[np.argsort(np.arctan2(y, x))]) >= 0).all()


def test_visits_without_points_lie_in_one_sector(tmp_path: Path) -> None:
    visit = np.arange(120) // 2
    columns = {name: values[visit] for name, values in measured_places().items()}
    columns["reference_x_mm"] += 1e-4 * (np.arange(120) % 2)  # the same row twice is one
    by_sector = splits(tmp_path, {**columns, "visit": visit.astype(float)})[1]
    assert (by_sector[::2] == by_sector[1::2]).all()


def test_one_axis_has_no_sectors_and_folds_by_place_say_so(tmp_path: Path) -> None:
    columns = {name: values for name, values in measured_places().items() if "_y_" not in name}
    assert len(splits(tmp_path, columns)) == 1
    with pytest.raises(RecordingError, match="does not divide the rows") as error:
        splits(tmp_path, columns, "place")
    assert "two axes" in str(error.value)


def test_an_axis_that_hardly_moves_is_none(tmp_path: Path) -> None:
    columns = measured_places()
    for name in ("model_y_mm", "reference_y_mm"):
        columns[name] = columns[name] * 1e-4
    assert len(splits(tmp_path, columns)) == 1


def test_folds_by_a_column_leave_out_each_of_its_values(tmp_path: Path) -> None:
    columns = measured_places()
    (by_hole,) = splits(tmp_path, columns, "hole_mm")
    assert by_hole.tolist() == np.unique(columns["hole_mm"], return_inverse=True)[1].tolist()


def test_folds_by_a_quantity_are_classes_that_keep_visits_whole(tmp_path: Path) -> None:
    visit = np.arange(120) // 3
    columns = {name: values[visit] for name, values in measured_places().items()}
    room = np.cumsum(np.random.default_rng(6).normal(0, 0.1, 120))
    room[30:33] = np.nan
    columns |= {"visit": visit.astype(float), "temperature_room_degC": room}
    by_place, by_class = splits(tmp_path, columns, ["place", "temperature_room_degC"])
    assert by_place.max() == 4
    assert by_class.max() == 8  # eight classes, and the empty cells
    assert set(np.flatnonzero(by_class == 8)) == {30, 31, 32}
    assert all(len(np.unique(by_class[visit == k])) == 1 for k in range(40))


def test_folds_by_a_column_that_never_changes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="does not divide the rows"):
        splits(tmp_path, {**measured_places(), "hole_mm": np.full(120, 2.0)}, "hole_mm")


def test_folds_by_a_column_that_is_not_there_are_refused_with_the_columns(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="time, place, hole_mm"):
        splits(tmp_path, measured_places(), ["time", "bore_mm"])


@pytest.mark.parametrize("folds", [3, [], [""], {"by": "place"}])
def test_folds_that_name_nothing_are_refused(tmp_path: Path, folds: object) -> None:
    with pytest.raises(RecordingError, match="folds: names nothing to leave out"):
        splits(tmp_path, measured_places(), folds)  # type: ignore[arg-type]


def test_where_each_block_of_time_has_a_height_of_its_own_every_fold_has_a_part_of_each(tmp_path: Path) -> None:
    """Measured height by height, a block that is left out lies beyond the others."""
    columns = measured_places()
    block = np.arange(120) * FoldCriteria.blocks // 120
    by_height = splits(tmp_path, {**columns, "height_mm": 100.0 * block})[0]
    assert all(len(np.unique(by_height[block == k])) == FoldCriteria.blocks for k in range(FoldCriteria.blocks))
    warm = splits(tmp_path, {**columns, "temperature_frame_degC": 20.0 + block})[0]
    assert (warm == block).all()  # what warms up with time is what folds of time test
