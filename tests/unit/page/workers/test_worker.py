"""A worker: answers of its process, its limits, and that another goes on where one was ended."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
import threading
from multiprocessing import forkserver
from multiprocessing.connection import wait
from pathlib import Path

import pytest

from compd.errors import StateError
from compd.page.workers.limits import WorkerLimits
from compd.page.workers.worker_group import WorkerGroup
from compd.page.workers.workers import Workers
from tests.support.paths import ROOT
from tests.support.patience import PATIENCE_S

STATES = "tests.unit.page.workers.states"
COUNTER = f"{STATES}:Counter"
LIMITS = WorkerLimits(memory_mb=100, opening_s=PATIENCE_S, idle_s=PATIENCE_S)


@pytest.fixture
def workers():
    workers = Workers()
    yield workers
    workers.end()


@pytest.fixture
def worker(workers):
    return workers.worker("counter", COUNTER, (), LIMITS)


def ask(worker, question, *given, seconds=PATIENCE_S):
    return worker.submit(f"{COUNTER}.{question}", *given, seconds=seconds).answer.result()


def process_of(worker):
    return worker._running.process


def has_ended(process):
    return bool(wait([process.sentinel], PATIENCE_S))


def test_its_state_is_kept_from_one_question_to_the_next_and_answers_are_ready_to_send(worker):
    first, second = (json.loads(ask(worker, "count", by)) for by in (1, 2))
    assert (first["count"], second["count"]) == (1, 3)
    assert first["pid"] == second["pid"] == worker.pid != os.getpid()
    assert first["not finite"] is None
    assert first["nice"] >= 10, "the page and the daemon go first"
    assert ask(worker, "octets") == b"as it is"


def test_errors_come_back_as_themselves_and_the_state_stays(worker):
    ask(worker, "count", 1)
    pid = worker.pid
    with pytest.raises(StateError, match="cannot be done"):
        ask(worker, "refuse")
    with pytest.raises(KeyError):
        ask(worker, "miss")
    assert json.loads(ask(worker, "count", 1))["pid"] == pid


def test_a_fault_of_compd_is_no_refusal(worker, capfd):
    with pytest.raises(RuntimeError, match=r"Counter\.fail failed"):
        ask(worker, "fail")
    assert json.loads(ask(worker, "count", 1))["count"] == 1


def test_what_cannot_be_opened_is_told_at_every_question(workers):
    worker = workers.worker("faulty", f"{STATES}:Faulty", (), LIMITS)
    for _ in range(2):
        with pytest.raises(StateError, match="cannot be opened"):
            ask(worker, "count", 1)


def test_a_question_that_takes_too_long_is_ended_and_the_next_goes_on_with_what_was_kept(workers):
    worker = workers.worker("counter", COUNTER, (), LIMITS)
    ask(worker, "count", 5)
    process = process_of(worker)
    with pytest.raises(StateError, match=r"(?s)took longer than it may.*allowed: 0\.2 s.*command line"):
        ask(worker, "wait", seconds=0.2)
    assert has_ended(process)
    answer = json.loads(ask(worker, "count", 1))
    assert answer["count"] == 6
    assert answer["pid"] != process.pid


def test_one_that_needs_more_memory_than_it_may_is_ended(worker):
    assert ask(worker, "grow_a_little") == b"4000000"
    process = process_of(worker)
    with pytest.raises(StateError, match="needs more than 100 MB"):
        ask(worker, "grow")
    assert has_ended(process)
    assert json.loads(ask(worker, "count", 1))["count"] == 1


def test_one_that_was_killed_says_so_and_the_next_question_works(worker):
    ask(worker, "count", 1)
    with pytest.raises(StateError, match="was killed"):
        ask(worker, "be_killed")
    assert json.loads(ask(worker, "count", 1))["count"] == 2
    process = process_of(worker)
    os.kill(process.pid, signal.SIGKILL)
    assert has_ended(process)
    assert json.loads(ask(worker, "count", 1))["count"] == 3


def test_cancelling_ends_the_process_and_drops_what_waits(worker):
    begun = threading.Event()
    running = worker.submit(f"{COUNTER}.tell_and_wait", seconds=PATIENCE_S, progress=lambda text: begun.set())
    waiting = worker.submit(f"{COUNTER}.count", 1, seconds=PATIENCE_S)
    assert begun.wait(PATIENCE_S)
    process = process_of(worker)
    worker.cancel(waiting)
    worker.cancel(running)
    assert has_ended(process)
    with pytest.raises(StateError, match="was cancelled"):
        running.answer.result(PATIENCE_S)
    assert waiting.answer.cancelled()
    assert json.loads(ask(worker, "count", 1))["count"] == 1


def test_a_caller_that_is_cancelled_ends_its_question(worker):
    async def given_up():
        asked = asyncio.ensure_future(worker.ask(f"{COUNTER}.wait", seconds=PATIENCE_S))
        while worker.pid is None:
            await asyncio.sleep(0)
        process = process_of(worker)
        asked.cancel()
        with pytest.raises(asyncio.CancelledError):
            await asked
        return process

    assert has_ended(asyncio.run(given_up()))


def test_it_ends_when_it_is_idle_and_goes_on_later(workers):
    worker = workers.worker("counter", COUNTER, (), WorkerLimits(memory_mb=100, idle_s=0.05))
    before = json.loads(ask(worker, "count", 1))
    after = json.loads(ask(worker, "count", 1))
    assert after["count"] == 2
    running = worker._running
    assert running is None or has_ended(running.process)
    assert before["pid"] != os.getpid()


def test_only_so_many_run_and_the_one_that_was_used_longest_ago_makes_room():
    workers = Workers(most=2)
    first, second, third = (workers.worker(f"number {k}", COUNTER, (), LIMITS) for k in range(3))
    try:
        ask(first, "count", 1)
        ask(second, "count", 1)
        ask(first, "count", 1)
        ask(third, "count", 1)
        assert second.pid is None
        assert first.pid is not None
        begun = [threading.Event(), threading.Event()]
        for worker, event in zip((first, third), begun, strict=True):
            worker.submit(
                f"{COUNTER}.tell_and_wait", seconds=PATIENCE_S, progress=lambda text, event=event: event.set()
            )
        assert all(event.wait(PATIENCE_S) for event in begun)
        with pytest.raises(StateError, match=r"(?s)as much as it may.*allowed: 2 at once"):
            ask(second, "count", 1)
    finally:
        workers.end()


def test_of_a_group_the_free_one_that_knows_the_file_is_taken(workers):
    group = WorkerGroup(workers, 2, "counters", COUNTER, (), LIMITS)
    first = group.free("a")
    begun = threading.Event()
    first.submit(f"{COUNTER}.tell_and_wait", seconds=PATIENCE_S, progress=lambda text: begun.set())
    assert begun.wait(PATIENCE_S)
    second = group.free("a")
    assert second is not first, "nobody waits while one is free"
    ask(second, "count", 1)
    first.end()
    assert group.free("a") in (first, second)


def test_threads_that_ask_and_end_leave_the_process_that_workers_are_forked_from(workers):
    """A server answers requests in threads that come and go; its imports take seconds."""
    forkserver._forkserver._stop()  # the first of these threads starts it
    forked_from = []

    def ask_a_new_one():
        worker = workers.worker("counter", COUNTER, (), LIMITS)
        ask(worker, "count", 1)
        forked_from.append(Path(f"/proc/{worker.pid}/stat").read_text().rpartition(")")[2].split()[1])

    for _ in range(2):
        thread = threading.Thread(target=ask_a_new_one)
        thread.start()
        thread.join()
    assert forked_from[0] == forked_from[1]


def threads_of(name):
    return [thread for thread in threading.enumerate() if thread.name == f"worker {name}"]


def test_its_thread_lives_as_long_as_its_process(workers):
    worker = workers.worker("threaded", COUNTER, (), LIMITS)
    ask(worker, "count", 1)
    (thread,) = threads_of("threaded")
    assert worker.rest()
    thread.join(PATIENCE_S)
    assert not thread.is_alive()
    assert json.loads(ask(worker, "count", 1))["count"] == 2


@pytest.mark.parametrize("error", [EOFError(), BlockingIOError(11, "Resource temporarily unavailable")])
def test_where_no_process_can_be_forked_the_question_is_answered_with_that(workers, worker, monkeypatch, error):
    def refuse(arguments):
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(workers, "start", refuse)
        with pytest.raises(StateError, match="start no further process"):
            ask(worker, "count", 1)
    assert json.loads(ask(worker, "count", 1))["count"] == 1


def test_where_no_thread_can_be_started_the_next_question_works(worker, monkeypatch):
    def refuse(thread):
        raise RuntimeError("can't start new thread")

    worker._starter.prepare()
    with monkeypatch.context() as patch:
        patch.setattr(worker._starter, "prepare", lambda: None)
        patch.setattr(threading.Thread, "start", refuse)
        with pytest.raises(StateError, match="start no further process"):
            ask(worker, "count", 1)
    assert json.loads(ask(worker, "count", 1))["count"] == 1


def test_whoever_wants_a_new_one_does_not_wait_for_the_end_of_another(monkeypatch):
    """The event loop makes workers; a process in the hands of a disk that hangs takes its time to end."""
    workers = Workers(most=1)
    first, second = (workers.worker(f"number {k}", COUNTER, (), LIMITS) for k in range(2))
    ending, go_on = threading.Event(), threading.Event()
    try:
        ask(first, "count", 1)
        monkeypatch.setattr(process_of(first), "join", lambda timeout: (ending.set(), go_on.wait()))
        asked = second.submit(f"{COUNTER}.count", 1, seconds=PATIENCE_S)
        assert ending.wait(PATIENCE_S)
        workers.worker("number 3", COUNTER, (), LIMITS)
        assert first.questions == 0
        go_on.set()
        asked.answer.result(PATIENCE_S)
    finally:
        go_on.set()
        workers.end()


def test_nothing_is_imported_from_the_working_directory(tmp_path):
    """Somebody else may write there, as in /tmp."""
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    for name in ("selectors", "compd", "signal"):
        (foreign / f"{name}.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    script = tmp_path / "own" / "page.py"
    script.parent.mkdir()
    script.write_text(
        "from compd.page.workers.workers import Workers\n"
        "if __name__ == '__main__':\n"
        f"    worker = Workers().worker('counter', {COUNTER!r}, (), __import__('compd.page.workers.limits', "
        "fromlist=['x']).WorkerLimits(100))\n"
        f"    print(worker.submit('{COUNTER}.count', 1, seconds=60).answer.result())\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, sys.path)])}
    command = [sys.executable, script]
    done = subprocess.run(command, cwd=foreign, env=environment, capture_output=True, text=True, check=False)
    assert '"count": 1' in done.stdout, done.stderr
    assert not (tmp_path / "ran").exists()


def test_at_the_end_no_process_is_left(workers):
    made = [workers.worker("counter", COUNTER, (), LIMITS) for _ in range(2)]
    for worker in made:
        ask(worker, "count", 1)
    processes = [process_of(worker) for worker in made]
    workers.end()
    assert all(has_ended(process) for process in processes)
