"""A sample of a recording: drawn in one pass, by groups, each row with the same probability and its neighbours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from compd.errors import RecordingError
from compd.recording import Recording, read_recording, read_sample, sample
from compd.recording.convert import convert_recording
from compd.recording.sample import groups_of_rows
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


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sample, "BLOCK_ROWS", 6)


def drawn(path: Path, rows: int = 1000) -> Recording:
    return read_sample(path, None, rows, 12)


def problems_of(path: Path, rows: int = 4) -> str:
    with pytest.raises(RecordingError) as refused:
        drawn(path, rows)
    return str(refused.value)


def with_pins(text: str, *pins: str) -> str:
    """A column `pin`; the names in turn."""
    header, *lines = NO_TIP(text).splitlines()
    named = [f"{line},{pins[i % len(pins)]}" for i, line in enumerate(lines)]
    return "\n".join([f"{header},pin", *named]) + "\n"


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
def test_a_sample_of_all_rows_is_the_whole(tmp_path: Path, name: str, suffix: str) -> None:
    edit, sidecar = VARIANTS[name]
    path = write_recording_files(tmp_path, edit(csv_text()), sidecar)
    if suffix == ".parquet":
        convert_recording(path, path.with_suffix(suffix))
        path = path.with_suffix(suffix)
    whole, found = read_recording(path), drawn(path)
    assert found.sha256 == whole.sha256
    assert found.labels == whole.labels
    for field in ("row", "time_s", "visit", "scale_mm", "joint_mm", "approach", "excluded", "reference_mm", "pin"):
        values = getattr(whole, field)
        if values is not None:
            assert np.array_equal(getattr(found, field), values, equal_nan=True), field
    assert found.sample is not None
    assert found.sample.row.tolist() == whole.row.tolist()
    assert found.sample.untimed == sum(whole.left_out.values())
    assert row_count(path) == whole.row[-1] - 1


def test_what_is_known_of_all_rows(tmp_path: Path) -> None:
    text = set_cell(9, "reference_x_mm", "")(set_cell(4, "time_s", "")(csv_text(60)))
    found = drawn(write_recording_files(tmp_path, text), 12).sample
    assert found is not None
    assert (found.rows, found.untimed, found.incomplete) == (59, 1, 1)
    assert (found.begin_s, found.end_s) == (0.0, 590.0)
    assert 8 <= len(found.row) <= 16
    gaps = np.diff(np.concatenate([[1], found.row, [62]])) - 1
    assert max(gaps) - 1 <= found.gap_rows <= max(gaps)
    assert found.gap_s == 10.0 * found.gap_rows


def test_directions_follow_from_all_rows(tmp_path: Path) -> None:
    path = write_recording_files(tmp_path, csv_text(90))
    whole, found = read_recording(path), drawn(path, 20)
    assert not whole.approach_measured
    assert whole.approach is not None
    assert found.approach is not None
    assert found.rows < 70
    kept = np.isin(whole.row, found.row)
    np.testing.assert_array_equal(found.approach, whole.approach[kept])


def test_visits_come_whole_and_those_that_return_are_others(tmp_path: Path) -> None:
    again = csv_text(120)
    for row in range(2, 122):
        again = set_cell(row, "visit", str((row - 2) // 2 % 3))(again)
    path = write_recording_files(tmp_path, again)
    whole, found = read_recording(path), drawn(path, 30)
    assert found.sample is not None
    assert whole.visit is not None
    assert found.visit is not None
    of_visit = {int(v): whole.row[whole.visit == v].tolist() for v in whole.visit}
    rows = found.sample.row[np.argsort(found.sample.row)]
    for row in rows:
        pair = next(rows_of for rows_of in of_visit.values() if row in rows_of)
        assert set(pair) <= set(rows.tolist())
    here = np.isin(found.row, rows)
    assert len(np.unique(found.visit[here])) == len(rows) / 2


@pytest.mark.parametrize(("lengths", "most"), [((1, 1, 40, 3, 1, 25), 12), ((2, 2, 2), 12), ((13,), 4)])
def test_groups_are_spread_over_a_long_visit(lengths: tuple[int, ...], most: int) -> None:
    visit = np.repeat(np.arange(len(lengths), dtype=float), lengths)
    group, count = groups_of_rows(visit, None, len(visit), most)
    assert np.unique(group).tolist() == list(range(count))
    for k in range(count):
        rows = np.flatnonzero(group == k)
        assert len(rows) <= most
        assert len(np.unique(visit[rows])) == 1
        assert np.ptp(np.diff(rows)) == 0 if len(rows) > 2 else True
    session = np.where(np.arange(len(visit)) % 2, 1.0, 2.0)
    assert groups_of_rows(visit, session, len(visit), most)[1] == len(visit)
    assert groups_of_rows(visit * np.nan, None, len(visit), most)[1] == len(visit)


def test_rows_of_long_visits_are_not_drawn_more_often(tmp_path: Path) -> None:
    rows = 20_000
    columns = {name: np.random.default_rng(1).uniform(-60.0, 60.0, rows) for name in HEADER}
    visit = np.where(np.arange(rows) % 100 < 60, np.arange(rows) // 100, np.nan)
    columns |= {"time_s": np.arange(rows, dtype=float), "session": np.ones(rows), "visit": visit}
    path = write_recording_files(tmp_path, "").with_suffix(".parquet")
    pq.write_table(pa.table(columns), path)
    found = drawn(path, 4000).sample
    assert found is not None
    assert len(found.row) == pytest.approx(4000, rel=0.1)
    at_rest = ~np.isnan(visit[found.row - 2])
    assert at_rest.mean() == pytest.approx(0.6, abs=0.05)


def test_of_parquet_no_more_than_a_block_is_in_the_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sample, "BLOCK_ROWS", 1000)
    rows = 40_000
    columns = {name: np.random.default_rng(1).uniform(-60.0, 60.0, rows) for name in HEADER}
    columns |= {"time_s": np.arange(rows, dtype=float), "session": np.ones(rows), "visit": np.arange(rows, dtype=float)}
    path = write_recording_files(tmp_path, "").with_suffix(".parquet")
    pq.write_table(pa.table(columns), path, row_group_size=1000)
    held: list[int] = []
    found = read_sample(path, None, 400, 12, lambda done: held.append(pa.total_allocated_bytes()))
    assert len(held) == 40
    assert max(held) < path.stat().st_size / 4
    assert found.rows < 1400


def test_rows_without_time_are_numbered_as_in_the_file(tmp_path: Path) -> None:
    lines = ["model_z_mm,reference_z_mm", *(f"{i},{i + 0.5}" for i in range(50))]
    sidecar = "machine: external\nreference: {quantity: tool_position, frame: machine}\n"
    found = drawn(write_recording_files(tmp_path, "\n".join(lines), sidecar), 10)
    assert not found.has_time
    np.testing.assert_array_equal(found.time_s, found.row - 2)
    assert found.sample is not None
    assert np.isnan(found.sample.gap_s)


def test_a_time_that_does_not_rise_is_refused_within_a_block_and_between_two(tmp_path: Path) -> None:
    for row in (6, 8):
        path = write_recording_files(tmp_path, set_cell(row, "time_s", "5")(csv_text()))
        message = problems_of(path)
        assert f"column time_s (A), row {row}: does not rise" in message
        assert "sort the rows" in message


def test_a_wrong_cell_of_any_row_is_told_with_its_row_in_the_file(tmp_path: Path) -> None:
    for row in range(2, 22, 3):
        path = write_recording_files(tmp_path, set_cell(row, "joint_4_um", "abc")(csv_text()))
        assert f"column joint_4_um (J), row {row}: text" in problems_of(path)
    broken = "\n".join(csv_text().splitlines()[:14]) + '\n130,"1\n'
    assert "line 15: not CSV" in problems_of(write_recording_files(tmp_path, broken))


def test_what_only_the_whole_shows_is_told(tmp_path: Path) -> None:
    path = write_recording_files(tmp_path, csv_text(), SIDECAR + "excluded_rows: [{row: 30, reason: dust}]\n")
    assert "row 30 of the file: no such row\n    allowed: rows 2 to 21" in problems_of(path)
    path = write_recording_files(tmp_path, set_column("reference_x_mm", "")(csv_text()))
    assert "can be used: " in problems_of(path)
    assert "without reference_x_mm" in problems_of(path)


def test_a_file_that_is_not_there_or_empty_is_told(tmp_path: Path) -> None:
    path = write_recording_files(tmp_path, "")
    assert "is empty" in problems_of(path)
    assert row_count(path) == 0
    path.unlink()
    for suffix in (".csv", ".parquet"):
        assert "cannot be read: No such file" in problems_of(path.with_suffix(suffix))
