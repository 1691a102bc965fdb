"""Many clients at once: places, turns, and those that lose their place; nobody is harmed by another."""

from __future__ import annotations

import socket
import threading
from contextlib import contextmanager
from dataclasses import replace

import pytest

from compd.clock import MonotonicClock
from compd.live.memory.shared_ring import ENTRIES
from compd.live.service import connection_limits as seats
from tests.support.patience import PATIENCE_S
from tests.support.service import PERIOD_S, setpoint

STATUS = b'{"class":"STATUS"}\n'


@pytest.mark.parametrize("clients", [1, 4])
def test_a_setpoint_goes_out_before_the_next_request_of_a_flood_is_answered(service, clients):
    """With every answer a setpoint is made; each answer finds all setpoints before it published."""
    watcher, *flooders = service.unix(), *(service.unix() for _ in range(clients))
    watcher.ask({"class": "WATCH"})
    published, now_s = [], MonotonicClock().monotonic()
    service.publisher._observers = (lambda _: None, published.append)
    before_answer = []

    def status():
        before_answer.append(len(published))
        service.deliver(setpoint(len(before_answer), now_s + len(before_answer) * PERIOD_S))
        return {"class": "STATUS"}

    context = service.requests.context
    context.messages = replace(context.messages, status=status)
    for flooder in flooders:
        flooder.send(STATUS * 100)
    for seq in range(1, 100 * clients + 1):
        assert watcher.read()["seq"] == seq
    assert before_answer == list(range(100 * clients))


@pytest.mark.parametrize("flooders", [1, 5])
def test_a_client_waits_for_one_request_of_each_other_and_not_for_their_floods(service, flooders):
    polite, *others = service.tcp(), *(service.unix() for _ in range(flooders))
    entered, leave = threading.Event(), threading.Event()
    answered = []

    def status():
        if not answered:
            entered.set()
            assert leave.wait(PATIENCE_S)
        answered.append("STATUS")
        return {"class": "STATUS"}

    context = service.requests.context
    context.messages = replace(context.messages, status=status)
    for flooder in others:
        flooder.send(STATUS * 150)
    assert entered.wait(PATIENCE_S)
    polite.send({"class": "VERSION"})
    leave.set()
    assert polite.read()["class"] == "VERSION"
    assert len(answered) <= 2 * flooders + 1, "the round that has begun, and one more"


def test_a_controller_is_answered_before_a_flood(service):
    controller, flooder = service.tcp(), service.unix()
    controller.send({"class": "TARGET", "tip_B0_mm": [1, 2, 3]})
    controller.ask({"class": "VERSION"})
    flooder.send(STATUS * 100)
    service.publisher._next_turn_s = float("inf")  # the others rest, for ever
    controller.send({"class": "TARGET", "tip_B0_mm": [4, 5, 6]})
    assert controller.ask({"class": "VERSION"})["class"] == "VERSION"
    assert service.commands.target.tip_mm == (4.0, 5.0, 6.0)


def test_all_places_for_tcp_taken_leave_places_for_the_unix_socket(service):
    seated = [service.tcp() for _ in range(seats.MAX_TCP_CLIENTS)]
    for _ in range(40 - seats.MAX_TCP_CLIENTS):
        refused = service.tcp()
        assert refused.version["code"] == "too_many_clients"
    owners = [service.unix() for _ in range(seats.MAX_CLIENTS - seats.MAX_TCP_CLIENTS)]
    assert all(owner.ask({"class": "STATUS"}) == {"class": "STATUS"} for owner in owners)
    seated[0].close()
    owners[0].ask({"class": "STATUS"})
    assert service.tcp().version["class"] == "VERSION", "a place that is left is free"


def test_a_tcp_client_that_neither_watches_nor_asks_nor_controls_is_dropped(service):
    idle, watching, asking, controller, local = (
        service.tcp(),
        service.tcp(),
        service.tcp(),
        service.tcp(),
        service.unix(),
    )
    watching.ask({"class": "WATCH"})
    controller.send({"class": "TARGET", "tip_B0_mm": [1, 2, 3]})
    service.pass_time(seats.IDLE_AFTER_S - 1)
    asking.ask({"class": "STATUS"})
    service.pass_time(2)
    answer = idle.read()
    assert (answer["class"], answer["code"]) == ("ERROR", "idle")
    assert idle.file.read() == b""
    for client in (watching, asking, controller, local):
        assert client.ask({"class": "STATUS"}) == {"class": "STATUS"}


def test_a_peer_that_is_gone_without_a_word_is_asked_after(service):
    service.tcp()
    (session,) = service.publisher._sessions
    assert session.connection.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
    assert session.connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == 10_000


def test_a_slow_client_is_dropped_and_counted_and_the_others_miss_nothing(service):
    slow, good = service.unix(), service.tcp()
    slow.ask({"class": "WATCH"})
    good.ask({"class": "WATCH"})
    now_s = MonotonicClock().monotonic()
    seq = 0
    while not service.publisher.dropped_clients:
        seq += 1
        assert seq < 50_000, "the slow client was never dropped"
        service.deliver(setpoint(seq, now_s + seq * PERIOD_S))
        assert good.read()["seq"] == seq
    assert service.publisher.summary()["dropped_setpoints"] == 0
    good.ask({"class": "STATUS"})
    assert service.publisher.summary()["clients"] == 1
    while slow.socket.recv(65536):
        pass  # what was on its way, then the end of the stream


@contextmanager
def held_up(service):
    """The publisher stands still at the first setpoint, which has been delivered, until this ends."""
    entered, leave = threading.Event(), threading.Event()

    def hold_up(setpoint):
        entered.set()
        assert leave.wait(PATIENCE_S)

    service.publisher._observers = (hold_up,)
    service.deliver(setpoint(0, service.clock.monotonic()))
    assert entered.wait(PATIENCE_S)
    try:
        yield
    finally:
        leave.set()


def test_a_full_queue_drops_the_oldest_and_counts_them(service):
    peer = service.tcp()
    peer.ask({"class": "WATCH"})
    now_s = service.clock.monotonic()
    with held_up(service):
        for seq in range(1, 601):
            service.deliver(setpoint(seq, now_s + seq * PERIOD_S))
    assert peer.read()["seq"] == 0
    dropped = peer.read()["seq"] - 1
    assert 600 - ENTRIES <= dropped <= 600 - ENTRIES + 20, "all but what the ring has, less a margin"
    assert service.publisher.summary()["dropped_setpoints"] == dropped


def test_setpoints_of_a_time_when_the_service_stood_still_make_no_client_late(service):
    peer = service.unix()
    peer.ask({"class": "WATCH"})
    now_s = service.clock.monotonic()
    with held_up(service):
        for seq in range(1, 100):
            service.deliver(setpoint(seq, now_s + seq * PERIOD_S))
        service.clock.step(6.0)
        service.deliver(setpoint(100, service.clock.monotonic()))
    assert peer.read()["seq"] == 100
    assert service.publisher.dropped_clients == 0


def test_beyond_the_last_seat_a_client_is_told_and_closed(service):
    seated = [service.unix() for _ in range(32)]
    extra = service.tcp()
    assert extra.version["code"] == "too_many_clients"
    assert extra.file.read() == b""
    seated[0].close()
    seated[1].ask({"class": "STATUS"})
    service.unix().ask({"class": "STATUS"})
