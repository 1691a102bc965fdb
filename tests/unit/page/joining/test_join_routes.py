"""The join wizard's routes without a browser: the same files as `compd recording join`, and refusals in words."""

from __future__ import annotations

import io
import json
import shlex
from pathlib import Path
from urllib.parse import quote

import openpyxl
import pytest
from starlette.testclient import TestClient

from compd.page.daemon_link import DaemonLink
from compd.page.guard import Guard, Token, hashed
from compd.page.joining import exports
from compd.page.recordings import Recordings
from compd.page.server import Server
from compd.text import typeset
from tests.support.command import run_in_process
from tests.support.join_files import GAUGES, GAUGES_WITH_PLACES, GERMAN_TRACK, POINTS, TRACK, write_join_files
from tests.support.paths import CONFIG
from tests.support.sampled import sampled

HOST = "127.0.0.1:7760"
OWN = {"Origin": f"http://{HOST}"}
ORDERS = ("/join/table", "/join/trial", "/join/recording")
BY_ORDER = {"recording": GAUGES_WITH_PLACES, "export": POINTS, "by": "order", "sigma_um": 0.5}


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    directory = tmp_path_factory.mktemp("join")
    write_join_files(directory, directory / "recordings")
    return directory / "recordings"


def opened(recordings, role="operate", machine=None):
    server = Server(DaemonLink("/no/socket"), Recordings(recordings, "/no/socket"), machine=machine)
    client = TestClient(
        Guard(server.app(), [Token("a person", role, hashed("x"))], [f"http://{HOST}"], 7760),
        base_url=f"http://{HOST}",
        headers=OWN,
    )
    client.get("/", params={"token": "x"})
    return client


@pytest.fixture
def client(recordings):
    return opened(recordings)


def files(directory):
    return sorted(path.name for path in directory.rglob("*"))


def test_recordings_without_a_reference_and_exports_are_listed(client, recordings):
    (recordings / "link.csv").symlink_to("/etc/passwd")
    (recordings / "exports" / "link.txt").symlink_to("/etc/passwd")
    answer = client.get("/join/sources").json()
    assert {GAUGES, GAUGES_WITH_PLACES} <= set(answer["gauges"])
    assert set(answer["exports"]) == {TRACK, GERMAN_TRACK, POINTS}
    assert answer["may_write"]
    assert client.get("/join").status_code == 200


def test_columns_and_their_meaning_are_told(client):
    answer = client.post("/join/table", json={"export": GERMAN_TRACK}).json()
    assert answer["roles"] == ["time", "x", "y", "z"]
    assert answer["header"] == ["Zeit", "x [mm]", "y [mm]", "z [mm]"]
    assert (len(answer["rows"]), answer["line"][0]) == (20, 2)
    assert answer["assumed"]["decimal mark"].startswith("comma")
    assert (answer["by"], answer["problems"]) == ("time", [])
    changed = client.post("/join/table", json={"export": GERMAN_TRACK, "columns": ["time", "y", "x", "-"]}).json()
    assert changed["roles"] == ["time", "y", "x", "-"]
    assert "--columns time,y,x,-" in changed["command"]


def test_what_cannot_be_read_is_shown_with_the_reason(client, recordings):
    (recordings / "exports" / "two-units.csv").write_text("x [mm],y [inch],z [mm]\n1.5,2.5,3.5\n4.5,5.5,6.5\n")
    (recordings / "exports" / "broken.csv").write_text("x,y,z\n1.5,2.5,3.5\n4.5\n7.5,8.5,9.5\n")
    (recordings / "exports" / "binary.bin").write_bytes(bytes(range(256)))
    answer = client.post("/join/table", json={"export": "two-units.csv"}).json()
    assert answer["roles"] == ["x", "y", "z"]
    assert "units are mixed" in answer["problems"][0]
    broken = client.post("/join/table", json={"export": "broken.csv"}).json()
    assert "has 1 cell where the others have 3" in broken["problems"][0]
    assert ["4.5"] in broken["rows"]
    binary = client.post("/join/table", json={"export": "binary.bin"}).json()
    assert "is not text" in binary["problems"][0]
    refused = client.post("/join/trial", json={"export": "binary.bin", "recording": GAUGES})
    assert refused.status_code == 409
    for name in ("two-units.csv", "broken.csv", "binary.bin"):
        (recordings / "exports" / name).unlink()


