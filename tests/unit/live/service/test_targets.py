"""Targets: the newest counts, from when it was made, for as long as its controller is there; a setpoint says which."""

from __future__ import annotations

import json
import socket
from contextlib import closing

import pytest

from compd.live.loop.commands import Target
from compd.live.service.client_session import ClientSession
from compd.live.service.descriptor_bin import DescriptorBin
from compd.live.system import THIS_COMPUTER
from tests.support.live_machine import machine
from tests.support.watching import until

MANY = 20_000


def target(x_mm, **keys):
    return json.dumps({"class": "TARGET", "tip_B0_mm": [x_mm, 0.0, -500.0], **keys}).encode() + b"\n"


STATUS = b'{"class":"STATUS"}\n'
RELEASE = b'{"class":"RELEASE"}\n'


@pytest.fixture
def session(service):
    """A session whose lines nobody answers, and the client's end of its socket."""
    ours, client = socket.socketpair(socket.AF_UNIX)
    session = ClientSession(ours, "unix", True, DescriptorBin(THIS_COMPUTER), place_of=service.requests.place_of)
    with closing(client), closing(session):
        yield session, client


def waiting(session):
    """The lines that wait, and when each came."""
    lines = []
    while session.has_lines:
        line = session.next_line()
        lines.append((line + b"\n", session.arrived_s))
    return lines


def test_of_targets_that_wait_the_newest_is_left_with_its_time(session):
    session, client = session
    for k in range(5):
        client.sendall(target(float(k)) + target(k + 0.5))
        assert session.is_read, "a stream of targets is never left in the system's buffer, where they would grow old"
        session.receive(float(k))
    assert waiting(session) == [(target(4.5), 4.0)]


def test_other_requests_keep_their_order_among_targets(session):
    session, client = session
    client.sendall(target(1.0) + STATUS + target(2.0) + RELEASE + target(3.0) + STATUS + target(4.0))
    session.receive(0.0)
    assert [line for line, _ in waiting(session)] == [STATUS, target(2.0), RELEASE, STATUS, target(4.0)]


@pytest.mark.parametrize("line", [b'{"class":"STATUS","by":"TARGET"}', b'"TARGET"', b'{"class":["TARGET"]}', b"\xff"])
def test_what_is_no_target_is_not_taken_for_one(session, line):
    session, client = session
    client.sendall(line + b"\n" + target(1.0) + line + b"\n" + target(2.0))
    session.receive(0.0)
    assert [received for received, _ in waiting(session)] == [line + b"\n", line + b"\n", target(2.0)]


def test_who_asks_without_end_waits(session):
    session, client = session
    client.sendall(STATUS)
    session.receive(0.0)
    assert not session.is_read


def test_a_burst_costs_a_few_and_the_end_of_the_connection_ends_the_role(service, monkeypatch):
    """A network that has stalled brings thousands at once; or the controller goes, and leaves them behind."""
    taken = []
    set_target = service.requests.context.set_target
    monkeypatch.setattr(
        service.requests.context, "set_target", lambda *given: taken.append(given) or set_target(*given)
    )
    controller = service.unix()
    controller.socket.sendall(b"".join(target(float(k % 100)) for k in range(MANY)) + target(77.0))
    until("the newest is the target", lambda: getattr(service.commands.target, "tip_mm", [0])[0] == 77.0)
    assert len(taken) < MANY / 10
    controller.socket.sendall(b"".join(target(float(k % 100)) for k in range(MANY)))
    controller.close()
    other = service.unix()
    until("nobody is the controller", lambda: service.requests.context.controller is None)
    other.send(target(5.0))
    until("the other one is", lambda: getattr(service.commands.target, "tip_mm", [0])[0] == 5.0)


def test_a_client_that_sends_no_more_gets_its_answers_and_has_no_role(service):
    client = service.unix()
    client.send(target(1.0))
    until("it is the controller", lambda: service.requests.context.controller is not None)
    client.send(STATUS * 3)
    client.socket.shutdown(socket.SHUT_WR)
    assert [client.read()["class"] for _ in range(3)] == ["STATUS"] * 3
    assert client.file.readline() == b""
    until("nobody is the controller", lambda: service.requests.context.controller is None)
    assert service.commands.target is None


@pytest.mark.parametrize(("made_s", "counts_s"), [(-3.0, -3.0), (0.0, 0.0), (3600.0, 0.0)])
def test_a_target_counts_from_when_it_was_made_and_never_from_later_than_it_came(service, made_s, counts_s):
    client = service.unix()
    sent_s = service.clock.monotonic()
    client.send(target(1.0, time_s=sent_s + made_s, id=2**53))
    until("it is there", lambda: service.commands.target is not None)
    came_s = service.clock.monotonic()
    taken = service.commands.target
    assert sent_s + counts_s <= taken.time_s <= (came_s if made_s >= 0 else sent_s + counts_s)
    assert taken.valid_until_s == taken.time_s + 5.0
    assert taken.id == 2**53


@pytest.mark.parametrize("keys", [{"id": -1}, {"id": 2**53 + 1}, {"id": 1.5}, {"id": "a"}, {"time_s": "now"}])
def test_a_number_that_is_none_is_refused(service, keys):
    answer = service.unix().ask(target(1.0, **keys))
    assert answer["code"] == "bad_message"
    assert next(iter(keys)) in answer["text"]


@pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
def test_a_setpoint_says_which_target_it_answers(name):
    run = machine(name)
    run.step()
    assert "target_time_s" not in json.loads(run.step().to_json())
    run.commands.target = Target((10.0, -20.0, -500.0), time_s=12.25, id=7)
    said = json.loads(run.step().to_json())
    assert (said["target_time_s"], said["target_id"]) == (12.25, 7)
    run.commands.target = Target((10.0, -20.0, -500.0), valid_until_s=0.0, time_s=12.5)
    said = json.loads(run.step().to_json())
    assert not said["valid"]
    assert said["target_time_s"] == 12.5
    assert "target_id" not in said
    run.commands.target = Target((10.0, -20.0, -500.0))
    assert "target_time_s" not in json.loads(run.step().to_json()), "recorded before targets had times"
