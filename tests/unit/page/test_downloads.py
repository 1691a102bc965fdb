"""Downloads over real connections: shared out, as they are on the disk, and ended with their browser."""

from __future__ import annotations

import asyncio
import io
import select
import socket
import threading
import zipfile
from contextlib import contextmanager

import pytest
import uvicorn

from compd.page.connections import ConnectionLimits, Connections
from compd.page.counted_log import CountedLog
from compd.page.downloads import MAX_DOWNLOADS, PIECE_BYTES, Downloads, zipped
from compd.page.guard import Token, hashed
from compd.page.limited_protocol import LimitedProtocol
from compd.page.run import limited_config
from tests.support.event_stream import connected, request
from tests.support.patience import PATIENCE_S

LARGE = PIECE_BYTES * 200


@contextmanager
def server(pieces, **settings):
    """A server that answers each request with a download for the token that the path names; address and downloads."""
    downloads = Downloads(**settings)

    async def app(scope, receive, send):
        name = scope["path"].strip("/")
        assert LimitedProtocol.of(scope).admit(name)
        scope["token"] = Token(name, "operate" if name.startswith("o") else "view", hashed(name))
        await downloads.answer(pieces(), "application/zip", {})(scope, receive, send)

    log = CountedLog(lambda: 0.0, lambda within_s, function: None)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        running = uvicorn.Server(limited_config(app, Connections(ConnectionLimits(), log)))
        running.config.lifespan = "off"
        loop = asyncio.new_event_loop()
        thread = threading.Thread(target=loop.run_until_complete, args=(running.serve([listener]),))
        thread.start()
        try:
            yield f"http://127.0.0.1:{listener.getsockname()[1]}/", downloads
        finally:
            running.should_exit = True
            thread.join()
            loop.run_until_complete(asyncio.sleep(0.0))  # connections that are just being closed
            loop.close()


def begun(address, name):
    """A connection whose download has begun, and is not read further."""
    connection = connected(address, receive_buffer_octets=4096)
    connection.sendall(f"GET /{name} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
    assert connection.recv(12).endswith(b"200")
    return connection


def large():
    return iter([bytes(PIECE_BYTES)] * 200)


def test_a_token_and_those_who_look_have_their_share_and_places_come_back():
    ended = threading.Event()

    def pieces():
        try:
            yield from large()
        finally:
            ended.set()

    with server(pieces) as (address, downloads):
        a = [begun(address, "a") for _ in range(MAX_DOWNLOADS // 4)]
        assert request(address, "GET", "/a").status == 503
        b = [begun(address, "b") for _ in range(MAX_DOWNLOADS // 4)]
        assert "all tokens that only look" in request(address, "GET", "/c").text
        begun(address, "o").close()
        for connection in (*a, *b):
            connection.close()
        assert ended.wait(PATIENCE_S)
        while downloads.places._taken:
            threading.Event().wait(0.01)  # for the server's thread
        with begun(address, "a") as connection:
            left = LARGE
            while left > 0 and (piece := connection.recv(1 << 20)):
                left -= len(piece)
        assert left <= 0, "it comes whole"


def test_nothing_is_read_for_a_browser_that_has_left_or_asks_for_the_head_alone():
    read, left = [], threading.Event()

    def pieces():
        try:
            for piece in large():
                read.append(len(piece))
                yield piece
        finally:
            left.set()

    with server(pieces) as (address, _):
        begun(address, "a").close()
        assert left.wait(PATIENCE_S)
        assert sum(read) < LARGE / 2
        del read[:]
        assert request(address, "HEAD", "/a").status == 200
        assert read == []


def test_a_browser_that_does_not_read_is_hung_up_on():
    with server(large, taken_within_s=0.2) as (address, _), begun(address, "a") as connection:
        poll = select.poll()
        poll.register(connection, select.POLLHUP | select.POLLERR)
        assert poll.poll(1e3 * PATIENCE_S)


def test_a_zip_has_the_files_as_they_are_when_it_begins(tmp_path):
    table, sidecar = tmp_path / "run.csv", tmp_path / "run.yaml"
    table.write_bytes(bytes(range(256)) * 4000)
    sidecar.write_bytes(b"")
    pieces = zipped([table, sidecar])
    begin = next(pieces)
    with table.open("ab") as file:
        file.write(b"more")
    with zipfile.ZipFile(io.BytesIO(begin + b"".join(pieces))) as archive:
        assert archive.testzip() is None
        assert archive.read("run.csv") == bytes(range(256)) * 4000
        assert archive.read("run.yaml") == b""
        assert {entry.compress_type for entry in archive.infolist()} == {zipfile.ZIP_STORED}


@pytest.mark.parametrize("name", ["run.csv", "run.yaml"])
def test_a_link_is_not_followed(tmp_path, name):
    (tmp_path / name).symlink_to("/etc/hostname")
    with pytest.raises(OSError, match="symbolic links"):
        list(zipped([tmp_path / name]))
