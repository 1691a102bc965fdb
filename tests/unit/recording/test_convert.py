"""A recording in the other format has the same numbers in the same rows."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from compd.cli.measurements.recording.recording import recording as recording_command
from compd.errors import RecordingError
from compd.recording.convert import convert_recording
from compd.recording.open_part import OpenPartFormat, close_part
from tests.support.recordings import csv_text, rename_column, set_cell, write_recording_files


def test_there_and_back_every_row_is_as_it_was(tmp_path: Path) -> None:
    text = csv_text().replace("\n100,", "\n\n100,")
    text = set_cell(3, "joint_1_um", "")(rename_column("visit", "point")(text))
    text = set_cell(5, "frame_t1_um", "0.30000000000000004")(set_cell(9, "visit", "A1")(text))
    csv = write_recording_files(tmp_path, text.replace("A1", '"A, 1"'))
    parquet, back = tmp_path / "copy.parquet", tmp_path / "back.csv"
    progress: list[int] = []
    assert convert_recording(csv, parquet, progress=progress.append) == 21
    assert progress == [21]
    assert convert_recording(parquet, back) == 21
    again = tmp_path / "again.parquet"
    convert_recording(back, again)
    assert pq.read_table(again).equals(pq.read_table(parquet))
    assert pq.read_table(parquet)["point"][7].as_py() == "A, 1"
    assert pq.read_table(parquet)["time_s"].null_count == 1
    rows = [line.split(",") for line in back.read_text().splitlines()]
    assert rows[4][rows[0].index("frame_t1_um")] == "0.30000000000000004"
    assert rows[11] == [""] * len(rows[0]), "the empty row keeps its place"
    assert {path.read_bytes() for path in tmp_path.glob("*.yaml")} == {csv.with_suffix(".yaml").read_bytes()}


def test_beside_the_source_they_share_the_sidecar(tmp_path: Path) -> None:
    csv = write_recording_files(tmp_path, csv_text())
    written = csv.with_suffix(".yaml").stat().st_mtime_ns
    result = CliRunner().invoke(recording_command, ["convert", str(csv), str(csv.with_suffix(".parquet"))])
    assert (result.exit_code, result.output) == (0, f"written: {csv.with_suffix('.parquet')}, 20 rows\n")
    assert csv.with_suffix(".yaml").stat().st_mtime_ns == written


def test_what_cannot_be_converted_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    csv = write_recording_files(tmp_path, set_cell(7, "joint_4_um", "abc")(csv_text()))
    target = tmp_path / "copy.parquet"
    for source, destination, wanted in (
        (csv, target, "row 7: text where a number belongs"),
        (csv, tmp_path / "copy.xlsx", "allowed: .parquet"),
        (csv, csv, "allowed: .parquet"),
        (tmp_path / "other.csv", target, "the sidecar is missing"),
    ):
        with pytest.raises(RecordingError, match=wanted):
            convert_recording(source, destination)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.csv", "run.yaml"]
    target.write_text("mine")
    with pytest.raises(RecordingError, match="is there already"):
        convert_recording(write_recording_files(tmp_path, csv_text()), target)
    assert target.read_text() == "mine"
    convert_recording(csv, target, overwrite=True)
    assert pq.read_table(target).num_rows == 20


def test_an_open_part_is_read_to_its_last_whole_batch_wherever_it_was_cut(tmp_path: Path) -> None:
    path = tmp_path / "run-0001.arrow"
    part = OpenPartFormat(path, ["time_s", "scale_1_mm"])
    batches = [part.batch({"time_s": [float(i), i + 0.5], "scale_1_mm": [None, 0.1]}) for i in range(3)]
    (tmp_path / "run-0001.yaml").write_text("machine: tripod-cmm\n")
    whole = part.head + b"".join(batches)
    for cut in range(len(part.head), len(whole) + 1, 7):
        path.write_bytes(whole[:cut])
        convert_recording(path, path.with_suffix(".parquet"), overwrite=True)
        table = pq.read_table(path.with_suffix(".parquet"))
        assert (
            table["time_s"].to_pylist()
            == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5][: (cut - len(part.head)) // len(batches[0]) * 2]
        )
    path.write_bytes(whole[:50])
    with pytest.raises(RecordingError, match="ends before its first row"):
        close_part(path, path.with_suffix(".parquet"))
    assert pa.types.is_float64(table["scale_1_mm"].type)
