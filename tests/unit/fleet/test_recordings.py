"""Recordings are found by their sidecars, and nothing else is taken for one."""

from __future__ import annotations

from pathlib import Path

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
    return [path.name for path in find_recordings(places).paths]


def test_a_directory_has_the_recordings_at_any_depth(tmp_path: Path) -> None:
    add(tmp_path, "b")
    add(tmp_path / "2026" / "05", "a", (".parquet",))
    assert names(tmp_path) == ["a.parquet", "b.csv"]


def test_what_has_no_sidecar_and_what_is_no_sidecar_are_no_recordings(tmp_path: Path) -> None:
    add(tmp_path, "run")
    (tmp_path / "run.plate.csv").touch()
    (tmp_path / "notes.yaml").write_text("machine: tripod-cmm\ngeometry: {}\n")
    (tmp_path / "broken.yaml").write_text("a: [")
    found = find_recordings([tmp_path])
    assert [path.name for path in found.paths] == ["run.csv"]
    assert found.remarks == ()


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
    assert [path.parent.name for path in found.paths] == ["may-1", "may-2"]
    assert len(names(f"{tmp_path}/may-*")) == 4


def test_paths_are_absolute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    add(tmp_path / "data", "run")
    monkeypatch.chdir(tmp_path)
    assert find_recordings(["data"]).paths == (tmp_path / "data" / "run.csv",)


@pytest.mark.parametrize(("place", "what"), [("nowhere", "nothing of this name"), (".", "has no recording")])
def test_nothing_found_is_a_problem(place: str, what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CompdError, match=what):
        find_recordings([place])
