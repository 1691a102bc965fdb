"""Which connection goes when one more comes, and what the log says of it."""

from __future__ import annotations

import resource

import pytest
from structlog.testing import capture_logs

from compd.page import connections
from compd.page.connections import ConnectionLimits, Connections, raised_descriptor_limit
from compd.page.counted_log import EVERY_S, CountedLog
from tests.support.hand_clock import HandClock

LIMITS = ConnectionLimits(unknown=3, of_token=2, known=4)


class OneConnection:
    """idle : whether nothing is being answered on it."""

    def __init__(self, idle=True):
        self.idle, self.is_open = idle, True

    def drop(self):
        self.is_open = False


class Later:
    """Keeps what is to be called later; a test calls it."""

    def __init__(self):
        self.waiting = []

    def __call__(self, within_s, function):
        self.waiting.append((within_s, function))


@pytest.fixture
def later():
    return Later()


@pytest.fixture
def clock():
    return HandClock()


@pytest.fixture
def log(later, clock):
    return CountedLog(clock.monotonic, later)


@pytest.fixture
def all_connections(log):
    return Connections(LIMITS, log)


def come(all_connections, count, idle=True):
    coming = [OneConnection(idle) for _ in range(count)]
    for connection in coming:
        all_connections.came(connection)
    return coming


def test_the_oldest_without_a_token_goes_for_a_newcomer(all_connections):
    coming = come(all_connections, 5)
    assert [connection.is_open for connection in coming] == [False, False, True, True, True]
    assert all_connections.count() == (3, 0)


def test_one_that_has_shown_a_token_stays(all_connections):
    (first,) = come(all_connections, 1)
    assert all_connections.admit(first, "Anna")
    assert all_connections.admit(first, "Anna"), "with its second request"
    come(all_connections, 10)
    assert first.is_open
    assert all_connections.count() == (3, 1)
    all_connections.went(first)
    assert all_connections.count() == (3, 0)


def test_a_token_that_has_its_share_loses_the_oldest_that_is_idle(all_connections):
    streams = come(all_connections, 1, idle=False)
    between = come(all_connections, 1)
    (new,) = come(all_connections, 1)
    for connection in (*streams, *between):
        assert all_connections.admit(connection, "screen")
    assert all_connections.admit(new, "screen")
    assert [connection.is_open for connection in (*streams, *between, new)] == [True, False, True]


def test_a_token_whose_connections_are_all_in_use_gets_no_more_and_others_do(all_connections):
    streams = come(all_connections, 3, idle=False)
    assert [all_connections.admit(stream, "screen") for stream in streams] == [True, True, False]
    (anna,) = come(all_connections, 1)
    assert all_connections.admit(anna, "Anna")
    assert all(stream.is_open for stream in streams[:2])


def test_where_all_places_are_taken_the_token_that_has_most_loses_one(all_connections):
    for name, count in (("screen", 2), ("Anna", 1), ("Bert", 1)):
        for connection in come(all_connections, count, idle=False):
            assert all_connections.admit(connection, name)
    (new,) = come(all_connections, 1)
    assert all_connections.admit(new, "Carla")
    assert all_connections.count() == (0, 4)


def test_one_that_has_gone_meanwhile_takes_no_place(all_connections):
    (gone,) = come(all_connections, 1, idle=False)
    all_connections.went(gone)
    assert not all_connections.admit(gone, "Anna")
    assert all_connections.count() == (0, 0)


def test_a_connection_of_a_proxy_is_counted_for_the_token_that_it_carries_now(all_connections):
    (connection,) = come(all_connections, 1)
    assert all_connections.admit(connection, "Anna")
    assert all_connections.admit(connection, "Bert")
    assert all_connections.count() == (0, 1)


@pytest.mark.parametrize("descriptors", [64, 256, 1024, 4096, 10**6])
def test_the_limits_leave_half_of_the_descriptors(descriptors):
    limits = ConnectionLimits.for_descriptors(descriptors)
    assert 0 < limits.of_token <= limits.known
    assert limits.unknown > 0
    assert limits.unknown + limits.known <= descriptors / 2


@pytest.mark.parametrize(
    ("soft", "hard", "limit"),
    [(1024, 1048576, 4096), (256, 512, 512), (8192, 8192, 8192), (-1, -1, 4096), (1024, -1, 4096)],
)
def test_the_process_may_open_as_many_files_as_it_wants_and_may(monkeypatch, soft, hard, limit):
    asked = []
    monkeypatch.setattr(connections.resource, "getrlimit", lambda kind: (soft, hard))
    monkeypatch.setattr(connections.resource, "setrlimit", lambda kind, limits: asked.append(limits))
    assert resource.RLIM_INFINITY == -1
    assert raised_descriptor_limit() == limit
    assert asked in ([], [(limit, hard)])


def test_the_log_has_one_line_a_minute_with_the_counts_between(log, later, clock):
    with capture_logs() as lines:
        log.note("too_slow")
        log.note("no_http")
        ((within_s, write),) = later.waiting
        assert within_s == 0.0
        write()
        later.waiting.clear()
        for _ in range(1000):
            clock.now_s += 0.01
            log.note("too_slow")
        ((within_s, write),) = later.waiting
        assert within_s == pytest.approx(EVERY_S - 0.01)
        clock.now_s += within_s
        write()
    assert [(line.get("too_slow"), line.get("no_http")) for line in lines] == [(1, 1), (1000, None)]
