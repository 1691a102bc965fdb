"""The page's log says who asked for a change, for what, and what came of it; and no secret."""

from __future__ import annotations

import asyncio

import pytest
from starlette.testclient import TestClient
from structlog.testing import capture_logs

from compd.errors import DaemonError
from compd.page.guard import COOKIE, Guard, Token, hashed
from compd.page.orders import Orders
from compd.page.recordings import Recordings
from compd.page.requests import MAX_LINE, asked_by
from compd.page.server import Server
from tests.support.asgi_client import AsgiClient
from tests.support.scripted_page import LOOKS, ORDERS, ScriptedLink

HOST = "127.0.0.1:7760"
OWN = {"Origin": f"http://{HOST}"}
TOKENS = [Token("anna", ORDERS, hashed("anna's")), Token("bert", ORDERS, hashed("bert's"))]
TOKENS += [Token("screen", LOOKS, hashed("screen's"))]


@pytest.fixture
def guarded(tmp_path):
    server = Server(ScriptedLink("/no/socket"), Recordings(tmp_path, "/no/socket"))
    return Guard(server.app(), TOKENS, [f"http://{HOST}"], 7760)


def browser(guarded, token):
    headers = {"Host": HOST, "Origin": f"http://{HOST}", "Cookie": f"{COOKIE}7760={token}"}
    return AsgiClient(guarded, headers)


def client(guarded, token):
    own = TestClient(guarded, base_url=f"http://{HOST}", headers=OWN)
    own.cookies.set(f"{COOKIE}7760", token)
    return own


def changes(lines):
    return [line for line in lines if line["event"] == "change"]


def test_an_order_is_given_and_logged_by_who_armed_and_nobody_else(guarded, monkeypatch):
    given = []

    async def do(self, name, subject, by):
        given.append((name, subject, by))
        if subject == "replace":
            raise DaemonError.of("zero", "the machine moves")
        return {}

    monkeypatch.setattr(Orders, "do", do)

    async def conversation():
        anna = browser(guarded, "anna's")
        async with anna.stream("/live") as stream:
            id = (await stream.event())[1]["id"]
            for other in (browser(guarded, "bert's"), browser(guarded, "screen's")):
                assert (await other.post("/arm", {"id": id}))[0] == 403
            assert (await anna.post("/arm", {"id": id}))[0] == 200
            for other in (browser(guarded, "bert's"), browser(guarded, "screen's")):
                assert (await other.post("/orders/zero", {"id": id}))[0] == 403
                assert (await other.post("/arm", {"id": id, "arm": False}))[0] == 403
            assert given == []
            assert (await anna.post("/orders/accept", {"id": id, "subject": "scale_1"}))[0] == 200
            assert (await anna.post("/orders/zero", {"id": id, "subject": "replace"}))[0] == 409
        return id

    with capture_logs() as lines:
        id = asyncio.run(conversation())
    by_anna = "anna (operate) from 127.0.0.1"
    assert given == [("accept", "scale_1", by_anna), ("zero", "replace", by_anna)]
    told = [(line["by"].partition(" ")[0], line["what"], line["outcome"]) for line in changes(lines)]
    foreign = "refused (403): this browser is connected with another token"
    assert told == [
        ("bert", "POST /arm", foreign),
        ("screen", "POST /arm", foreign),
        ("anna", "POST /arm", "done"),
        ("bert", "POST /orders/zero", foreign),
        ("bert", "POST /arm", foreign),
        ("screen", "POST /orders/zero", foreign),
        ("screen", "POST /arm", foreign),
        ("anna", "POST /orders/accept", "done"),
        ("anna", "POST /orders/zero", "refused (409): the machine moves"),
    ]
    assert "subject scale_1" in changes(lines)[-2]["subject"]
    assert changes(lines)[-1]["by"] == by_anna
    for secret in (id, "anna's", "bert's", hashed("anna's")):
        assert secret not in str(lines)


@pytest.mark.parametrize(
    ("token", "outcome"), [("anna's", "done"), ("screen's", "refused (403): this browser is read-only")]
)
def test_files_that_are_brought_and_deleted_and_recordings_are_logged(guarded, token, outcome):
    own = client(guarded, token)
    with capture_logs() as lines:
        own.post("/join/exports", params={"name": "scan.csv"}, content=b"x,y,z\n1,2,3\n")
        own.delete("/join/exports/scan.csv.export")
        own.post("/recordings", json={"stop": True})
        own.get("/join/sources")
        own.post("/join/table", json={"export": "scan.csv"})
    told = [(line["what"], line["subject"], line["outcome"]) for line in changes(lines)]
    assert told == [
        ("POST /join/exports", "name=scan.csv", outcome),
        ("DELETE /join/exports/scan.csv.export", "", outcome),
        ("POST /recordings", "stop True", outcome),
    ]


def test_a_line_of_the_log_is_one_line(guarded):
    own = client(guarded, "anna's")
    with capture_logs() as lines:
        own.post("/recordings", json={"name": "a\nlevel=info by=bert\x1b[2J" + "x" * 500})
        own.delete("/join/exports/a%0Ab")
    for line in changes(lines):
        for value in line.values():
            assert value.isprintable()
            assert len(value) <= MAX_LINE


def test_a_name_of_any_length_leaves_role_and_address():
    token = Token("a\n" + "n" * 300, ORDERS, hashed("x"))
    by = asked_by({"token": token, "client": ("10.0.0.5", 1234)})
    assert by.startswith("a?nn")
    assert by.endswith("(operate) from 10.0.0.5")
    assert len(by) <= MAX_LINE
