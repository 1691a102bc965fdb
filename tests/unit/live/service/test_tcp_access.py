"""Who may use the TCP port: allowed addresses, and a token that comes first."""

from __future__ import annotations

import os
from contextlib import closing

import pytest
import structlog

from compd.client import connect
from compd.errors import DaemonError
from compd.live.service import connection_limits as seats
from compd.live.service.request_context import TcpAccess
from compd.operation_settings import TcpSocket
from tests.support.service import VERSION, Service

TOKEN = "hvNhV6l3Zk3lY0cJ4lV5Wg"


@pytest.fixture
def token_file(tmp_path):
    path = tmp_path / "token"
    path.write_text(TOKEN + "\n")
    path.chmod(0o600)
    return path


@pytest.fixture
def guarded(tmp_path, token_file):
    with closing(Service(tmp_path, tcp={"token_file": str(token_file)})) as service:
        yield service


def test_who_shows_the_token_first_is_greeted_and_served(guarded):
    client = guarded.tcp(token=TOKEN)
    assert client.version == VERSION
    assert client.ask({"class": "STATUS"}) == {"class": "STATUS"}
    assert guarded.unix().version == VERSION, "the Unix socket has the permissions of its file"


@pytest.mark.parametrize(
    "line",
    [
        {"class": "AUTH", "token": TOKEN[:-1]},
        {"class": "AUTH", "token": ""},
        {"class": "AUTH", "token": "\ud800"},
        {"class": "AUTH"},
        {"class": "STATUS"},
        {"class": "TARGET", "tip_B0_mm": [1, 2, 3]},
        b"GET / HTTP/1.1\r\n",
    ],
    ids=str,
)
def test_anything_else_gets_nothing_for_a_while_and_is_then_closed(guarded, line):
    client = guarded.tcp()
    assert client.version == {"class": "AUTH"}, "nothing about the machine"
    client.send(line)
    client.send({"class": "AUTH", "token": TOKEN})  # a second try on the same connection counts for nothing
    guarded.unix().ask({"class": "STATUS"})
    guarded.pass_time(seats.WRONG_TOKEN_REST_S)
    answer = client.read()
    assert (answer["class"], answer["code"]) == ("ERROR", "not_authorized")
    assert TOKEN not in str(answer)
    assert client.file.read() == b""
    assert guarded.commands.target is None


def test_who_says_nothing_is_closed(guarded):
    client = guarded.tcp()
    guarded.pass_time(seats.AUTH_WITHIN_S + 1)
    assert client.read()["code"] == "not_authorized"
    assert client.file.read() == b""


def test_the_python_client_shows_its_token_or_says_that_it_needs_one(guarded):
    address = f"127.0.0.1:{guarded.listeners.tcp_port}"
    with connect(address, token=TOKEN + "\n") as client:
        assert client.version == VERSION
    with pytest.raises(DaemonError, match="wants a token before anything else"):
        connect(address)


def test_an_address_that_is_not_allowed_is_not_served(tmp_path):
    foreign = {"allow": ["10.1.2.0/24"]}
    with closing(Service(tmp_path, tcp=foreign)) as service, pytest.raises(AssertionError, match="closed"):
        service.tcp()
    with closing(Service(tmp_path / "b", tcp={"allow": ["10.1.2.0/24", "127.0.0.0/8"]})) as service:
        assert service.tcp().version == VERSION


@pytest.mark.parametrize(
    ("address", "allowed"),
    [("10.1.2.9", True), ("10.1.3.9", False), ("::ffff:10.1.2.9", True), ("fe80::1%eth0", True), ("fe81::1", False)],
)
def test_addresses_are_compared_as_networks(address, allowed):
    assert TcpAccess(TcpSocket(allow=("10.1.2.0/24", "fe80::/64"))).admits(address) is allowed


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda path: path.chmod(0o640), "may be read by others"),
        (lambda path: path.write_text("short\n"), "too short"),
        (lambda path: path.unlink(), "No such file"),
        (lambda path: (path.unlink(), os.mkfifo(path)), "not a regular file"),
        (lambda path: path.write_text("x" * 5000), "more than 1024 bytes"),
    ],
)
def test_a_token_file_that_others_know_or_that_is_none_is_refused(token_file, change, says):
    change(token_file)
    with pytest.raises(DaemonError, match=says) as caught:
        TcpAccess.of(TcpSocket(token_file=str(token_file)))
    assert "openssl rand" in str(caught.value)


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.5", "::"])
@pytest.mark.parametrize(
    ("keys", "missing"),
    [({}, "allow and token_file are missing"), ({"allow": ["10.0.0.0/8"]}, "token_file is missing")],
)
def test_a_port_for_other_computers_needs_both(host, keys, missing):
    with pytest.raises(ValueError, match=missing):
        TcpSocket(host=host, **keys)
    assert TcpSocket(host=host, allow=("10.0.0.0/8",), token_file="/t").is_open


@pytest.mark.parametrize(
    "line",
    [
        {"class": "AUTH", "token": ["Zq7vK2xW9pLm4TnB"]},
        {"class": "AUTH", "tokn": "Zq7vK2xW9pLm4TnB"},
        {"class": "AUTH", "token": TOKEN, "Zq7vK2xW9pLm4TnB": "Zq7vK2xW9pLm4TnB"},
        b'{"class": "AUTH", "Zq7vK2xW9pLm4TnB": 1, "Zq7vK2xW9pLm4TnB": 1}\n',
    ],
    ids=str,
)
def test_what_a_wrong_auth_holds_is_not_in_the_log(guarded, line):
    with structlog.testing.capture_logs() as logged:
        client = guarded.tcp()
        client.send(line)
        guarded.unix().ask({"class": "STATUS"})
    assert any(event["event"] == "a client has not shown the token" for event in logged)
    assert "Zq7vK2" not in str(logged)
