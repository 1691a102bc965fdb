"""What browsers bring: where and how it is kept, how much of it, and how it is deleted."""

from __future__ import annotations

import asyncio
import os
import time

import pytest
from starlette.testclient import TestClient

from compd.errors import RecordingError
from compd.page.daemon_link import DaemonLink
from compd.page.guard import COOKIE, Guard, Token, hashed
from compd.page.joining import exports as module
from compd.page.joining.exports import Exports, kept_name
from compd.page.recordings import Recordings
from compd.page.server import Server

HOST = "127.0.0.1:7760"
CONTENT = b"x,y,z\n1.5,2.5,3.5\n"
LEFT = ".0123456789abcdef"


@pytest.fixture
def exports(tmp_path):
    return Exports(tmp_path / "exports")


async def pieces_of(*pieces):
    for piece in pieces:
        yield piece


def keep(exports, name, content=CONTENT):
    return asyncio.run(exports.keep(name, pieces_of(content)))["name"]


def browser(tmp_path, role="operate"):
    server = Server(DaemonLink("/no/socket"), Recordings(tmp_path, "/no/socket"))
    guard = Guard(server.app(), [Token("a person", role, hashed("x"))], [f"http://{HOST}"], 7760)
    own = {"Origin": f"http://{HOST}"}
    return TestClient(guard, base_url=f"http://{HOST}", headers=own, cookies={f"{COOKIE}7760": "x"})


@pytest.mark.parametrize(
    ("brought", "kept"),
    [
        ("scan.xlsx", "scan.xlsx.export"),
        ("evil.py", "evil.py.export"),
        ("evil.model.yaml", "evil-model.yaml.export"),
        ("evil.so", "evil.so.export"),
        ("sitecustomize.pth", "sitecustomize.pth.export"),
        ("scan", "scan.export"),
        ("scan.xlsx.export", "scan.xlsx.export"),
        ("scan.export.export", "scan.export.export"),
    ],
)
def test_no_file_has_a_suffix_that_anything_loads(exports, brought, kept):
    assert kept_name(brought) == kept
    assert keep(exports, brought) == kept
    assert [path.name for path in exports.directory.iterdir()] == [kept]


@pytest.mark.parametrize("umask", [0o000, 0o022, 0o077])
def test_a_file_is_neither_run_nor_read_by_others(exports, umask):
    before = os.umask(umask)
    try:
        name = keep(exports, "scan.csv")
    finally:
        os.umask(before)
    path = exports.path_of(name)
    assert path is not None
    assert path.stat().st_mode & 0o7777 == 0o640
    assert path.stat().st_nlink == 1


def test_files_of_earlier_releases_are_listed_and_deleted(exports):
    exports.directory.mkdir()
    for name in ("track.csv", "points.txt", "evil.py"):
        (exports.directory / name).write_bytes(CONTENT)
    new = keep(exports, "track.csv")
    assert set(exports.listed()) == {"track.csv", "points.txt", "evil.py", new}
    for name in exports.listed():
        assert exports.path_of(name) is not None
        assert exports.delete(name)
        assert not exports.delete(name)
    assert exports.listed() == []


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../kept.csv", "/etc/hostname", LEFT, "a\x00b", "\ud800", "sub", "link.csv"]
)
def test_nothing_else_is_deleted(exports, tmp_path, name):
    keep(exports, "scan.csv")
    (tmp_path / "kept.csv").write_bytes(CONTENT)
    (exports.directory / "sub").mkdir()
    (exports.directory / LEFT).write_bytes(CONTENT)
    (exports.directory / "link.csv").symlink_to(tmp_path / "kept.csv")
    before = sorted(path.name for path in tmp_path.rglob("*"))
    assert not exports.delete(name)
    assert sorted(path.name for path in tmp_path.rglob("*")) == before


