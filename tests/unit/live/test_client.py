"""The Python client against a daemon that misbehaves: every mishap is a DaemonError that says what to do."""

from __future__ import annotations

import json
import socket
import threading
import time
from contextlib import closing, contextmanager

import pytest

from compd.client import Client, connect
from compd.client_connection import ClientConnection
from compd.client_setpoints import ReadSetpoints
from compd.errors import DaemonError
from compd.live.service.requests import REQUESTS
from tests.support.patience import PATIENCE_S

VERSION = b'{"class":"VERSION","protocol":1,"machine":"test"}\n'


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
        thread.join(PATIENCE_S)


@pytest.mark.parametrize("address", ["127.0.0.1:1", "/nowhere/compd.sock"])
def test_nobody_there_says_what_to_do(address):
    with pytest.raises(DaemonError, match="is `compd run` running"):
        connect(address)


def test_a_socket_of_a_group_that_one_is_not_in_says_how_to_join_it(monkeypatch):
    def refused(self, address):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(socket.socket, "connect", refused)
    with pytest.raises(DaemonError, match="usermod --append --groups compd NAME") as caught:
        connect("/run/compd/compd.sock")
    assert "is `compd run` running" not in str(caught.value)


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


def test_a_daemon_that_does_not_answer_in_time_is_an_error():
    ours, daemon = socket.socketpair()
    daemon.sendall(VERSION)  # it is there before it is waited for
    ours.settimeout(0.01)
    with (
        closing(daemon),
        Client(ClientConnection(ours, "here")) as client,
        pytest.raises(DaemonError, match="the daemon is gone"),
    ):
        client.status()


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


def setpoint(seq, valid_for_s=1e6, state="ok", time_s=None):
    """A SETPOINT line, made now unless `time_s` says otherwise."""
    made_s = time.monotonic() if time_s is None else time_s
    message = {"class": "SETPOINT", "seq": seq, "time_s": made_s, "valid": state != "stop", "state": state}
    return json.dumps(message | {"valid_until": made_s + valid_for_s}).encode() + b"\n"


@contextmanager
def sending(path, *batches):
    """A client of a daemon that sends each batch of lines when the client has sent a line."""

    def script(connection):
        connection.sendall(VERSION)
        for batch in batches:
            connection.recv(1000)
            connection.sendall(batch)
        connection.recv(1000)

    with scripted(path, script) as address, connect(address) as client:
        yield client


def test_the_latest_setpoint_is_the_newest_and_those_before_it_are_read_away(tmp_path):
    first = b'{"class":"WATCH"}\n' + b"".join(map(setpoint, range(1, 6)))
    second = b"".join(map(setpoint, (6, 7, 8))) + b'{"class":"STATUS","x":5}\n' + setpoint(9)
    with sending(tmp_path / "s", first, second) as client:
        assert client.latest(PATIENCE_S)["seq"] == 5
        assert client.status()["x"] == 5
        assert client.latest(PATIENCE_S)["seq"] == 9


def test_the_latest_setpoint_has_not_expired_and_is_waited_for(tmp_path):
    expired = b'{"class":"WATCH"}\n' + setpoint(1) + setpoint(2, valid_for_s=-0.01)
    with sending(tmp_path / "s", expired, setpoint(3)) as client:
        with pytest.raises(DaemonError, match="no setpoint that may still be used has come in time"):
            client.latest(0.05)
        client.target(tip_B0_mm=[0, 0, 0])
        assert client.latest(PATIENCE_S)["seq"] == 3


class Later:
    """A connection over which a line comes only to who waits for it."""

    address, same_clock = "here", True

    def __init__(self, *lines):
        self.lines, self.later = [VERSION, *lines], []

    def has_line(self, wait_s):
        if not self.lines and wait_s > 0 and self.later:
            self.lines.append(self.later.pop(0))
        return bool(self.lines)

    def read(self):
        line = self.lines.pop(0)
        return line, json.loads(line)

    def send(self, message, descriptor=None):
        pass


def test_an_expired_setpoint_that_came_with_an_answer_does_not_end_the_wait():
    connection = Later(b'{"class":"WATCH"}\n', setpoint(1), setpoint(2, valid_for_s=-1.0), b'{"class":"STATUS"}\n')
    client = Client(connection)
    assert next(client.watch())["seq"] == 1
    client.status()
    connection.later = [setpoint(3, valid_for_s=-1.0), setpoint(4)]
    assert client.latest(PATIENCE_S)["seq"] == 4


