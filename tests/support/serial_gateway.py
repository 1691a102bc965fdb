"""A Modbus TCP gateway before one RS-485 bus, as the makers describe theirs; it shares no code with compd.

All connections put their requests into one queue, and the bus takes one after the other. For a unit that does not
answer the gateway waits `wait_s`; then it answers exception 11 (Modbus Application Protocol V1.1b3, chapter 7), or
nothing at all.
"""

from __future__ import annotations

import queue
import socket
import struct
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress

READS = (3, 4)
NO_ANSWER = 11


class SerialGateway:
    """Units 1 to `units`, whose registers all have the unit's number.

    Attributes
    ----------
    dead : units that do not answer; may be changed at any time.
    asked : requests that the bus has taken, by unit.
    connections : how many were accepted.
    """

    def __init__(self, units: int, exchange_s: float, wait_s: float, exceptions: bool, host: str = "127.0.0.1") -> None:
        """`exchange_s`: on the bus, of a live unit, s; `exceptions`: answer exception 11 for a dead one, or nothing."""
        self.dead: set[int] = set()
        self.asked: Counter[int] = Counter()
        self.connections = 0
        self._units = units
        self._exchange_s = exchange_s
        self._wait_s = wait_s
        self._exceptions = exceptions
        self._requests: queue.Queue[tuple[socket.socket, bytes] | None] = queue.Queue()
        self._listener = socket.create_server((host, 0))
        self.port: int = self._listener.getsockname()[1]
        self._ended = threading.Event()
        self._open: list[socket.socket] = []
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._accept, self._serve)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """End all connections."""
        self._ended.set()
        self._requests.put(None)
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for connection in self._open:
            _shut(connection)
        for thread in self._threads:
            thread.join()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            self.connections += 1
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._open.append(connection)
            threading.Thread(target=self._receive, args=[connection], daemon=True).start()

    def _receive(self, connection: socket.socket) -> None:
        with connection, connection.makefile("rb") as stream:
            try:
                while head := stream.read(6):
                    self._requests.put((connection, head + stream.read(struct.unpack(">4xH", head)[0])))
            except (OSError, struct.error):
                return

    def _serve(self) -> None:
        """The bus."""
        while (request := self._requests.get()) is not None:
            connection, frame = request
            unit, function, _, count = struct.unpack(">BBHH", frame[6:12])
            self.asked[unit] += 1
            if function in READS and 1 <= unit <= self._units and unit not in self.dead:
                self._ended.wait(self._exchange_s)
                answer = bytes([function, 2 * count]) + count * unit.to_bytes(2, "big")
            else:
                self._ended.wait(self._wait_s)
                answer = bytes([function | 0x80, NO_ANSWER]) if self._exceptions else b""
            if answer:
                head = frame[:4] + (len(answer) + 1).to_bytes(2, "big")
                try:
                    connection.sendall(head + bytes([unit]) + answer)
                except OSError:  # closed meanwhile: the bus has been busy all the same
                    continue


def _shut(connection: socket.socket) -> None:
    with suppress(OSError):
        connection.shutdown(socket.SHUT_RDWR)


@contextmanager
def serial_gateway(
    units: int, exchange_s: float, wait_s: float, exceptions: bool, host: str = "127.0.0.1"
) -> Iterator[SerialGateway]:
    """A gateway that is closed at the end."""
    gateway = SerialGateway(units, exchange_s, wait_s, exceptions, host)
    try:
        yield gateway
    finally:
        gateway.close()
