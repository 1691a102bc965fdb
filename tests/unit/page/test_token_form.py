"""The form that takes a token, the way out, and what a page of another port gets."""

from __future__ import annotations

import asyncio

import pytest
from starlette.testclient import TestClient

from compd.live.service import WRONG_TOKEN_REST_S
from compd.page.guard import COOKIE, MAX_FORM_BYTES, MAX_HEADERS, Guard, Token, WrongTokens, hashed
from compd.page.recordings import Recordings
from compd.page.server import Server
from tests.support.hand_clock import HandClock
from tests.support.scripted_page import ScriptedLink

HOST = "127.0.0.1:7760"
OWN = {"Origin": f"http://{HOST}"}
HTML = {"Accept": "text/html,application/xhtml+xml"}
TOKENS = [Token("Anna", "operate", hashed("anna's"))]


@pytest.fixture
def clock():
    return HandClock()


@pytest.fixture
def client(clock, tmp_path):
    server = Server(ScriptedLink("/no/socket"), Recordings(tmp_path, "/no/socket"))
    guard = Guard(server.app(), TOKENS, [f"http://{HOST}"], 7760, clock)
    return TestClient(guard, base_url=f"http://{HOST}", follow_redirects=False)


def show(client, token, **headers):
    return client.post("/token", data={"token": token}, headers={**OWN, **headers})


def test_a_browser_without_a_token_gets_the_form_and_what_it_is_made_of_and_nothing_else(client):
    for path in ("/", "/workbench", "/join", "/nothing"):
        answer = client.get(path, headers=HTML)
        assert answer.status_code == 403
        assert '<label for="token">' in answer.text
        assert "<script" not in answer.text
    for path in ("/static/page.css", "/static/axes.css", "/static/token.css", "/static/icon.svg"):
        assert client.get(path).status_code == 200
    for path in ("/", "/static/main.js", "/static/join/join.css", "/recordings", "/live", "/address.svg"):
        answer = client.get(path, headers={"Accept": "*/*"})
        assert answer.status_code == 403
        assert answer.headers["content-type"].startswith("text/plain")
        assert answer.headers["connection"] == "close"


def test_a_token_in_the_form_becomes_a_cookie(client):
    answer = show(client, "  anna's\n")
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert client.get("/").status_code == 200


def test_a_wrong_token_is_said_and_another_is_looked_at_a_second_later(client, clock):
    answer = show(client, "another")
    assert answer.status_code == 403
    assert 'role="alert"' in answer.text
    assert show(client, "anna's").status_code == 429
    assert client.get("/", params={"token": "anna's"}).status_code == 303, "an address with its token is not typed"
    clock.now_s += WRONG_TOKEN_REST_S + 0.01
    assert show(client, "anna's").status_code == 303


def test_wrong_tokens_from_one_address_keep_nobody_at_another_waiting(clock):
    wrong = WrongTokens(clock)
    wrong.note("10.0.0.66")
    assert not wrong.may_try("10.0.0.66")
    assert wrong.may_try("10.0.0.5")
    for k in range(1000):
        wrong.note(f"10.0.1.{k}")
    assert not wrong.may_try("10.0.0.5"), "so many addresses are one person's"
    clock.now_s += WRONG_TOKEN_REST_S + 0.01
    assert wrong.may_try("10.0.0.66")


@pytest.mark.parametrize(
    ("headers", "content", "code"),
    [
        ({"Origin": "http://evil.example"}, b"token=anna%27s", 403),
        ({"Origin": "null"}, b"token=anna%27s", 403),
        ({"Origin": ""}, b"token=anna%27s", 403),
        ({**OWN, "Sec-Fetch-Site": "cross-site"}, b"token=anna%27s", 403),
        (OWN, b"token=" + b"a" * MAX_FORM_BYTES, 403),
        ({**OWN, "Content-Length": "100000000000000000000"}, b"token=anna%27s", 403),
        ({**OWN, "Content-Length": "\xb2"}, b"token=anna%27s", 403),
        (OWN, b"&".join([b"token=anna%27s"] * 9), 403),
        (OWN, b"\xff\xfe", 403),
        (OWN, b"", 403),
        (OWN, b"token=%00", 403),
        (OWN, b"token=%ed%a0%80", 403),
    ],
)
def test_what_is_no_form_of_this_server_opens_nothing(client, headers, content, code):
    given = {"Content-Type": "application/x-www-form-urlencoded", **headers}
    octets = {name: value.encode("latin-1") for name, value in given.items()}
    answer = client.post("/token", content=content, headers=octets)
    assert answer.status_code == code
    assert "set-cookie" not in answer.headers


