"""Who watches whom: beats, restarts, and the stop that is published where the loop makes no setpoints."""

from __future__ import annotations

import json
import math
import os
import signal
import socket
import threading
import time
from types import SimpleNamespace

import pytest

from compd.live.loop.setpoint import Setpoint
from compd.live.loop_succession import LoopSuccession
from compd.live.memory.control import Control, Phase
from compd.live.memory.shared_ring import SharedRing
from compd.live.processes.heartbeat import Heartbeat, RestartDelay
from compd.live.processes.loop_process import ModelChange
from compd.live.processes.service_process import StateLog
from compd.live.service.loop_watch import LoopWatch
from compd.live.system import THIS_COMPUTER
from compd.live.system.child_process import ChildProcess
from compd.live.system.forked_process import OUT_OF_MEMORY
from compd.live.system.realtime import RationedPriority, thread_time_s
from compd.setpoint_states import Mode, State
from tests.support.patience import PATIENCE_S


@pytest.fixture
def ring():
    made = SharedRing()
    yield made
    made.close()


def takes_turn(control, loop):
    """Whether the turn comes to this loop, which waits for it."""
    return control.await_turn(loop, 60, THIS_COMPUTER.selector)


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
    assert not watch.admits(44, again.time_s + 4e-7), "in a line it would have the time of the stop"
    assert watch.admits(44, again.time_s + 2e-6)
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
    assert heart.is_late
    heart.excuse()
    assert not heart.is_late
    assert [heart.look(1) or heart.hangs for _ in range(3)] == [False, False, True], "a debugger has let it go"
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
    child = ChildProcess("child", work, THIS_COMPUTER)
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
    child = ChildProcess("child", lambda: takes_turn(control, 5), THIS_COMPUTER)
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
    child = ChildProcess("child", lambda: os._exit(7 if takes_turn(control, 2) else 8), THIS_COMPUTER)
    child.start()
    while control.keeps_turn(1):
        pass
    child.wait()
    assert child.last_end == "ended with code 7"
    assert control.turn == 2
    assert not control.await_turn(3, 0.01, THIS_COMPUTER.selector), "nobody gives it"
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
            child = ChildProcess("child", has_socket, THIS_COMPUTER, keeps_sockets=keeps)
            child.start()
            child.wait()
            ends.append(child.last_end)
    assert ends == ["ended with code 5", "ended with code 4"]


def test_a_state_whose_reason_names_every_gauge_is_logged_and_told_in_one_line():
    """A hexapod with all its lines lost: the reason has thousands of characters."""
    control = Control()
    reason = ", ".join(f"joint {k} (joints.{k}): line_lost ({'cannot open ' * 12})" for k in range(1, 41))
    StateLog(control).note(Setpoint(1, 1.0, 1.0, math.nan, State.STOP, reason, Mode.CMM, None))
    assert control.headline.read().startswith("stop: joint 1 (joints.1): line_lost")
    assert len(control.headline.read()) <= 500
    control.close()


def test_a_request_is_answered_where_the_successor_ends_with_the_turn_and_without_an_answer():
    control, setpoints = Control(), SharedRing()
    process = SimpleNamespace(
        control=control,
        run=lambda number, forget: None,
        run_successor=lambda number, change: os._exit(9 if takes_turn(control, number) else 8),
        answer=lambda *answer: control.model_answer.write(answer),
    )
    loops = LoopSuccession(process, THIS_COMPUTER, None)
    loops.start()
    loops.loop.wait()
    loops.start_successor(ModelChange(3, None, False))
    while not control.successor:
        pass
    control.give_turn(control.successor)
    assert loops.turn_has_changed()
    while not loops.collect(3):
        pass
    number, summary, refusal = control.model_answer.read()
    assert (number, summary) == (3, None)
    assert "ended with code 9" in refusal
    setpoints.close()
    control.close()


def test_priority_is_given_up_while_a_thread_takes_more_than_half_a_processor(monkeypatch):
    now, used, policies = [0.0], [0.0], []
    monkeypatch.setattr("compd.live.system.realtime.time.thread_time", lambda: used[0])
    monkeypatch.setattr(
        "compd.live.system.realtime.os.sched_setscheduler", lambda _, policy, parameters: policies.append(policy)
    )
    priority = RationedPriority(20, SimpleNamespace(monotonic=lambda: now[0]))
    had = []
    for share in (0.1, 0.1, 0.9, 0.9, 0.1):
        priority.look()
        had.append(priority.has_priority)
        now[0] += 0.11
        used[0] += 0.11 * share
    priority.look()
    had.append(priority.has_priority)
    assert had == [True, True, True, False, False, True]
    assert [policy & ~os.SCHED_RESET_ON_FORK for policy in policies] == [os.SCHED_FIFO, os.SCHED_OTHER, os.SCHED_FIFO]
    assert all(policy & os.SCHED_RESET_ON_FORK for policy in policies), "threads that it starts have none"


def test_the_thread_of_a_line_has_its_priority_from_another_thread_and_loses_it_when_it_never_waits(monkeypatch):
    now, used, policies = [0.0], [0.0], []
    monkeypatch.setattr("compd.live.system.realtime.thread_time_s", lambda thread_id: used[0])
    monkeypatch.setattr(
        "compd.live.system.realtime.os.sched_setscheduler",
        lambda thread, policy, _: policies.append((thread, policy & ~os.SCHED_RESET_ON_FORK)),
    )
    priority = RationedPriority(10, SimpleNamespace(monotonic=lambda: now[0]), 4711, 0.25)
    for share in (0.2, 0.3, 0.3):
        priority.look()
        now[0] += 0.11
        used[0] += 0.11 * share
    assert policies == [(4711, os.SCHED_FIFO), (4711, os.SCHED_OTHER)]


def test_the_processor_time_of_a_thread_is_its_own_until_it_has_ended():
    started, end = threading.Event(), threading.Event()

    def line() -> None:
        sum(range(1_000_000))
        started.set()
        end.wait()

    thread = threading.Thread(target=line)
    thread.start()
    assert started.wait(PATIENCE_S)
    assert 0.0 < thread_time_s(thread.native_id) < time.process_time()
    before_s = time.thread_time()
    assert before_s <= thread_time_s(threading.get_native_id()) <= time.thread_time()
    end.set()
    thread.join()
    with pytest.raises(OSError, match="Invalid argument"):
        thread_time_s(2**22)  # beyond the kernel's last


def test_where_priority_is_not_permitted_it_is_asked_for_once(monkeypatch):
    asked = []

    def refuse(*arguments):
        asked.append(arguments)
        raise PermissionError

    monkeypatch.setattr("compd.live.system.realtime.os.sched_setscheduler", refuse)
    now = [0.0]
    priority = RationedPriority(20, SimpleNamespace(monotonic=lambda: now[0]))
    for _ in range(5):
        priority.look()
        now[0] += 1.0
    assert len(asked) == 1
    assert not priority.has_priority
