"""Machines that are built alike are told apart by their directories, or by a part of a name."""

from __future__ import annotations

from pathlib import Path

import pytest

from compd.fleet.machine_names import MachinesBy
from compd.fleet.recordings import FoundRecordings, find_recordings
from tests.support.recordings import SIDECAR


def add(path: Path, machine: str = "tripod-cmm") -> None:
    """An empty recording of a machine with this configuration."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    path.with_suffix(".yaml").write_text(SIDECAR.replace("tripod-cmm", machine))


def machines(found: FoundRecordings) -> list[str]:
    return [recording.machine for recording in found.recordings]


@pytest.fixture
def shop(tmp_path: Path) -> Path:
    """A directory for each machine, of two kinds, one with a directory for each year."""
    for path in ("m1/2025-12.csv", "m1/2026-01.csv", "m2/2025/run.csv", "m2/2026/run.csv"):
        add(tmp_path / path)
    add(tmp_path / "m3" / "2026-01.csv", "hexapod")
    return tmp_path


def test_a_directory_is_a_machine_where_a_configuration_is_in_several(shop: Path) -> None:
    found = find_recordings([shop])
    assert machines(found) == ["m1", "m1", "m2", "m2", "m3"]
    (remark,) = found.remarks
    assert "of tripod-cmm in 2 directories" in remark.what


def test_one_wrong_sidecar_changes_no_other_machine(shop: Path) -> None:
    add(shop / "m1" / "2026-02.csv", "hexapod")
    assert machines(find_recordings([shop])) == ["m1", "m1", "m1", "m2", "m2", "m3"]


def test_who_says_so_has_machines_by_sidecar(shop: Path) -> None:
    found = find_recordings([shop], MachinesBy.sidecar)
    assert machines(found) == ["tripod-cmm"] * 4 + ["hexapod"]
    assert found.remarks == ()


def test_directories_of_campaigns_are_no_machines(tmp_path: Path) -> None:
    for campaign in ("spring", "autumn", "2026-01"):
        for machine in ("tripod-07", "tripod-12"):
            add(tmp_path / campaign / f"{machine}.csv", machine)
    found = find_recordings([tmp_path])
    assert machines(found) == ["tripod-07", "tripod-12"] * 3
    assert machines(find_recordings([tmp_path], MachinesBy.directory))[2:4] == ["autumn", "autumn"]


def test_a_machine_that_lies_in_one_directory_keeps_its_name(tmp_path: Path) -> None:
    for machine in ("tripod-07", "tripod-12"):
        add(tmp_path / f"somewhere-{machine}" / "run.csv", machine)
    assert machines(find_recordings([tmp_path])) == ["tripod-07", "tripod-12"]


@pytest.mark.parametrize(
    "pattern", ["{machine}_*.csv", "{machine}_{date}.csv", "*/{machine}_20[0-9]?-*.csv", "**/{machine}_*.csv"]
)
def test_the_name_says_it(pattern: str, tmp_path: Path) -> None:
    directory = tmp_path / "all" if pattern.startswith("*") else tmp_path
    for name in ("m-1_2026-01-05", "m-1_2026-02-05_again", "m-2_2026-01-05"):
        add(directory / f"{name}.csv")
    assert machines(find_recordings([f"{tmp_path}/{pattern}"])) == ["m-1", "m-1", "m-2"]


def test_a_pattern_of_directories_says_it(shop: Path) -> None:
    assert machines(find_recordings([f"{shop}/{{machine}}"])) == ["m1", "m1", "m2", "m2", "m3"]


def test_a_date_ends_a_name_with_dashes(tmp_path: Path) -> None:
    add(tmp_path / "tripod-07-2026-01-05.csv")
    add(tmp_path / "notes.csv")
    assert machines(find_recordings([f"{tmp_path}/{{machine}}-{{date}}.csv"])) == ["tripod-07"]


def test_many_recordings_of_one_machine_are_remarked_on(tmp_path: Path) -> None:
    add(tmp_path / "a.csv")
    add(tmp_path / "b.csv")
    (remark,) = find_recordings([tmp_path]).remarks
    assert "has 2 recordings of one machine, tripod-cmm" in remark.what
    assert "{machine}_*.csv" in remark.next_step