@pytest.mark.parametrize("name", ["honest.xlsx", "HONEST.XLSM"])
def test_a_workbook_that_a_browser_brings_is_read(client, recordings, name):
    """The library that reads it judges a path by its ending, and the page keeps none."""
    book = openpyxl.Workbook()
    book.active.append(["x [mm]", "y [mm]", "z [mm]"])
    for k in range(5):
        book.active.append([1.5 * k, 2.5, 3.5 + k])
    file = io.BytesIO()
    book.save(file)
    brought = client.post("/join/exports", params={"name": name}, content=file.getvalue()).json()["name"]
    answer = client.post("/join/table", json={"export": brought}).json()
    assert answer["problems"] == []
    assert (answer["roles"], len(answer["rows"])) == (["x", "y", "z"], 5)
    assert client.delete(f"/join/exports/{brought}").status_code == 200


@pytest.mark.parametrize(
    ("name", "keys"),
    sampled(
        [
            ("moving", {"recording": GAUGES, "export": TRACK, "moving": True, "offset_s": 137.25}),
            ("rest", BY_ORDER),
            ("time", {"recording": GAUGES, "export": TRACK, "frame": "machine", "sigma_um": 0.25}),
            (
                "german",
                {"recording": GAUGES, "export": GERMAN_TRACK, "columns": ["time", "x", "y", "z"], "decimal": ","},
            ),
        ],
        4,
    ),
)
def test_what_is_written_is_what_the_command_line_writes(client, recordings, name, keys):
    before = files(recordings)
    tried = client.post("/join/trial", json=keys).json()
    assert tried["reason"] == ""
    assert files(recordings) == before, "a trial writes nothing"
    written = client.post("/join/recording", json={**keys, "name": name}).json()
    assert written["lines"] == tried["lines"]
    by_page = [(recordings / f"{name}{ending}").read_bytes() for ending in (".csv", ".yaml")]
    command = client.post("/join/table", json={**keys, "name": name}).json()["command"]
    for ending in (".csv", ".yaml"):
        (recordings / f"{name}{ending}").unlink()
    printed = run_in_process(*shlex.split(command)[1:])
    assert [(recordings / f"{name}{ending}").read_bytes() for ending in (".csv", ".yaml")] == by_page
    for line in written["lines"]:
        assert line in typeset(printed)


@pytest.mark.long
@pytest.mark.sample
def test_a_trial_by_time_has_the_offset_in_a_curve(client):
    answer = client.post("/join/trial", json={"recording": GAUGES, "export": TRACK}).json()["time"]
    assert answer["peak"][0] == pytest.approx(137.25, abs=0.5)
    assert answer["next_best"][1] < 0.5 < answer["peak"][1]
    known = [value for value in answer["agreement"] if value is not None]
    assert max(known) == pytest.approx(answer["peak"][1], abs=0.01)
    best_s = answer["offset_s"][answer["agreement"].index(max(known))]
    assert best_s == pytest.approx(137.25, abs=1.0)


def test_a_trial_by_order_has_the_dwell_of_each_point(client):
    answer = client.post("/join/trial", json=BY_ORDER).json()["rest"]
    assert len(answer["line"]) == len(answer["dwell_number"]) == len(answer["residual_um"]) == 476
    assert answer["dwell_number"] == sorted(answer["dwell_number"])
    assert max(answer["residual_um"]) < 20.0


