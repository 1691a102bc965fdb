"""Who gets the page: a token, this server's own name, and orders from its own pages only."""

from __future__ import annotations

import pytest
from starlette.applications import Starlette
from starlette.responses import PlainTextResponse
from starlette.routing import Route
from starlette.testclient import TestClient

from compd.page.guard import Guard, Token, hashed
from compd.page.run import origin

HOST = "127.0.0.1:7760"
OWN = {"Origin": f"http://{HOST}"}


async def says_who(request):
    return PlainTextResponse(f"{request.scope['token'].name} {request.scope['token'].role}")


@pytest.fixture
def client():
    app = Starlette(routes=[Route("/", says_who), Route("/order", says_who, methods=["POST"])])
    tokens = [Token("Anna", "operate", hashed("anna's")), Token("screen", "view", hashed("screen's"))]
    return TestClient(Guard(app, tokens, [f"http://{HOST}", "http://localhost:7760"], 7760), base_url=f"http://{HOST}")


@pytest.mark.parametrize(("token", "who"), [("anna's", "Anna operate"), ("screen's", "screen view")])
def test_the_token_in_the_address_becomes_a_cookie_and_leaves_the_address(client, token, who):
    answer = client.get("/", params={"token": token}, follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert client.get("/").text == who


def test_what_else_is_in_the_address_stays_there(client):
    asked = {"recording": "a b&c", "token": "anna's"}
    answer = client.get("/workbench", params=asked, follow_redirects=False)
    assert answer.headers["location"] == "/workbench?recording=a+b%26c"
    beside = client.get(f"http://{HOST}//evil.example/", params=asked, follow_redirects=False)
    assert beside.headers["location"] == "/"


@pytest.mark.parametrize("params", [{}, {"token": ""}, {"token": "another"}])
def test_without_a_token_there_is_nothing_but_what_to_do(client, params):
    answer = client.get("/", params=params)
    assert answer.status_code == 403
    assert "compd page" in answer.text


@pytest.mark.parametrize("host", ["evil.example:7760", "127.0.0.1", "127.0.0.1:7761", "[::1]:7760", ""])
def test_another_name_for_this_server_is_refused(client, host):
    client.get("/", params={"token": "anna's"})
    assert client.get("/", headers={"Host": host}).status_code == 400


@pytest.mark.parametrize(
    ("headers", "code"),
    [
        (OWN, 200),
        ({}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "http://127.0.0.1:7761"}, 403),
        ({"Origin": f"http://{HOST}.evil.example"}, 403),
        ({"Origin": f"https://{HOST}"}, 403),
        ({"Origin": "http://localhost:7760"}, 403),
    ],
)
def test_an_order_comes_from_this_servers_own_page(client, headers, code):
    client.get("/", params={"token": "anna's"})
    assert client.post("/order", headers=headers).status_code == code


def test_an_order_without_the_cookie_is_refused(client):
    assert client.post("/order", headers=OWN).status_code == 403


def test_every_answer_binds_the_browser_to_this_server(client):
    for answer in (client.get("/"), client.get("/", params={"token": "anna's"})):
        assert "default-src 'self'" in answer.headers["content-security-policy"]
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["cache-control"] == "no-store"


def test_behind_a_proxy_with_tls_its_name_is_the_only_one():
    app = Starlette(routes=[Route("/", says_who), Route("/order", says_who, methods=["POST"])])
    guard = Guard(app, [Token("Anna", "operate", hashed("anna's"))], ["https://machine.example"], 7760)
    client = TestClient(guard, base_url="https://machine.example")
    answer = client.get("/", params={"token": "anna's"}, follow_redirects=False)
    assert "secure" in answer.headers["set-cookie"].lower()
    assert client.post("/order", headers={"Origin": "https://machine.example"}).status_code == 200
    assert client.post("/order", headers={"Origin": "http://machine.example"}).status_code == 403
    assert client.get("/", headers={"Host": HOST}).status_code == 400


@pytest.mark.parametrize(
    ("host", "port", "written"),
    [
        ("10.1.2.3", 7760, "http://10.1.2.3:7760"),
        ("machine.example", 80, "http://machine.example"),
        ("fd00::7", 7760, "http://[fd00::7]:7760"),
    ],
)
def test_an_origin_is_written_as_browsers_do(host, port, written):
    assert origin(host, port) == written
