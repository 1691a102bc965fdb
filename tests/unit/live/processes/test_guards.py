"""Who watches whom: beats, restarts, and the stop that is published where the loop makes no setpoints."""

from __future__ import annotations

import json
import math
import os
import signal
import socket

import pytest

from compd.clock import MonotonicClock
from compd.live.loop.states import State
from compd.live.memory.shared_ring import SharedRing
from compd.live.processes.child_process import OUT_OF_MEMORY, ChildProcess
from compd.live.processes.control import Control, Phase
from compd.live.processes.heartbeat import Heartbeat, RestartDelay
from compd.live.service.loop_watch import LoopWatch


@pytest.fixture
def ring():
    made = SharedRing()
    yield made
    made.close()


@pytest.mark.parametrize(("period_s", "limit_s"), [(0.001, 0.016), (0.005, 0.016), (0.02, 0.032), (1.0, 1.6)])
def test_the_loop_is_missed_within_two_periods_or_20_ms(ring, period_s, limit_s):
    watch = LoopWatch(ring, period_s, lambda: None, 0.0)
    ring.put(100.0, State.OK.code, b"")
    assert watch.admits(41, 100.0)
    assert watch.missing(100.0 + 0.99 * limit_s) is None
    stop = watch.missing(100.0 + 1.01 * limit_s)
    assert stop.state is State.STOP
    assert stop.values is None
    assert stop.seq == 42
    assert json.loads(stop.to_json())["valid"] is False
    assert "the loop has made no setpoint for" in stop.reason
    assert watch.missing(100.0 + 1.02 * limit_s) is None, "it is repeated, but not all the time"
    again = watch.missing(100.0 + limit_s + 1.2 * max(0.1, period_s))
    assert again.seq == 43
    assert not watch.admits(43, 300.0), "too late: that number has been sent"
    assert not watch.admits(44, again.time_s - 1e-6), "it had been computed, but the stop has been sent"
    assert watch.admits(44, again.time_s + 1e-6)
    ring.put(200.0, State.OK.code, b"")
    assert watch.missing(200.0 + 0.5 * limit_s) is None
    assert watch.missing(200.0 + 1.5 * limit_s) is not None, "missed again at once"


def test_the_reason_has_what_the_supervisor_knows(ring):
    watch = LoopWatch(ring, 0.005, lambda: (5.5, "the loop has ended: killed by SIGKILL; it starts anew"), 0.0)
    assert watch.missing(1.0) is None, "the first one takes its time"
    assert "killed by SIGKILL" in watch.missing(6.0).reason
    ring.put(7.0, State.OK.code, b"")
    assert "killed" not in watch.missing(8.0).reason, "that was before"


def test_a_heart_stops_by_looks_and_not_by_seconds():
    heart = Heartbeat(3)
    assert not any(heart.look(0) or heart.hangs for _ in range(50)), "it has yet to start"
    assert heart.look(1)
    assert [heart.look(1) or heart.hangs for _ in range(4)] == [False, False, True, True]
    heart.reset()
    assert not heart.hangs
    assert heart.look(2)


def test_a_process_starts_anew_at_once_then_after_waits_that_double():
    delay = RestartDelay()
    assert delay.due_s == math.inf
    waits_s = []
    now_s = 100.0
    for _ in range(9):
        delay.ended(now_s, now_s + 0.1)
        waits_s.append(delay.due_s - (now_s + 0.1))
        now_s = delay.due_s
        assert delay.take(now_s)
        assert not delay.take(now_s), "once"
    assert waits_s == pytest.approx([0, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5, 5])
    delay.ended(now_s, now_s + 11)
    assert delay.due_s == now_s + 11, "it has run for long enough to be trusted"


@pytest.mark.parametrize(
    ("work", "end"),
    [
        (lambda: None, "ended with code 0"),
        (lambda: 1 / 0, "ended with code 1: its traceback is in the log"),
        (lambda: os._exit(3), "ended with code 3"),
        (lambda: os.kill(os.getpid(), signal.SIGSEGV), "killed by SIGSEGV"),
        (lambda: os._exit(OUT_OF_MEMORY), "more memory than acquisition.memory_mb"),
    ],
)
def test_a_process_says_how_it_ended(work, end):
    child = ChildProcess("child", work, MonotonicClock())
    child.start()
    assert child.running
    child.wait()
    assert end in child.last_end
    assert not child.running
    child.start()
    child.wait()
    assert child.starts == 2


def test_a_process_leaves_the_supervisors_signals_alone_and_can_be_killed_while_stopped():
    control = Control()
    child = ChildProcess("child", lambda: control.await_turn(5, 60), MonotonicClock())
    child.start()
    while not control.successor:
        pass
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGSTOP):
        os.kill(child.pid, number)
    assert not child.collect()
    child.kill("it hung")
    child.wait()
    assert child.last_end == "it hung"
    control.close()


def test_the_turn_goes_to_the_successor_that_waits_and_to_nobody_else():
    control = Control()
    control.give_turn(1)
    assert control.keeps_turn(1)
    child = ChildProcess("child", lambda: os._exit(7 if control.await_turn(2, 60) else 8), MonotonicClock())
    child.start()
    while control.keeps_turn(1):
        pass
    child.wait()
    assert child.last_end == "ended with code 7"
    assert control.turn == 2
    assert not control.await_turn(3, 0.01), "nobody gives it"
    assert control.successor == 0
    control.enter(Phase.STOPPING, "the end")
    assert not control.keeps_turn(2)
    assert control.ending() == "the end"
    control.close()


def test_a_process_may_have_none_of_the_sockets():
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def has_socket():
            try:
                os.fstat(listener.fileno())
            except OSError:
                os._exit(4)
            os._exit(5)

        ends = []
        for keeps in (True, False):
            child = ChildProcess("child", has_socket, MonotonicClock(), keeps_sockets=keeps)
            child.start()
            child.wait()
            ends.append(child.last_end)
    assert ends == ["ended with code 5", "ended with code 4"]
