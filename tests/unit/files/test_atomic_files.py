"""Files are written whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from compd.files.atomic_files import write_files, write_new_file


def test_text_is_written_as_utf8_and_bytes_as_they_are(tmp_path: Path) -> None:
    write_files({tmp_path / "a.txt": "20 °C\r\n", tmp_path / "b.bin": b"\x00\xff"})
    assert (tmp_path / "a.txt").read_bytes() == b"20 \xc2\xb0C\r\n"
    assert (tmp_path / "b.bin").read_bytes() == b"\x00\xff"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "b.bin"]


@pytest.mark.parametrize("earlier_exists", [True, False])
def test_a_failed_rename_restores_the_files_renamed_before_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, earlier_exists: bool
) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    if earlier_exists:
        first.write_text("old first")
    second.write_text("old second")
    rename = Path.replace

    def fail_on_second(self: Path, target: Path) -> Path:
        if target == second:
            raise OSError(errno.EACCES, "Permission denied")
        return rename(self, target)

    monkeypatch.setattr(Path, "replace", fail_on_second)
    with pytest.raises(OSError, match="Permission denied"):
        write_files({first: "new first", second: "new second"})
    assert (first.read_text() if first.exists() else None) == ("old first" if earlier_exists else None)
    assert second.read_text() == "old second"
    assert {path.name for path in tmp_path.iterdir()} <= {"first", "second"}


def test_the_mode_is_set_whatever_the_umask(tmp_path: Path) -> None:
    umask = os.umask(0o077)
    try:
        write_files({tmp_path / "private": "1"})
        write_files({tmp_path / "shared": "1"}, mode=0o644)
    finally:
        os.umask(umask)
    assert (tmp_path / "private").stat().st_mode & 0o777 == 0o600
    assert (tmp_path / "shared").stat().st_mode & 0o777 == 0o644


def test_a_new_file_never_overwrites_an_old_one(tmp_path: Path) -> None:
    write_new_file(tmp_path / "a", "1")
    with pytest.raises(FileExistsError):
        write_new_file(tmp_path / "a", "2")
    assert (tmp_path / "a").read_text() == "1"
