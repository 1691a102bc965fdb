"""Connections that show no token, in numbers: the page stays usable, its log quiet, and nothing of them is kept."""

from __future__ import annotations

import re
import resource
import select
import time
from contextlib import ExitStack, contextmanager, suppress
from itertools import islice
from pathlib import Path
from types import SimpleNamespace

import pytest

from compd.page.connections import ConnectionLimits
from compd.page.limited_protocol import MAX_HEAD_BYTES
from tests.support.event_stream import EventStream, connected, cookie_of, host_of, request
from tests.support.live_page import memory_mb, page_process
from tests.support.patience import PATIENCE_S

pytestmark = [pytest.mark.long, pytest.mark.sample]

MANY = 1100
UNKNOWN = ConnectionLimits().unknown
# Sockets of the server itself, and connections that are just being closed.
MORE_DESCRIPTORS = 24
GROWTH_MB = 30.0
MAX_LOG_BYTES = 2000
HUGE_BYTES = 10 * 10**9
# Buffers of the system, and what is sent before the refusal has come.
MAX_SENT_BYTES = 50e6
# Each of them is answered before a newcomer is taken.
MANY_WHOLE = 500


@pytest.fixture(scope="module", autouse=True)
def descriptors():
    """This process holds the other ends of all those connections."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < 4 * MANY:
        pytest.skip(f"this process may open {hard} files only")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 4 * MANY), hard))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.fixture
def page(tmp_path):
    """A page of its own, without a daemon; afterwards its log is short, and every descriptor is released."""
    with page_process(Path("/no/socket"), tmp_path / "recordings") as (address, pid):
        cookie = cookie_of(address)
        log = tmp_path / "page.log"
        served = SimpleNamespace(address=address, pid=pid, cookie=cookie, log=log)
        before, before_mb, logged = open_files(pid), memory_mb(pid), log.stat().st_size
        yield served
        assert memory_mb(pid) - before_mb < GROWTH_MB
        text = log.read_text()[logged:]
        assert len(text) < MAX_LOG_BYTES, text
        assert "Traceback" not in text
        until_released(pid, before)


def open_files(pid):
    return len(list(Path(f"/proc/{pid}/fd").iterdir()))


def until_released(pid, before):
    """A connection that is closed is released within the next turns of the server's event loop."""
    until_s = time.monotonic() + PATIENCE_S
    while open_files(pid) > before:
        assert time.monotonic() < until_s, f"{open_files(pid)} descriptors are open, {before} were"


def assert_usable(page, events):
    """A person gets in, and another one's events go on."""
    answer = request(page.address, "GET", "/", {"Cookie": page.cookie})
    assert answer.status == 200
    assert len(list(islice(events, 3))) == 3
    assert open_files(page.pid) < UNKNOWN + MORE_DESCRIPTORS


@contextmanager
def crowd(page, count, first_bytes):
    """So many connections that have sent this."""
    with ExitStack() as stack:
        connections = []
        for _ in range(count):
            connection = stack.enter_context(connected(page.address))
            with suppress(BrokenPipeError, ConnectionResetError):  # closed for a newcomer already
                connection.sendall(first_bytes)
            connections.append(connection)
        yield connections


def is_closed(connection):
    try:
        return connection.recv(65536) == b""
    except ConnectionResetError:
        return True


def until_closed(connections, more=b""):
    """Wait until the server has closed them all; `more` is sent on each that is open, once a second."""
    began_s = time.monotonic()
    waiting = list(connections)
    for connection in waiting:
        connection.setblocking(False)
    while waiting:
        assert time.monotonic() - began_s < PATIENCE_S, f"{len(waiting)} are open still"
        poll = select.poll()
        by_number = {connection.fileno(): connection for connection in waiting}
        for number in by_number:
            poll.register(number, select.POLLIN | select.POLLHUP)
        for number, _ in poll.poll(1000):
            if is_closed(by_number[number]):
                waiting.remove(by_number[number])
        for connection in waiting if more else ():
            with suppress(BrokenPipeError, ConnectionResetError):  # the next look finds it closed
                connection.send(more)


@pytest.mark.parametrize("first_bytes", [b"", b"GET / HTTP/1.1\r\nHost: 127"], ids=["nothing", "half a head"])
def test_half_open_connections_leave_the_page_usable(page, first_bytes):
    with EventStream(page.address) as events:
        next(iter(events))
        with crowd(page, MANY, first_bytes) as connections:
            assert_usable(page, events)
            until_closed(connections)
        assert_usable(page, events)


