"""Recordings of one machine are merged into one, and nothing of two recordings is taken for the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from compd.errors import RecordingError
from compd.recording.convert import convert_recording
from compd.recording.merge import ASSUMED_GAP_S, merge_recordings
from compd.recording.reader import read_recording
from compd.recording.recording import Recording
from tests.support.recordings import SIDECAR, csv_text, drop_columns, write_recording_files

STARTED = "provenance: {started_at: '2026-05-03T08:00:00+00:00', zero_taken_at: morning}\n"
AN_HOUR_LATER = STARTED.replace("08:00", "09:00")


def recording(directory: Path, text: str, sidecar: str = SIDECAR) -> Recording:
    directory.mkdir()
    return read_recording(write_recording_files(directory, text, sidecar))


def test_rows_follow_each_other_and_ids_are_numbered_on(tmp_path: Path) -> None:
    first = recording(tmp_path / "first", csv_text(), SIDECAR + "excluded_rows: [{row: 3, reason: door}]\n")
    second = recording(
        tmp_path / "second",
        drop_columns("session", "pressure_hPa")(csv_text(6)),
        SIDECAR + "excluded_rows: [{row: 2, reason: lamp}]\n",
    )
    result = merge_recordings([first, second], tmp_path / "both.csv")
    both = read_recording(tmp_path / "both.csv")
    assert result.rows == (20, 6)
    assert not result.gap_known
    assert result.starts_s == (0.0, 190.0 + ASSUMED_GAP_S)
    assert both.time_s[20:].tolist() == [190.0 + ASSUMED_GAP_S + 10 * i for i in range(6)]
    assert both.session is not None
    assert both.session.tolist() == [1] * 10 + [2] * 10 + [3] * 6
    assert both.visit is not None
    assert both.visit[20:].tolist() == [11, 11, 12, 12, 13, 13]
    assert np.isnan(both.columns["pressure_hPa"][20:]).all()
    assert both.sidecar.excluded == {3: "door", 22: "lamp"}
    assert [part["sha256"] for part in both.sidecar.provenance["merge"]] == [first.sha256, second.sha256]
    assert both.reference == first.reference


def test_the_gap_is_from_the_sidecars_where_both_say_when_they_began(tmp_path: Path) -> None:
    first = recording(tmp_path / "first", csv_text(), SIDECAR + STARTED)
    second = recording(tmp_path / "second", csv_text(), SIDECAR + AN_HOUR_LATER)
    result = merge_recordings([first, second], tmp_path / "both.csv")
    assert result.gap_known
    assert result.starts_s == (0.0, 3600.0)
    backwards = merge_recordings([second, first], tmp_path / "backwards.csv")
    assert not backwards.gap_known


@pytest.mark.parametrize(("other", "named"), [("../mine.yaml", "mine.yaml"), ("../yours.yaml", None)])
def test_the_machine_is_named_where_all_name_the_same(tmp_path: Path, other: str, named: str | None) -> None:
    first = recording(tmp_path / "first", csv_text(), SIDECAR + "machine_file: ../mine.yaml\n")
    second = recording(tmp_path / "second", csv_text(), SIDECAR + f"machine_file: {other}\n")
    merge_recordings([first, second], tmp_path / "both.csv")
    assert yaml.safe_load((tmp_path / "both.yaml").read_text(encoding="utf-8")).get("machine_file") == named


def test_what_does_not_fit_together_is_refused_all_at_once(tmp_path: Path) -> None:
    first = recording(tmp_path / "first", csv_text(), SIDECAR + STARTED)
    second = recording(
        tmp_path / "second",
        csv_text(),
        SIDECAR.replace("tripod-cmm", "mine").replace("frame: machine", "frame: instrument")
        + STARTED.replace("morning", "noon"),
    )
    with pytest.raises(RecordingError) as caught:
        merge_recordings([first, second], tmp_path / "both.csv")
    assert [problem.what for problem in caught.value.problems] == [
        "the instrument's own frame is fitted anew for every recording",
        "is of another machine",
        "has another reference",
        "was recorded from another machine zero",
    ]
    assert not (tmp_path / "both.csv").exists()


def test_of_csv_and_parquet_a_parquet_file_is_made(tmp_path: Path) -> None:
    first = recording(tmp_path / "first", csv_text())
    convert_recording(first.path, tmp_path / "second.parquet")
    merge_recordings([first, read_recording(tmp_path / "second.parquet")], tmp_path / "both.parquet")
    assert read_recording(tmp_path / "both.parquet").rows == 40


def test_recordings_from_other_quantities_at_machine_zero_do_not_go_together(tmp_path: Path) -> None:
    cold, warm = (f"quantities_at_zero: {{temperature_room_degC: {degC}}}\n" for degC in (15, 23))
    first = recording(tmp_path / "first", csv_text(), SIDECAR + cold)
    again = recording(tmp_path / "again", csv_text(6), SIDECAR + cold)
    merge_recordings([first, again], tmp_path / "both.csv")
    assert read_recording(tmp_path / "both.csv").sidecar.quantities_at_zero == {"temperature_room_degC": 15.0}
    for sidecar, value in ((SIDECAR + warm, "temperature_room_degC 23.0"), (SIDECAR, "no `quantities_at_zero:`")):
        other = recording(tmp_path / value[:2], csv_text(6), sidecar)
        with pytest.raises(RecordingError, match="has other quantities at machine zero") as caught:
            merge_recordings([first, other], tmp_path / "not.csv")
        assert value in str(caught.value)
