"""The Python client against a daemon that misbehaves: every mishap is a DaemonError that says what to do."""

from __future__ import annotations

import socket
import threading
from contextlib import contextmanager

import pytest

from compd.client import Client, connect
from compd.errors import DaemonError
from compd.live.service.requests import REQUESTS

VERSION = b'{"class":"VERSION","protocol":1,"machine":"test"}\n'
TIMEOUT_S = 20


@contextmanager
def scripted(path, script):
    """A daemon that says what `script` says: it is given the connection, then the connection is closed."""
    with socket.create_server(str(path), family=socket.AF_UNIX) as server:

        def serve():
            connection, _ = server.accept()
            with connection:
                script(connection)

        thread = threading.Thread(target=serve)
        thread.start()
        yield str(path)
        thread.join(TIMEOUT_S)


@pytest.mark.parametrize("address", ["127.0.0.1:1", "/nowhere/compd.sock"])
def test_nobody_there_says_what_to_do(address):
    with pytest.raises(DaemonError, match="is `compd run` running"):
        connect(address)


@pytest.mark.parametrize("address", ["here", "localhost:http", ""])
def test_what_is_no_address_is_named(address):
    with pytest.raises(DaemonError, match="host:port, or the path of a Unix socket"):
        connect(address)


def test_a_daemon_that_is_full_is_a_daemon_error(tmp_path):
    full = b'{"class":"ERROR","code":"too_many_clients","text":"32 clients at most"}\n'
    with scripted(tmp_path / "s", lambda c: c.sendall(full)) as path, pytest.raises(DaemonError, match="32 clients"):
        connect(path)


def test_a_daemon_that_goes_away_ends_the_watching_with_an_error(tmp_path):
    def script(connection):
        connection.sendall(VERSION)
        assert connection.recv(100) == b'{"class": "WATCH", "rate_hz": 10}\n'
        connection.sendall(b'{"class":"WATCH","rate_hz":10}\n{"class":"SETPOINT","seq":1}\n{"class":"SETP')

    with scripted(tmp_path / "s", script) as path, connect(path) as client:
        setpoints = client.watch(10)
        assert next(setpoints)["seq"] == 1
        with pytest.raises(DaemonError, match="it closed the connection"):
            next(setpoints)


def test_a_daemon_that_does_not_answer_in_time_is_an_error(tmp_path):
    released = threading.Event()

    def script(connection):
        connection.sendall(VERSION)
        released.wait(TIMEOUT_S)

    with scripted(tmp_path / "s", script) as path, connect(path, timeout_s=0.1) as client:
        with pytest.raises(DaemonError, match="the daemon is gone"):
            client.status()
        released.set()


def test_setpoints_that_come_before_an_answer_are_not_lost(tmp_path):
    def script(connection):
        connection.sendall(VERSION)
        connection.recv(100)
        connection.sendall(b'{"class":"WATCH"}\n{"class":"SETPOINT","seq":1}\n')
        connection.recv(100)
        connection.sendall(b'{"class":"SETPOINT","seq":2}\n{"class":"STATUS","x":5}\n{"class":"SETPOINT","seq":3}\n')
        connection.recv(100)

    with scripted(tmp_path / "s", script) as path, connect(path) as client:
        setpoints = client.watch()
        assert next(setpoints)["seq"] == 1
        assert client.status()["x"] == 5
        assert [next(setpoints)["seq"] for _ in range(2)] == [2, 3]


def test_a_setpoint_in_an_unknown_state_is_not_valid_whatever_it_says(tmp_path):
    def script(connection):
        connection.sendall(VERSION)
        connection.recv(100)
        connection.sendall(
            b'{"class":"WATCH"}\n'
            b'{"class":"SETPOINT","seq":1,"valid":true,"state":"ok"}\n'
            b'{"class":"SETPOINT","seq":2,"valid":true,"state":"coasting","tip_M_mm":[1,2,3]}\n'
            b'{"class":"SETPOINT","seq":3,"valid":true}\n'
        )
        connection.recv(100)

    with scripted(tmp_path / "s", script) as path, connect(path) as client:
        setpoints = client.watch()
        assert [next(setpoints)["valid"] for _ in range(3)] == [True, False, False]


@pytest.mark.parametrize("greeting", [b"SSH-2.0-OpenSSH_9.6\n", b"[1]\n", b"{}\n", b'{"class":"ERROR"}\n', b"7\n"])
def test_what_is_not_compd_is_named(tmp_path, greeting):
    with (
        scripted(tmp_path / "s", lambda connection: connection.sendall(greeting)) as path,
        pytest.raises(DaemonError, match="not compd"),
    ):
        connect(path)


def test_every_request_has_a_method_of_its_name_and_the_version_is_there_already():
    methods = {name for name in vars(Client) if not name.startswith("_")}
    assert methods - {"close", "readings", "adopt_shadow"} == {name.lower() for name in REQUESTS} - {"version", "auth"}