def test_what_does_not_belong_together_is_refused_with_its_reason_and_no_file(client, recordings):
    keys = {**BY_ORDER, "recording": GAUGES, "export": TRACK, "by": "name", "name": "never"}
    tried = client.post("/join/trial", json=keys).json()
    assert "no names of points" in tried["reason"]
    assert client.post("/join/recording", json=keys).status_code == 409
    assert not (recordings / "never.csv").exists()


def test_the_page_s_own_machine_is_taken_and_told_where_it_is_the_recording_s(recordings):
    for name, named in (("tripod-cmm.yaml", True), ("hexapod.yaml", False)):
        client = opened(recordings, machine=CONFIG / name)
        command = client.post("/join/table", json=BY_ORDER).json()["command"]
        assert (f"--machine {CONFIG / name}" in command) == named
        assert client.post("/join/trial", json=BY_ORDER).json()["reason"] == ""


def test_points_are_named_by_the_rows_of_a_plan(client, recordings):
    (recordings / "plan.csv").write_text("time_s,tip_x_mm\n")
    assert client.get("/join/sources").json()["plans"] == ["plan"]
    keys = {**BY_ORDER, "by": "name", "plan": "plan"}
    command = client.post("/join/table", json=keys).json()["command"]
    assert f"--by name --sigma-um 0.5 --plan {recordings / 'plan.csv'}" in command
    assert "plan.csv" in client.post("/join/trial", json=keys).json()["reason"]
    (recordings / "plan.csv").unlink()


def test_a_recording_is_never_replaced(client, recordings):
    before = (recordings / f"{GAUGES}.csv").read_bytes()
    answer = client.post("/join/recording", json={**BY_ORDER, "name": GAUGES})
    assert answer.status_code == 409
    assert "is there already" in answer.json()["reason"]
    assert (recordings / f"{GAUGES}.csv").read_bytes() == before


def test_who_may_look_only_reads_and_tries_and_writes_nothing(recordings):
    client, before = opened(recordings, "view"), files(recordings)
    assert not client.get("/join/sources").json()["may_write"]
    assert client.post("/join/table", json=BY_ORDER).status_code == 200
    assert client.post("/join/trial", json=BY_ORDER).json()["reason"] == ""
    assert client.post("/join/recording", json={**BY_ORDER, "name": "mine"}).status_code == 403
    assert client.post("/join/exports", params={"name": "a.txt"}, content=b"1 2 3\n").status_code == 403
    assert files(recordings) == before


HOSTILE = [
    {},
    {"export": "../gauges-1.csv"},
    {"export": ["a"]},
    {"export": POINTS, "recording": "../../etc/passwd"},
    {"export": POINTS, "recording": "\ud800"},
    {"export": POINTS, "recording": GAUGES, "name": "../up"},
    {"export": POINTS, "recording": GAUGES, "name": "a", "plan": "/etc/passwd"},
    *(
        {"export": POINTS, "recording": GAUGES, "name": "a", key: value}
        for key in (
            "shape",
            "unit",
            "decimal",
            "dates",
            "rate_hz",
            "group",
            "by",
            "frame",
            "sigma_um",
            "link",
            "offset_s",
        )
        for value in (["x"], {"a": 1}, True, 10**400, "\ud800", "x" * 5000, "a\x00b")
    ),
    *(
        {"export": POINTS, "recording": GAUGES, "name": "a", "columns": columns}
        for columns in ("time", ["x"] * 600, [3], [["x"]], ["x,y", "z"], ["\udfff"], ["nothing", "x", "y", "z"])
    ),
    {"export": POINTS, "recording": GAUGES, "name": "a", "ball": 0},
    {"export": POINTS, "recording": GAUGES, "name": "a", "link": 1.5},
    {"export": POINTS, "recording": GAUGES, "name": "a", "by": "order", "offset_s": 3.0},
    {"export": POINTS, "recording": GAUGES, "name": "a", "by": "order", "sigma_um": -1.0},
]


