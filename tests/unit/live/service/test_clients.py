"""Many clients at once: places, turns, and those that lose their place; nobody is harmed by another."""

from __future__ import annotations

import threading

from compd.clock import MonotonicClock
from compd.live.memory.shared_ring import ENTRIES
from tests.support.service import PERIOD_S, TIMEOUT_S, setpoint


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


def test_a_full_queue_drops_the_oldest_and_counts_them(service):
    peer = service.tcp()
    entered, leave = threading.Event(), threading.Event()

    def hold_up(setpoint):
        entered.set()
        assert leave.wait(TIMEOUT_S)

    service.publisher._observers = (hold_up,)
    peer.ask({"class": "WATCH"})
    now_s = MonotonicClock().monotonic()
    service.deliver(setpoint(0, now_s))
    assert entered.wait(TIMEOUT_S)
    for seq in range(1, 601):
        service.deliver(setpoint(seq, now_s + seq * PERIOD_S))
    leave.set()
    assert peer.read()["seq"] == 0
    dropped = peer.read()["seq"] - 1
    assert 600 - ENTRIES <= dropped <= 600 - ENTRIES + 20, "all but what the ring has, less a margin"
    assert service.publisher.summary()["dropped_setpoints"] == dropped


def test_beyond_the_last_seat_a_client_is_told_and_closed(service):
    seated = [service.unix() for _ in range(32)]
    extra = service.tcp()
    assert extra.version["code"] == "too_many_clients"
    assert extra.file.read() == b""
    seated[0].close()
    seated[1].ask({"class": "STATUS"})
    service.unix().ask({"class": "STATUS"})
