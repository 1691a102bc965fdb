"""Shares: a quarter for a token, half for all that only look, and a place for whoever operates."""

from __future__ import annotations

import json
import threading

import pytest

from compd.errors import StateError
from compd.page.guard import Token, hashed
from compd.page.shares import ASKER, Places
from compd.page.workbench.routes import MAX_OPEN
from compd.page.workers.limits import WorkerLimits
from compd.page.workers.workers import Workers
from tests.support.patience import PATIENCE_S
from tests.unit.page.workers.test_worker import COUNTER, ask


def token(name, role="view"):
    return Token(name, role, hashed(name))


@pytest.mark.parametrize("most", [16, 8, MAX_OPEN])
def test_those_who_look_leave_half_of_the_places_and_a_token_three_quarters(most):
    places = Places(most)
    for _ in range(most // 4):
        assert places.take(token("a")) is None
    assert places.take(token("a")).whose == "for one token"
    for _ in range(most // 4):
        assert places.take(token("b")) is None
    assert places.take(token("c")).whose == "for all tokens that only look"
    for name in ("d", "e"):
        for _ in range(most // 4):
            assert places.take(token(name, "operate")) is None
    assert places.take(token("f", "operate")).most == most
    places.give_back(token("b"))
    assert places.take(token("c")) is None


def test_of_few_places_each_token_has_one():
    places = Places(2)
    assert places.take(token("a")) is None
    assert places.take(token("b")) is not None
    assert places.take(token("c", "operate")) is None


@pytest.fixture
def workers():
    workers = Workers(most=8)
    yield workers
    workers.end()


def asking(who, workers, name="counter"):
    """A new worker that the token keeps busy, once it is at it; raises what is refused."""
    begun = threading.Event()
    worker = workers.worker(name, COUNTER, (), WorkerLimits(memory_mb=100))
    before = ASKER.set(who)
    try:
        asked = worker.submit(f"{COUNTER}.tell_and_wait", seconds=PATIENCE_S, progress=lambda text: begun.set())
    finally:
        ASKER.reset(before)
    while not begun.wait(0.01):
        if asked.answer.done():
            asked.answer.result()
    return worker


def test_processes_are_shared_out_as_places_are(workers):
    busy = [asking(token("a"), workers) for _ in range(2)]
    with pytest.raises(StateError, match="2 at once for one token"):
        asking(token("a"), workers)
    busy += [asking(token("b"), workers) for _ in range(2)]
    with pytest.raises(StateError, match="4 at once for all tokens that only look"):
        asking(token("c"), workers)
    busy += [asking(token("d", "operate"), workers) for _ in range(2)]
    busy[0].end()
    while busy[0].pid is not None:
        threading.Event().wait(0.01)  # for its thread
    asking(token("c"), workers)


def test_a_token_that_asks_another_s_process_has_it_and_its_own_idle_one_makes_room(workers):
    first = workers.worker("first", COUNTER, (), WorkerLimits(memory_mb=100))
    for who, kept in ((token("a"), 1), (token("b", "operate"), 2)):
        before = ASKER.set(who)
        assert json.loads(ask(first, "count", 1))["count"] == kept
        ASKER.reset(before)
        assert first.token == who
    for _ in range(2):
        asking(token("b", "operate"), workers)
    assert first.pid is None, "it was idle"


@pytest.mark.parametrize(("role", "nice"), [("view", 19), ("operate", 10)])
def test_who_operates_goes_first(workers, role, nice):
    before = ASKER.set(token("a", role))
    worker = workers.worker("counter", COUNTER, (), WorkerLimits(memory_mb=100))
    assert json.loads(ask(worker, "count", 1))["nice"] == nice
    ASKER.reset(before)