@pytest.mark.parametrize("keys", sampled(HOSTILE, 4), ids=lambda keys: ascii(keys)[:70])
def test_hostile_choices_are_refused_in_words(client, recordings, keys):
    before = files(recordings)
    for path in ORDERS:
        answer = client.post(path, content=json.dumps(keys))
        assert answer.status_code in (200, 400, 409, 413), answer.text
        assert answer.json()
    assert answer.status_code in (400, 409, 413)
    assert files(recordings) == before


@pytest.mark.parametrize("text", ['{"sigma_um": NaN', '{"rate_hz": Infinity', '{"offset_s": -Infinity'])
def test_a_number_that_is_none_is_refused(client, text):
    body = f'{text}, "export": "{POINTS}", "recording": "{GAUGES_WITH_PLACES}", "by": "order", "name": "a"}}'
    assert client.post("/join/recording", content=body).status_code == 409


@pytest.mark.parametrize("body", [b"", b"[]", b"\xff", b"[" * 5000, b'"' + b"x" * 9000])
def test_what_is_no_order_is_refused(client, body):
    for path in ORDERS:
        assert client.post(path, content=body).status_code in (400, 413)


def test_an_export_is_brought_once(client, recordings):
    content = b"time_s,x_mm\n" + b"0.5,1.0\n" * 100_000
    answer = client.post("/join/exports", params={"name": "Messung 12.03 (neu).TXT"}, content=content)
    assert answer.json() == {"name": "Messung-12-03-neu.TXT.export", "bytes": len(content)}
    path = recordings / "exports" / "Messung-12-03-neu.TXT.export"
    assert path.read_bytes() == content
    assert client.post("/join/exports", params={"name": path.name}, content=content).status_code == 200
    other = client.post("/join/exports", params={"name": path.name}, content=content + b"1")
    assert other.status_code == 409
    assert "other content" in other.json()["reason"]
    assert path.read_bytes() == content
    path.unlink()


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../up.txt", "a/b.txt", "a\\b.txt", "/etc/passwd", ".txt", "ä", "\ud800"]
)
def test_a_name_that_could_be_a_path_is_no_export(client, recordings, name):
    before = files(recordings.parent)
    path = f"/join/exports?name={quote(name, errors='surrogatepass')}"
    assert client.post(path, content=b"1 2 3\n").status_code == 409
    assert files(recordings.parent) == before


def test_an_export_that_is_empty_or_too_large_leaves_nothing(client, recordings):
    before = files(recordings)
    empty = client.post("/join/exports", params={"name": "a.txt"}, content=b"")
    assert (empty.status_code, "is empty" in empty.json()["reason"]) == (409, True)
    piece = b"1 2 3\n" * 2**20
    pieces = (piece for _ in range(exports.MAX_BYTES // len(piece) + 1))
    declared = {"Content-Length": str(exports.MAX_BYTES + 1)}
    for content, headers in ((piece, declared), (pieces, {})):
        answer = client.post("/join/exports", params={"name": "a.txt"}, content=content, headers=headers)
        assert answer.status_code == 413
    assert files(recordings) == before


def test_an_export_never_goes_through_a_link(client, recordings, tmp_path):
    link = recordings / "exports" / "linked.txt.export"
    link.symlink_to(tmp_path / "elsewhere.txt")
    assert client.post("/join/exports", params={"name": "linked.txt"}, content=b"1\n").status_code == 409
    assert not Path(tmp_path / "elsewhere.txt").exists()
    link.unlink()


def test_places_of_reflectors_are_those_of_the_command_line(client):
    asked = client.post("/join/table", json={"export": POINTS, "reflectors": "left=1,-2.5,3; top=4,5,6e1"}).json()
    words = shlex.split(asked["command"])
    assert [words[k + 1] for k, word in enumerate(words) if word == "--reflector-place"] == [
        "left=1,-2.5,3",
        "top=4,5,6e1",
    ]
    refused = client.post("/join/table", json={"export": POINTS, "reflectors": "left=1,2"})
    assert refused.status_code == 409
    assert "left=1,2" in refused.json()["reason"]