def test_a_directory_that_is_a_link_is_not_followed(exports, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "track.csv").write_bytes(CONTENT)
    exports.directory.symlink_to(tmp_path / "elsewhere")
    assert exports.listed() == []
    assert exports.path_of("track.csv") is None
    for act in (lambda: keep(exports, "scan.csv"), lambda: exports.delete("track.csv")):
        with pytest.raises(RecordingError, match="no directory"):
            act()
    assert [path.name for path in (tmp_path / "elsewhere").iterdir()] == ["track.csv"]


def test_all_files_together_have_a_limit_of_bytes(exports, monkeypatch):
    monkeypatch.setattr(module, "MAX_BYTES_OF_ALL", 100)
    exports.directory.mkdir()
    (exports.directory / "not listed (1).bin").write_bytes(b"x" * 60)
    assert keep(exports, "a.txt", b"a" * 30)
    with pytest.raises(RecordingError, match=r"3 files with .* being brought"):
        keep(exports, "b.txt", b"b" * 11)
    assert exports.usage() == (2, 90)
    assert exports.delete("a.txt.export")
    assert keep(exports, "b.txt", b"b" * 11)


def test_all_files_together_have_a_limit_of_number(exports, monkeypatch):
    monkeypatch.setattr(module, "MAX_FILES", 3)
    for name in ("a", "b", "c"):
        keep(exports, name)
    with pytest.raises(RecordingError, match="3 files"):
        keep(exports, "d")
    assert exports.usage().files == 3


def test_files_that_come_at_once_count_together(exports, monkeypatch):
    monkeypatch.setattr(module, "MAX_BYTES_OF_ALL", 100)
    both_begun = asyncio.Barrier(2)

    async def slowly(byte):
        yield byte * 60
        await both_begun.wait()
        yield byte

    async def one(name, byte):
        try:
            return await exports.keep(name, slowly(byte))
        except RecordingError:
            await both_begun.wait()
            return None

    async def both():
        return await asyncio.gather(one("a.txt", b"a"), one("b.txt", b"b"))

    kept = [answer for answer in asyncio.run(both()) if answer]
    assert len(kept) == 1
    assert exports.usage() == (1, 61)


def test_a_temporary_file_counts_and_goes_when_its_process_has_ended(exports, monkeypatch):
    monkeypatch.setattr(module, "MAX_BYTES_OF_ALL", 100)
    exports.directory.mkdir()
    left = exports.directory / LEFT
    left.write_bytes(b"x" * 90)
    assert exports.usage() == (1, 90)
    assert exports.listed() == []
    with pytest.raises(RecordingError, match="no room"):
        keep(exports, "a.txt")
    assert left.exists(), "it may be coming still"
    old_s = time.time() - 2 * module._LEFT_AFTER_S
    os.utime(left, (old_s, old_s))
    assert keep(exports, "a.txt")
    assert not left.exists()


def test_a_browser_that_goes_in_the_middle_leaves_nothing(exports):
    async def cut_off():
        yield CONTENT
        raise ConnectionError

    with pytest.raises(RecordingError):
        asyncio.run(exports.keep("a.txt", cut_off()))
    assert exports.usage() == (0, 0)


def test_who_may_operate_deletes_and_who_may_look_does_not(tmp_path):
    keep(Exports(tmp_path / "exports"), "scan.csv")
    view, operate = browser(tmp_path, "view"), browser(tmp_path)
    assert view.get("/join/exports").json()["files"] == 1
    assert view.delete("/join/exports/scan.csv.export").status_code == 403
    assert operate.delete("/join/exports/scan.csv.export", headers={"Origin": "http://evil.example"}).status_code == 403
    assert operate.get("/join/sources").json()["exports"] == ["scan.csv.export"]
    assert operate.delete("/join/exports/scan.csv.export").status_code == 200
    assert operate.delete("/join/exports/scan.csv.export").status_code == 404
    assert operate.delete("/join/exports/..%2Frun.csv").status_code == 404
    assert operate.get("/join/exports").json() == {
        "files": 0,
        "bytes": 0,
        "most_files": module.MAX_FILES,
        "most_bytes": module.MAX_BYTES_OF_ALL,
    }