@pytest.mark.parametrize("state", ["stop", "coasting"])
def test_the_latest_setpoint_may_be_invalid(tmp_path, state):
    """It has expired when it is made."""
    lines = b'{"class":"WATCH"}\n' + setpoint(1) + setpoint(2, 0.0, state)
    with sending(tmp_path / "s", lines) as client:
        latest = client.latest(PATIENCE_S)
        assert (latest["seq"], latest["valid"]) == (2, False)
        with pytest.raises(DaemonError, match=r"in time"):
            client.latest(0.0)


def test_the_latest_setpoint_comes_at_the_rate_that_is_watched(tmp_path):
    first = b'{"class":"WATCH","rate_hz":10}\n' + setpoint(1) + setpoint(2)
    with sending(tmp_path / "s", first) as client:
        setpoints = client.watch(10)
        assert next(setpoints)["seq"] == 1
        assert client.latest(PATIENCE_S)["seq"] == 2, "no second WATCH: it would be answered with nothing here"


def test_a_refused_message_and_a_daemon_that_goes_away_end_the_wait_for_the_latest_setpoint(tmp_path):
    refused = b'{"class":"WATCH"}\n' + setpoint(1) + b'{"class":"ERROR","code":"role_taken","text":"another client"}\n'
    with sending(tmp_path / "s", refused) as client:
        with pytest.raises(DaemonError, match="another client"):
            client.latest(PATIENCE_S)
        assert client.latest(PATIENCE_S)["seq"] == 1
        client.target(tip_B0_mm=[0, 0, 0])
        with pytest.raises(DaemonError, match="it closed the connection"):
            client.latest(PATIENCE_S)


class Arrivals:
    """Setpoints that are read at the times of a clock that is `ahead_s` of the daemon's."""

    def __init__(self, ahead_s=0.0, same_clock=False):
        self.now_s, self.ahead_s = 0.0, ahead_s
        self.read = ReadSetpoints(same_clock, lambda: self.now_s + self.ahead_s)

    def put(self, seq, made_s, read_s, valid_for_s=0.1):
        self.now_s = read_s
        self.read.put(json.loads(setpoint(seq, valid_for_s, time_s=made_s)))

    def newest(self, now_s):
        self.now_s = now_s
        message = self.read.newest()
        return message and message["seq"]


@pytest.mark.parametrize("ahead_s", [-1e6, 0.0, 3e5])
def test_over_a_network_a_setpoint_counts_from_the_quickest_arrival(ahead_s):
    arrivals = Arrivals(ahead_s)
    arrivals.put(1, made_s=10.0, read_s=10.02)
    assert arrivals.newest(10.119) == 1, "it came 20 ms after it was made: the shortest way that is known"
    arrivals.put(2, made_s=10.1, read_s=10.25)
    assert arrivals.newest(10.25) is None, "it has waited for 130 ms on its way"
    arrivals.put(3, made_s=10.3, read_s=10.37)
    assert arrivals.newest(10.41) == 3
    arrivals.put(4, made_s=10.4, read_s=10.47)
    assert arrivals.newest(10.53) is None


def test_clocks_that_run_apart_do_not_make_setpoints_old():
    arrivals = Arrivals(ahead_s=0.0)
    for seq in range(1, 4001):
        made_s = 0.5 * seq
        arrivals.ahead_s = 1e-4 * made_s
        arrivals.put(seq, made_s, made_s + 0.001)
        assert arrivals.newest(made_s + 0.05) == seq


def test_on_the_daemons_computer_its_clock_decides():
    arrivals = Arrivals(same_clock=True)
    arrivals.put(1, made_s=10.0, read_s=10.2)
    assert arrivals.newest(10.2) is None
    arrivals.put(2, made_s=10.2, read_s=10.2)
    assert arrivals.newest(10.299) == 2
    assert arrivals.newest(10.3) is None, "each once"


@pytest.mark.parametrize("greeting", [b"SSH-2.0-OpenSSH_9.6\n", b"[1]\n", b"{}\n", b'{"class":"ERROR"}\n', b"7\n"])
def test_what_is_not_compd_is_named(tmp_path, greeting):
    with (
        scripted(tmp_path / "s", lambda connection: connection.sendall(greeting)) as path,
        pytest.raises(DaemonError, match="not compd"),
    ):
        connect(path)


def test_every_request_has_a_method_of_its_name_and_the_version_is_there_already():
    methods = {name for name in dir(Client) if not name.startswith("_")}
    assert methods - {"close", "readings", "latest", "adopt_shadow"} == {name.lower() for name in REQUESTS} - {
        "version",
        "auth",
    }
