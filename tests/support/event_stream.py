"""A client of the page's server that is no browser: any request, and a stream of events that it need not read."""

from __future__ import annotations

import json
import select
import socket
import time
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from tests.support.patience import PATIENCE_S

_PIECE_OCTETS = 4096


class Answer(NamedTuple):
    """Of the server. text : headers and body."""

    status: int
    text: str


class Event(NamedTuple):
    """As it came. arrived_s : monotonic time, s. octets : of its data."""

    name: str
    arrived_s: float
    octets: int
    data: dict[str, Any]


def host_of(address: str) -> str:
    """Name and port of the server at `address`."""
    return urlsplit(address).netloc


def connected(address: str, receive_buffer_octets: int = 0) -> socket.socket:
    """A connection to the server at `address`."""
    name, _, port = host_of(address).rpartition(":")
    family = socket.AF_INET6 if name.startswith("[") else socket.AF_INET
    connection = socket.socket(family, socket.SOCK_STREAM)
    connection.settimeout(PATIENCE_S)
    if receive_buffer_octets:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer_octets)
    connection.connect((name.strip("[]"), int(port)))
    return connection


def request(
    address: str, method: str, target: str, headers: Mapping[str, str] | None = None, body: bytes = b""
) -> Answer:
    """Send a request just as it is given, and read the whole answer. `headers` with the value "" are left out."""
    given = {"Host": host_of(address), "Connection": "close", "Content-Length": str(len(body)), **(headers or {})}
    lines = [f"{method} {target} HTTP/1.1", *(f"{name}: {value}" for name, value in given.items() if value), "", ""]
    answer = b""
    with connected(address) as connection:
        try:
            connection.sendall("\r\n".join(lines).encode("latin-1"))
            for start in range(0, len(body), _PIECE_OCTETS):
                if select.select([connection], [], [], 0.0)[0]:
                    break  # it has answered before it took all of the body
                connection.sendall(body[start : start + _PIECE_OCTETS])
            while piece := connection.recv(65536):
                answer += piece
        except (BrokenPipeError, ConnectionResetError):
            pass  # it has hung up
    status = answer.split(b" ", 2)[1] if answer.startswith(b"HTTP/") else b"0"
    return Answer(int(status), answer.decode(errors="replace"))


def cookie_of(address: str) -> str:
    """The cookie that the address with its token gives."""
    answer = request(address, "GET", f"/?{urlsplit(address).query}")
    (line,) = (line for line in answer.text.splitlines() if line.lower().startswith("set-cookie:"))
    return line.partition(":")[2].partition(";")[0].strip()


class EventStream:
    """The events of one connection, read when they are asked for; a context manager that hangs up."""

    def __init__(self, address: str, receive_buffer_octets: int = 0) -> None:
        cookie = cookie_of(address)
        self._connection = connected(address, receive_buffer_octets)
        lines = ["GET /live HTTP/1.1", f"Host: {host_of(address)}", f"Cookie: {cookie}", "", ""]
        self._connection.sendall("\r\n".join(lines).encode())
        self._lines = self._connection.makefile("rb", buffering=4096)

    def __enter__(self) -> EventStream:
        return self

    def __exit__(self, *_: object) -> None:
        self._lines.close()
        self._connection.close()

    def __iter__(self) -> Iterator[Event]:
        """Each event; what frames them (the chunks' lengths) begins with neither word."""
        name = ""
        for line in self._lines:
            if line.startswith(b"event: "):
                name = line.split()[1].decode()
            elif line.startswith(b"data: "):
                yield Event(name, time.monotonic(), len(line), json.loads(line[6:]))