def test_leaving_deletes_the_cookie(client):
    show(client, "anna's")
    assert client.post("/leave").status_code == 403, "no page of this server asks for it"
    answer = client.post("/leave", headers=OWN)
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    assert f"{COOKIE}7760" not in client.cookies
    assert client.get("/").status_code == 403


@pytest.mark.parametrize(
    ("target", "location"),
    [
        ("//evil/", "/"),
        ("///evil/", "/"),
        ("/%5cevil", "/"),
        ("/%5c/evil", "/"),
        ("/\\evil", "/"),
        ("//evil%2f..", "/"),
        ("/a//evil", "/"),
        ("/%0d%0aSet-Cookie:x", "/"),
        ("/http://evil/", "/"),
        ("/workbench", "/workbench"),
        ("/", "/"),
    ],
)
def test_the_token_in_an_address_leads_to_this_server_only(client, target, location):
    answer = client.get(f"http://{HOST}{target}?token=anna's")
    assert (answer.status_code, answer.headers["location"]) == (303, location)


LOADED = ("script", "image", "style", "iframe", "empty", "object", "audio")


@pytest.mark.parametrize("site", ["cross-site", "same-site", "anything"])
def test_a_page_of_another_port_loads_nothing(client, site):
    show(client, "anna's")
    for dest in LOADED:
        for mode in ("no-cors", "cors", "navigate"):
            headers = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": mode, "Sec-Fetch-Dest": dest}
            assert client.get("/static/main.js", headers=headers).status_code == 403
    shown = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}
    assert client.get("/", headers=shown).status_code == 200, "a link to it"
    assert client.post("/recordings", headers={**OWN, **shown}, json={"stop": True}).status_code == 403


@pytest.mark.parametrize("site", ["same-origin", "none"])
def test_its_own_page_loads_what_it_needs(client, site):
    show(client, "anna's")
    headers = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "no-cors", "Sec-Fetch-Dest": "script"}
    answer = client.get("/static/main.js", headers=headers)
    assert answer.status_code == 200
    assert answer.headers["cross-origin-resource-policy"] == "same-origin"
    assert answer.headers["cross-origin-opener-policy"] == "same-origin"


def test_a_request_has_a_number_of_headers(client):
    assert client.get("/", headers={f"X-{k}": "1" for k in range(MAX_HEADERS)}).status_code == 431


def test_a_body_without_a_token_is_not_read():
    async def never(scope, receive, send):
        raise AssertionError("it reached the page")

    async def receive():
        raise AssertionError("the body was asked for")

    async def answered():
        sent = []

        async def send(message):
            sent.append(message)

        named = {"host": HOST, "origin": f"http://{HOST}", "content-length": "10000000000"}
        scope = {"type": "http", "method": "POST", "path": "/join/exports", "query_string": b"name=a.txt"}
        scope["headers"] = [(name.encode(), value.encode()) for name, value in named.items()]
        await Guard(never, TOKENS, [f"http://{HOST}"], 7760)(scope, receive, send)
        return sent[0]["status"], dict(sent[0]["headers"])

    status, headers = asyncio.run(answered())
    assert status == 403
    assert headers[b"connection"] == b"close"


def test_the_address_is_a_picture_for_another_device(tmp_path):
    for origin, code in (("https://machine.example", 200), ("", 404)):
        server = Server(ScriptedLink("/no/socket"), Recordings(tmp_path, "/no/socket"), origin=origin)
        guard = Guard(server.app(), TOKENS, [f"http://{HOST}"], 7760)
        client = TestClient(guard, base_url=f"http://{HOST}", cookies={f"{COOKIE}7760": "anna's"})
        answer = client.get("/address.svg")
        assert answer.status_code == code
        if code == 200:
            assert answer.headers["content-type"] == "image/svg+xml"
            assert "<svg" in answer.text
            assert "anna" not in answer.text
