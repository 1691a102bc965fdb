"""The routes, without a daemon: what is refused, and how."""

from __future__ import annotations

import asyncio
import json
import re

import numpy as np
import pytest
from starlette.testclient import TestClient

from compd.page.daemon_link import DaemonLink
from compd.page.guard import Guard, Token, hashed
from compd.page.history import History
from compd.page.recordings import Recordings
from compd.page.requests import MAX_BODY_BYTES
from compd.page.server import AXES_CSS, STATIC, Server, _ended, packed
from tests.support.patience import PATIENCE_S

HOST = "127.0.0.1:7760"
# What a browser loads before it shows the live page, without compression: 1.2 s at 1 Mbit/s.
MAX_PAGE_BYTES = 150_000
OWN = {"Origin": f"http://{HOST}"}


@pytest.fixture
def open_page(tmp_path):
    """A client with a token of the role that a test asks for."""

    def open_as(role):
        recordings = Recordings(tmp_path / "recordings", "/no/socket")
        server = Server(DaemonLink("/no/socket"), recordings)
        guarded = Guard(server.app(), [Token("a person", role, hashed("x"))], [f"http://{HOST}"], 7760)
        client = TestClient(guarded, base_url=f"http://{HOST}")
        client.get("/", params={"token": "x"})
        return client

    return open_as


@pytest.mark.parametrize("path", ["/", "/static/main.js", "/static/page.css", "/static/vendor/uPlot-1.6.32.min.js"])
def test_what_a_browser_loads_is_there(open_page, path):
    assert open_page("view").get(path).status_code == 200


def test_a_page_is_small():
    waiting, loaded = [STATIC / "index.html"], {}
    while waiting:
        path = waiting.pop()
        loaded[path] = content = (AXES_CSS if path.name == AXES_CSS.name else path).read_text()
        names = re.findall(r'(?:href|src)="/static/([^"]+)"', content) if path.suffix == ".html" else []
        imported = [STATIC / name for name in names] + [
            path.parent / name for name in re.findall(r'from "(.+)";', content)
        ]
        waiting += [other.resolve() for other in imported if other.resolve() not in loaded]
    assert STATIC / "machine.js" in loaded
    assert sum(len(content.encode()) for content in loaded.values()) <= MAX_PAGE_BYTES


@pytest.mark.parametrize(
    "path", ["/static/../server.py", "/static/%2e%2e/server.py", "/recordings/../../etc", "/nothing"]
)
def test_nothing_else_is(open_page, path):
    assert open_page("operate").get(path).status_code in (404, 405)


@pytest.mark.parametrize("path", ["/arm", "/orders/zero", "/recordings"])
@pytest.mark.parametrize("body", [b"", b"{", b"[]", b"3", b"\xff", b'"' + b"x" * MAX_BODY_BYTES])
def test_a_body_that_is_no_order_is_refused(open_page, path, body):
    assert open_page("operate").post(path, content=body, headers=OWN).status_code in (400, 413)


def test_orders_of_a_browser_that_is_not_there_or_not_armed_are_refused(open_page):
    client = open_page("operate")
    for keys in ({}, {"id": ""}, {"id": "guessed"}):
        assert client.post("/arm", json=keys, headers=OWN).status_code == 403
        assert client.post("/orders/zero", json=keys, headers=OWN).status_code == 403
    assert client.post("/orders/format-the-disk", json={}, headers=OWN).status_code == 404


def test_without_a_daemon_an_order_says_so(open_page):
    answer = open_page("view").get("/orders/zero").json()
    assert not answer["possible"]
    assert "not there" in answer["text"]


@pytest.mark.parametrize("name", ["", "../up", "a/b", ".hidden", "x" * 65, "a b", "-option"])
def test_a_name_that_could_be_a_path_is_no_recording(open_page, name):
    answer = open_page("operate").post("/recordings", json={"name": name}, headers=OWN)
    assert answer.status_code == 409
    assert "letters" in answer.json()["reason"]
    assert open_page("operate").get(f"/recordings/{name or '.'}").status_code in (200, 404, 405)


@pytest.mark.parametrize("burst_s", [0, -1, "5", 1e9, []])
def test_a_burst_has_a_length(open_page, burst_s):
    answer = open_page("operate").post("/recordings", json={"name": "a", "burst_s": burst_s}, headers=OWN)
    assert answer.status_code == 400


def test_who_may_look_only_records_nothing(open_page):
    assert open_page("view").post("/recordings", json={"name": "a"}, headers=OWN).status_code == 403


@pytest.mark.parametrize("unix_s", ["", "now", "nan", "inf", "-inf"])
def test_a_moment_is_a_time(open_page, unix_s):
    for path in ("/moment", "/traces"):
        assert open_page("view").get(path, params={"unix_s": unix_s}).status_code == 400


def test_of_a_moment_before_the_page_nothing_is_known(open_page):
    assert open_page("view").get("/moment", params={"unix_s": "1e9"}).status_code == 404
    assert open_page("view").get("/traces", params={"unix_s": "1e9"}).json() == {"times_s": [], "values": []}


def test_the_history_can_be_read_back():
    history = History(3)
    setpoint = {"state": "ok", "valid": True, "correction_mm": [1e-3, 0.0, 0.0], "tip_M_mm": [1.0, 2.0, 3.0]}
    for k in range(300):
        history.note(100.0 + k / 10, setpoint, None)
    header, _, data = packed(history).partition(b"\n")
    answer = json.loads(header)
    start = 0
    for table in answer["tables"]:
        times = np.frombuffer(data, "<f8", table["rows"], start)
        start += 8 * table["rows"]
        count = table["rows"] * len(answer["columns"])
        rows = np.frombuffer(data, "<f4", count, start).reshape(table["rows"], -1)
        start += 4 * count
        assert times[0] == 100.0
        assert rows[-1, 1] == 1.0
    assert start == len(data)
    assert [table["rows"] for table in answer["tables"]] == [30, 300]


def test_a_task_that_has_missed_a_cancellation_ends_too():
    async def deaf():
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            await asyncio.Event().wait()

    async def both():
        tasks = [asyncio.create_task(deaf()), asyncio.create_task(asyncio.Event().wait())]
        await asyncio.sleep(0)
        await asyncio.wait_for(_ended(tasks), PATIENCE_S)
        assert all(task.done() for task in tasks)

    asyncio.run(both())
