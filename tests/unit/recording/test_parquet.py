"""Parquet beside CSV: the same recording, the same checks, and what is no such file is told."""

from __future__ import annotations

import builtins
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from compd.errors import RecordingError
from compd.recording.reader import read_recording
from compd.recording.recording import Recording
from compd.recording.sidecar import sidecar_contents
from compd.recording.writer import write_recording
from compd.tables import ParquetTable
from tests.support.recordings import csv_text, write_recording_files


def as_parquet(csv: Path, **replaced: Any) -> Path:
    """The same table as Parquet in a directory of its own, some columns replaced by others."""
    path = csv.parent / "parquet" / "run.parquet"
    path.parent.mkdir(exist_ok=True)
    columns = {**read_recording(csv).columns, **replaced}
    pq.write_table(pa.table({name: values for name, values in columns.items() if values is not None}), path)
    path.with_suffix(".yaml").write_bytes(csv.with_suffix(".yaml").read_bytes())
    return path


def problems_of(path: Path) -> str:
    with pytest.raises(RecordingError) as refused:
        read_recording(path)
    return str(refused.value)


def assert_same(one: Recording, other: Recording) -> None:
    assert one.row.tolist() == other.row.tolist()
    assert list(one.columns) == list(other.columns)
    for name, values in one.columns.items():
        assert np.array_equal(values, other.columns[name], equal_nan=True), name
    assert one.left_out == other.left_out


def test_it_is_the_recording_of_the_csv_file(tmp_path: Path) -> None:
    csv = write_recording_files(tmp_path, csv_text().replace(",20.104,", ",,", 1))
    parquet = read_recording(as_parquet(csv))
    assert_same(parquet, read_recording(csv))
    assert np.isnan(parquet.quantities["temperature_room_degC"][0])
    assert read_recording(parquet.path.with_suffix(".yaml")).sha256 == parquet.sha256
    assert parquet.sha256 != read_recording(csv).sha256


def test_null_nan_other_numbers_and_empty_rows_are_what_they_are_in_a_csv_file(tmp_path: Path) -> None:
    csv = write_recording_files(tmp_path, csv_text())
    columns = read_recording(csv).columns
    table = pa.table({name: [*values[:3].tolist(), None, *values[3:].tolist()] for name, values in columns.items()})
    whole = [*range(1, 4), None, *range(4, 21)]
    for name, kind in (("visit", pa.int32()), ("pressure_hPa", pa.float32())):
        table = table.set_column(table.schema.get_field_index(name), name, pa.array(whole, kind))
    path = as_parquet(csv)
    pq.write_table(table, path)
    recording = read_recording(path)
    assert recording.left_out == {"empty row": 1}
    assert recording.row.tolist() == [2, 3, 4, *range(6, 23)]
    assert recording.visit is not None
    assert recording.visit.tolist() == list(range(1, 21))


def test_rows_that_pandas_selected_are_read_without_their_labels(tmp_path: Path) -> None:
    csv = write_recording_files(tmp_path, csv_text())
    path = as_parquet(csv)
    rows = pd.read_parquet(path)
    rows[rows["visit"] != 2].to_parquet(path)
    assert "__index_level_0__" in pq.read_schema(path).names
    selected = read_recording(path)
    assert list(selected.columns) == list(read_recording(csv).columns)
    assert 2 not in selected.columns["visit"]
    blocks = pd.concat([pd.DataFrame(block.table.columns) for block in ParquetTable(path).blocks(3)])
    assert blocks["time_s"].tolist() == selected.columns["time_s"].tolist()


@pytest.mark.parametrize("kind", [pa.string(), pa.large_string(), pa.dictionary(pa.int32(), pa.string())])
def test_text_names_points_and_nothing_else(tmp_path: Path, kind: Any) -> None:
    csv = write_recording_files(tmp_path, csv_text())
    names = pa.array([f"P{i % 3}" if i else None for i in range(20)]).cast(kind)
    recording = read_recording(as_parquet(csv, point=names))
    assert recording.labels == {"point": ("P0", "P1", "P2")}
    assert recording.point is not None
    assert recording.point[:5].tolist() == [-1, 1, 2, 0, 1]
    numbers = read_recording(as_parquet(csv, point=pa.array([str(i) for i in range(20)])))
    assert (numbers.labels, numbers.point.tolist()) == ({}, list(range(20)))  # type: ignore[union-attr]
    assert "column visit: holds no numbers" in problems_of(as_parquet(csv, visit=names))


