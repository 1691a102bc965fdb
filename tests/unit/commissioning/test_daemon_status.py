"""`compd status`: each state of the daemon has its words and its exit code."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from compd.cli.app import app
from compd.client import Client
from compd.client_connection import ClientConnection
from compd.commissioning import daemon_health
from compd.commissioning.daemon_health import Health, daemon_status, worst_gauges
from compd.setpoint_states import State
from tests.unit.live.test_client import scripted

VERSION = {"class": "VERSION", "protocol": 1, "machine": "tripod"}
GOOD = [
    {"channel": "scale_1.value", "quality": "ok", "age_s": 0.01},
    {"channel": "u.u1", "quality": "ok", "age_s": 0.03},
]


@contextmanager
def daemon(path: Path, state: str, reason: str = "", gauges: Any = GOOD) -> Iterator[str]:
    """A daemon in a state, that answers STATUS and sends one setpoint."""
    valid = state in {s.value for s in State if s.valid}
    setpoint = {"class": "SETPOINT", "state": state, "valid": valid, "reason": reason}
    answers = [[{"class": "STATUS", "gauges": gauges, "realtime": {}}], [{"class": "WATCH", "rate_hz": 10}, setpoint]]

    def script(connection: socket.socket) -> None:
        connection.sendall(json.dumps(VERSION).encode() + b"\n")
        for answer in answers:
            connection.recv(4096)
            connection.sendall(b"".join(json.dumps(message).encode() + b"\n" for message in answer))
        connection.recv(4096)

    with scripted(path / "s", script) as address:
        yield address


def invoke(address: str, *options: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["status", "--daemon", address, *options])
    return done.exit_code, done.stdout


@pytest.mark.parametrize("state", list(State))
def test_the_exit_code_follows_from_the_state(tmp_path: Path, state: State) -> None:
    with daemon(tmp_path, state.value) as address:
        code, text = invoke(address)
    assert code == (0 if state is State.OK else 1 if state.valid else 2)
    assert text.startswith(f"{Health(code).name}: tripod {state.value} (")
    assert state.text in text


def test_the_reason_and_the_gauges_that_are_not_good_are_said_once_for_each_gauge(tmp_path: Path) -> None:
    lost = [{"channel": f"joints.{k}", "quality": "line_lost", "detail": "gone"} for k in range(1, 10)]
    with daemon(tmp_path, "stop", "joints (1 to 9): line_lost", [*GOOD, *lost]) as address:
        code, text = invoke(address)
    assert (code, text.splitlines()) == (
        2,
        ["CRITICAL: tripod stop: joints (1 to 9): line_lost", "    joints, 9 channels: line_lost (gone)"],
    )


def test_where_all_gauges_are_good_the_oldest_is_named() -> None:
    assert worst_gauges(GOOD) == ("oldest reading: u.u1, 30 ms",)
    assert worst_gauges([]) == ()


def test_a_state_of_a_newer_daemon_is_critical(tmp_path: Path) -> None:
    with daemon(tmp_path, "brand_new") as address:
        assert invoke(address)[0] == 2


@pytest.mark.parametrize("address", ["/nowhere/compd.sock", "127.0.0.1:1", "/nowhere/machine.yaml", "nonsense"])
def test_no_answer_is_unknown(address: str) -> None:
    code, text = invoke(address)
    assert code == 3
    assert text.startswith("UNKNOWN: ")
    assert len(text.splitlines()) == 1


def test_a_daemon_that_makes_no_setpoint_is_critical(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, daemon = socket.socketpair()
    for answer in (VERSION, {"class": "STATUS", "gauges": []}):  # they are there before they are waited for
        daemon.sendall(json.dumps(answer).encode() + b"\n")
    ours.settimeout(0.01)
    monkeypatch.setattr(daemon_health, "connect", lambda *_: Client(ClientConnection(ours, "here")))
    with closing(daemon):
        found = daemon_status("here")
    assert found.health is Health.CRITICAL
    assert "no setpoint" in found.text


def test_the_same_as_json(tmp_path: Path) -> None:
    with daemon(tmp_path, "hold", "joints.1: timeout") as address:
        code, text = invoke(address, "--json")
    found = json.loads(text)
    assert (code, found["health"], found["state"], found["valid"]) == (1, "warning", "hold", True)
    assert found["status"]["class"] == "STATUS"


def test_a_gauge_that_is_to_be_looked_at_is_said_and_is_no_fault(tmp_path: Path) -> None:
    warned = [GOOD[0] | {"warning": "scatters by 3.5 um at rest, declared: 0.1 um (`noise_um`)"}, GOOD[1]]
    with daemon(tmp_path, "ok", gauges=warned) as address:
        code, text = invoke(address)
    assert code == 0
    assert "scale_1.value: warning: scatters by 3.5 um at rest" in text
