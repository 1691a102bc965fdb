"""Recordings are found by their sidecars, and nothing else is taken for one."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pandas as pd
import pytest

from compd.errors import CompdError
from compd.fleet.recordings import find_recordings
from tests.support.recordings import SIDECAR


def add(directory: Path, name: str, tables: tuple[str, ...] = (".csv",), sidecar: str = SIDECAR) -> None:
    """A sidecar with tables beside it, all of them empty."""
    directory.mkdir(parents=True, exist_ok=True)
    (directory / f"{name}.yaml").write_text(sidecar)
    for ending in tables:
        (directory / f"{name}{ending}").touch()


def names(*places: Path | str) -> list[str]:
    return [recording.path.name for recording in find_recordings(places).recordings]


def test_a_directory_has_the_recordings_at_any_depth(tmp_path: Path) -> None:
    add(tmp_path, "b")
    add(tmp_path / "2026" / "05", "a", (".parquet",))
    assert names(tmp_path) == ["a.parquet", "b.csv"]


def test_files_beside_recordings_are_none(tmp_path: Path) -> None:
    add(tmp_path, "run")
    (tmp_path / "run.plate.csv").touch()
    (tmp_path / "notes.yaml").write_text("machine: tripod-cmm\ngeometry: {}\n")
    (tmp_path / "broken.yaml").write_text("a: [")
    found = find_recordings([tmp_path])
    assert [recording.path.name for recording in found.recordings] == ["run.csv"]
    assert found.remarks == ()


def test_a_table_without_its_sidecar_is_a_recording(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text("time_s,scale_1_mm\n0,0\n")
    pd.DataFrame({"time_s": [0.0]}).to_parquet(tmp_path / "other.parquet")
    pd.DataFrame({"ball": [1]}).to_parquet(tmp_path / "plate.parquet")
    assert names(tmp_path) == ["other.parquet", "run.csv"]
    (tmp_path / "named.csv").touch()
    assert names(tmp_path / "named.csv") == ["named.csv"]


def test_a_sidecar_without_a_table_is_said(tmp_path: Path) -> None:
    add(tmp_path, "run")
    add(tmp_path, "lost", ())
    (remark,) = find_recordings([tmp_path]).remarks
    assert remark.where == str(tmp_path / "lost.yaml")
    assert "lost.csv or lost.parquet" in remark.allowed


def test_one_sidecar_is_one_recording(tmp_path: Path) -> None:
    add(tmp_path, "run", (".csv", ".parquet"))
    assert names(tmp_path, tmp_path / "run.csv", tmp_path / "run.parquet") == ["run.csv"]


def test_a_pattern(tmp_path: Path) -> None:
    for name in ("may-1", "may-2", "june-1"):
        add(tmp_path / name, "run")
        add(tmp_path / name, "other")
    found = find_recordings([f"{tmp_path}/may-*/run.*"])
    assert [recording.path.parent.name for recording in found.recordings] == ["may-1", "may-2"]
    assert len(names(f"{tmp_path}/may-*")) == 4


def test_paths_are_absolute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    add(tmp_path / "data", "run")
    monkeypatch.chdir(tmp_path)
    assert [recording.path for recording in find_recordings(["data"]).recordings] == [tmp_path / "data" / "run.csv"]


def test_when_it_began_is_in_the_sidecar_or_in_the_name(tmp_path: Path) -> None:
    add(tmp_path / "m1" / "2026-03-01", "run", sidecar=f"{SIDECAR}provenance: {{started_at: 2026-05-04T10:00+02:00}}\n")
    add(tmp_path / "m1" / "2026-03-02", "run")
    add(tmp_path / "m1", "run_20260405T0815")
    add(tmp_path / "m1", "run_1234567890")
    found = find_recordings([tmp_path]).recordings
    assert [recording.started_at for recording in found] == [
        datetime(2026, 5, 4, 8, tzinfo=UTC),
        datetime(2026, 3, 2, tzinfo=UTC),
        None,
        datetime(2026, 4, 5, 8, 15, tzinfo=UTC),
    ]


@pytest.mark.parametrize(("place", "what"), [("nowhere", "nothing of this name"), (".", "has no recording")])
def test_nothing_found_is_a_problem(place: str, what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CompdError, match=what):
        find_recordings([place])