def test_columns_that_are_no_numbers_and_infinite_numbers_are_told(tmp_path: Path) -> None:
    csv = write_recording_files(tmp_path, csv_text())
    times = pa.array(range(20), pa.timestamp("us"))
    message = problems_of(as_parquet(csv, time_s=times))
    assert "column time_s: holds no numbers" in message
    assert "timestamp[us]" in message
    assert "seconds from the start" in message
    infinite = np.where(np.arange(20) == 4, np.inf, 1.0)
    message = problems_of(as_parquet(csv, joint_3_um=infinite))
    assert "column joint_3_um, row 6: not a finite number" in message


def test_checks_are_those_of_csv(tmp_path: Path) -> None:
    csv = write_recording_files(tmp_path, csv_text())
    assert "missing: joint_8_um" in problems_of(as_parquet(csv, joint_8_um=None))
    assert "column approach_1, rows 2, 3, 4 and 17 more" in problems_of(as_parquet(csv, approach_1=np.full(20, 0.5)))


@pytest.mark.parametrize("content", [b"", b"time_s,session\n", b"PAR1" + b"x" * 100])
def test_what_is_no_parquet_is_told(tmp_path: Path, content: bytes) -> None:
    path = write_recording_files(tmp_path, "").with_suffix(".parquet")
    path.write_bytes(content)
    assert "is no Parquet file, or a part of one" in problems_of(path)


def test_a_file_that_is_cut_off_damaged_or_not_there_is_told(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    columns = read_recording(write_recording_files(tmp_path, csv_text(400))).columns
    write_recording(
        path, columns, sidecar_contents("tripod-cmm", {"quantity": "tool_position", "frame": "machine"}), overwrite=True
    )
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    assert "is no Parquet file, or a part of one" in problems_of(path)
    path.write_bytes(content[:2000] + bytes(100) + content[2100:])
    assert "its end is missing or damaged" in problems_of(path)
    assert "cannot be read: No such file" in problems_of(path.with_name("other.parquet"))
    path.with_suffix(".csv").write_bytes(content)
    assert "name it NAME.parquet" in problems_of(path.with_suffix(".csv"))


def test_a_sidecar_beside_two_tables_names_neither(tmp_path: Path) -> None:
    csv = write_recording_files(tmp_path, csv_text())
    csv.with_suffix(".parquet").write_bytes(as_parquet(csv).read_bytes())
    assert "is beside two tables" in problems_of(csv.with_suffix(".yaml"))


def test_what_is_written_has_units_and_is_read_back(tmp_path: Path) -> None:
    csv = read_recording(write_recording_files(tmp_path, csv_text()))
    path = tmp_path / "written.parquet"
    write_recording(
        path, csv.columns, sidecar_contents("tripod-cmm", {"quantity": "tool_position", "frame": "machine"})
    )
    assert_same(read_recording(path), csv)
    schema = pq.read_schema(path)
    assert schema.metadata == {b"compd.format": b"3"}
    assert [schema.field(name).metadata for name in ("scale_1_mm", "session", "pressure_hPa")] == [
        {b"unit": b"mm"},
        {b"unit": b""},
        {b"unit": b"hPa"},
    ]
    assert path.stat().st_mode & 0o777 == 0o644
    assert sorted(file.name for file in tmp_path.iterdir()) == [
        "run.csv",
        "run.yaml",
        "written.parquet",
        "written.yaml",
    ]


def test_without_pyarrow_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = as_parquet(write_recording_files(tmp_path, csv_text()))
    imported = builtins.__import__

    def without_pyarrow(name: str, *arguments: Any) -> Any:
        if name.startswith("pyarrow"):
            raise ImportError(name)
        return imported(name, *arguments)

    monkeypatch.setattr(builtins, "__import__", without_pyarrow)
    assert "pip install 'compd[parquet]'" in problems_of(path)
    with pytest.raises(RecordingError, match="pyarrow is not installed"):
        write_recording(tmp_path / "new.parquet", {"time_s": [0, 1]}, {"machine": "x"})
    assert not (tmp_path / "new.yaml").exists()
