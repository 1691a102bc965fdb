"""An answer larger than the system's buffers, and a browser that reads it slower than it may take to ask anew."""

from __future__ import annotations

import asyncio
import select
import socket
import threading
from contextlib import contextmanager

import pytest
import uvicorn

from compd.page.connections import ConnectionLimits, Connections
from compd.page.counted_log import CountedLog
from compd.page.limited_protocol import EVENTS_BUFFER_BYTES, HEAD_WITHIN_S, LimitedProtocol
from compd.page.run import limited_config
from tests.support.event_stream import connected

pytestmark = [pytest.mark.long, pytest.mark.sample]

LARGE = bytes(24 * 2**20)
REQUEST = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
# Of the server's timers and this computer.
MORE_S = 2.0


@contextmanager
def server(begin):
    """Answers every request with LARGE; its address. begin : called with the connection first."""

    async def app(scope, receive, send):
        connection = LimitedProtocol.of(scope)
        assert connection.admit("Anna")
        begin(connection)
        size = [(b"content-length", str(len(LARGE)).encode())]
        await send({"type": "http.response.start", "status": 200, "headers": size})
        await send({"type": "http.response.body", "body": LARGE})

    log = CountedLog(lambda: 0.0, lambda within_s, function: None)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        running = uvicorn.Server(limited_config(app, Connections(ConnectionLimits(), log)))
        running.config.lifespan = "off"
        loop = asyncio.new_event_loop()
        thread = threading.Thread(target=loop.run_until_complete, args=(running.serve([listener]),))
        thread.start()
        try:
            yield f"http://127.0.0.1:{listener.getsockname()[1]}/"
        finally:
            running.should_exit = True
            thread.join()
            loop.close()


def read_all(connection, octets):
    left = octets
    while left > 0 and (piece := connection.recv(1 << 20)):
        left -= len(piece)
    return octets - left


def test_what_is_read_late_comes_whole():
    with server(lambda connection: None) as address, connected(address, receive_buffer_octets=4096) as connection:
        connection.sendall(REQUEST)
        head = connection.recv(1024).partition(b"\r\n\r\n")
        poll = select.poll()
        poll.register(connection, select.POLLHUP | select.POLLERR)
        assert poll.poll(1e3 * (HEAD_WITHIN_S + MORE_S)) == [], "it is cut"
        assert read_all(connection, len(LARGE) - len(head[2])) == len(LARGE) - len(head[2])


def test_of_events_little_waits_for_who_does_not_read():
    sizes = []

    def begin(connection):
        connection.begin_events()
        own = connection.transport.get_extra_info("socket")
        sizes.append(own.getsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF))

    with server(begin) as address, connected(address) as connection:
        connection.sendall(REQUEST)
        assert connection.recv(1024).startswith(b"HTTP/1.1 200")
    # Linux counts its own bookkeeping, too: twice as much
    assert sizes == [2 * EVENTS_BUFFER_BYTES]