def test_a_head_that_comes_byte_by_byte_has_no_longer(page):
    with EventStream(page.address) as events, crowd(page, UNKNOWN, b"GET / HTTP/1.1\r\n") as connections:
        assert_usable(page, events)
        until_closed(connections, more=b"a")
        assert_usable(page, events)


def test_a_head_without_an_end_and_what_is_no_http_are_refused(page):
    endless = b"GET / HTTP/1.1\r\nX: " + b"x" * (2 * MAX_HEAD_BYTES)
    many = "\r\n".join(["GET / HTTP/1.1", f"Host: {host_of(page.address)}", *(f"X{k}: 1" for k in range(500)), "", ""])
    with EventStream(page.address) as events:
        for sent in (
            endless,
            b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" * 20,
            b"\r\n\r\nBREW tea\r\n\r\n",
            many.encode(),
        ):
            with crowd(page, 200, sent) as connections:
                until_closed(connections)
        assert_usable(page, events)


def test_whole_requests_without_a_token_in_numbers(page):
    head = f"GET / HTTP/1.1\r\nHost: {host_of(page.address)}\r\n\r\n".encode()
    with EventStream(page.address) as events:
        for _ in range(3):
            with crowd(page, MANY_WHOLE, head) as connections:
                assert_usable(page, events)
                until_closed(connections)


def huge_head(page, *more):
    fields = (f"Host: {host_of(page.address)}", f"Origin: http://{host_of(page.address)}", *more)
    return "\r\n".join(["POST /join/exports?name=a.txt HTTP/1.1", *fields, "", ""]).encode()


def test_a_huge_body_that_never_comes_is_not_waited_for(page):
    with EventStream(page.address) as events:
        with crowd(page, MANY, huge_head(page, f"Content-Length: {HUGE_BYTES}")) as connections:
            assert_usable(page, events)
            until_closed(connections)
        assert_usable(page, events)


@pytest.mark.parametrize("field", [f"Content-Length: {HUGE_BYTES}", "Transfer-Encoding: chunked"])
def test_a_huge_body_that_comes_is_not_read(page, field):
    with connected(page.address) as connection:
        connection.sendall(huge_head(page, field))
        sent, piece = 0, b"10000\r\n" + b"x" * 65536 + b"\r\n"
        with suppress(BrokenPipeError, ConnectionResetError):
            while sent < HUGE_BYTES:
                connection.sendall(piece)
                sent += len(piece)
        assert sent < MAX_SENT_BYTES


def test_who_does_not_read_the_answer_does_not_stay(page):
    """Sixty-four times the form, asked for in one go by a connection that reads nothing."""
    head = f"GET /static/page.css HTTP/1.1\r\nHost: {host_of(page.address)}\r\n\r\n".encode()
    with connected(page.address, receive_buffer_octets=1024) as connection:
        connection.sendall(head * 64)
        poll = select.poll()
        poll.register(connection, select.POLLHUP | select.POLLERR | select.POLLRDHUP)
        assert poll.poll(1e3 * PATIENCE_S)


def test_one_token_has_its_share_of_connections(page):
    of_token = ConnectionLimits().of_token
    head = f"GET /live HTTP/1.1\r\nHost: {host_of(page.address)}\r\nCookie: {page.cookie}\r\n\r\n".encode()
    with ExitStack() as stack:
        for k in range(of_token + 1):
            connection = stack.enter_context(connected(page.address))
            connection.sendall(head)
            status = connection.recv(4096).split(b" ", 2)[1]
            assert status == (b"200" if k < of_token else b"503"), k


def test_what_a_person_sees_without_a_token_is_a_form_that_takes_one(page):
    answer = request(page.address, "GET", "/", {"Accept": "text/html"})
    assert answer.status == 403
    assert re.search(r'<form method="post" action="/token">', answer.text)
    token = re.search(r"token=(\S+)", page.address)[1]
    own = {"Origin": f"http://{host_of(page.address)}", "Content-Type": "application/x-www-form-urlencoded"}
    answer = request(page.address, "POST", "/token", own, f"token=+{token}+".encode())
    assert answer.status == 303
    assert page.cookie in answer.text
