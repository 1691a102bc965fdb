"""A recording block by block is the recording as a whole, in pieces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from compd.errors import RecordingError
from compd.recording.blocks import recording_blocks
from compd.recording.convert import convert_recording
from compd.recording.reader import read_recording
from compd.table_file import row_count
from tests.support.recordings import (
    HEADER,
    SIDECAR,
    Edit,
    csv_text,
    drop_columns,
    set_cell,
    set_column,
    write_recording_files,
)

PINS = "machine: tripod-cmm\nreference: {quantity: fixed_point}\n"
NO_TIP = drop_columns("reference_x_mm", "reference_y_mm", "reference_z_mm")


def with_pins(text: str, *pins: str) -> str:
    """A column `pin`; the names in turn."""
    header, *lines = NO_TIP(text).splitlines()
    named = [f"{line},{pins[i % len(pins)]}" for i, line in enumerate(lines)]
    return "\n".join([f"{header},pin", *named]) + "\n"


def problems_of(path: Path, rows: int = 6) -> str:
    with pytest.raises(RecordingError) as refused:
        list(recording_blocks(path, rows=rows))
    return str(refused.value)


VARIANTS: dict[str, tuple[Edit, str]] = {
    "plain": (lambda text: text, SIDECAR),
    "quoted": (lambda text: text.replace("20.104", '"20.104"'), SIDECAR),
    "an empty row between blocks": (lambda text: text.replace("\n50,", "\n\n50,"), SIDECAR),
    "a block of empty rows": (lambda text: text.replace("\n50,", 14 * "\n" + "50,"), SIDECAR),
    "a row without time": (set_cell(4, "time_s", ""), SIDECAR),
    "excluded rows": (lambda text: text, SIDECAR + "excluded_rows: [{rows: [3, 21], reason: dust}]\n"),
    "names that appear late": (lambda text: with_pins(text, *"77777776", "left"), PINS),
    "without a line end": (lambda text: text[:-1], SIDECAR),
}


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize("name", VARIANTS)
def test_blocks_are_the_whole(tmp_path: Path, name: str, suffix: str) -> None:
    edit, sidecar = VARIANTS[name]
    path = write_recording_files(tmp_path, edit(csv_text()), sidecar)
    if suffix == ".parquet":
        convert_recording(path, path.with_suffix(suffix))
        path = path.with_suffix(suffix)
    whole = read_recording(path)
    blocks = list(recording_blocks(path, rows=6))
    assert len(blocks) >= 4
    assert {block.sha256 for block in blocks} == {whole.sha256}
    assert [block.labels for block in blocks] == [whole.labels] * len(blocks)
    for field in ("row", "time_s", "scale_mm", "joint_mm", "approach", "excluded", "reference_mm", "pin"):
        values = getattr(whole, field)
        if values is not None:
            joined = np.concatenate([getattr(block, field) for block in blocks])
            assert np.array_equal(joined, values, equal_nan=True), field
    left_out: dict[str, int] = {}
    for block in blocks:
        for reason, count in block.left_out.items():
            left_out[reason] = left_out.get(reason, 0) + count
    assert left_out == whole.left_out
    assert row_count(path) == whole.row[-1] - 1


def test_of_parquet_no_more_than_a_block_is_in_the_memory(tmp_path: Path) -> None:
    rows = 40_000
    columns = {name: np.random.default_rng(1).uniform(-60.0, 60.0, rows) for name in HEADER}
    columns |= {"time_s": np.arange(rows, dtype=float), "session": np.ones(rows), "visit": np.arange(rows, dtype=float)}
    path = write_recording_files(tmp_path, "").with_suffix(".parquet")
    pq.write_table(pa.table(columns), path, row_group_size=1000)
    held = [pa.total_allocated_bytes() for _ in recording_blocks(path, rows=1000)]
    assert len(held) == 40
    assert max(held) < path.stat().st_size / 4


def test_rows_without_time_are_numbered_on(tmp_path: Path) -> None:
    lines = ["model_z_mm,reference_z_mm", *(f"{i},{i + 0.5}" for i in range(10))]
    sidecar = "machine: external\nreference: {quantity: tool_position, frame: machine}\n"
    path = write_recording_files(tmp_path, "\n".join(lines), sidecar)
    assert [block.time_s.tolist() for block in recording_blocks(path, rows=4)] == [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9]]


def test_a_time_that_does_not_rise_is_refused_within_a_block_and_between_two(tmp_path: Path) -> None:
    for row in (6, 8):
        path = write_recording_files(tmp_path, set_cell(row, "time_s", "5")(csv_text()))
        message = problems_of(path)
        assert f"column time_s (A), row {row}: does not rise" in message
        assert "sort the rows" in message


def test_a_wrong_cell_is_told_with_its_row_in_the_file(tmp_path: Path) -> None:
    path = write_recording_files(tmp_path, set_cell(15, "joint_4_um", "abc")(csv_text()))
    blocks = recording_blocks(path, rows=6)
    assert [next(blocks).rows, next(blocks).rows] == [6, 6], "the rows before are whole"
    with pytest.raises(RecordingError, match=r"column joint_4_um \(J\), row 15: text"):
        next(blocks)
    broken = "\n".join(csv_text().splitlines()[:14]) + '\n130,"1\n'
    assert "line 15: not CSV" in problems_of(write_recording_files(tmp_path, broken))


def test_what_only_the_whole_shows_is_told_at_the_end(tmp_path: Path) -> None:
    path = write_recording_files(tmp_path, csv_text(), SIDECAR + "excluded_rows: [{row: 30, reason: dust}]\n")
    assert "row 30 of the file: no such row\n    allowed: rows 2 to 21" in problems_of(path)
    path = write_recording_files(tmp_path, set_column("reference_x_mm", "")(csv_text()))
    assert "no row of 20 can be used: 20 without reference_x_mm" in problems_of(path)
    small = csv_text()
    for k in range(1, 10):
        small = set_column(f"joint_{k}_um", "0.01")(small)
    *others, last = recording_blocks(write_recording_files(tmp_path, small), rows=6)
    assert not any(block.warnings for block in others)
    assert "no joint comparator ever moves" in str(last.warnings[0])


def test_a_file_that_is_not_there_or_empty_is_told(tmp_path: Path) -> None:
    path = write_recording_files(tmp_path, "")
    assert "is empty" in problems_of(path)
    assert row_count(path) == 0
    path.unlink()
    for suffix in (".csv", ".parquet"):
        assert "cannot be read: No such file" in problems_of(path.with_suffix(suffix))
        with pytest.raises(RecordingError, match="cannot be read: No such file"):
            row_count(path.with_suffix(suffix))
