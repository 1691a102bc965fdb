"""Which lines are connected to which device, so that two lines to one gateway are noticed, whatever its names are."""

from __future__ import annotations

import threading

import structlog

log = structlog.get_logger()


class Peers:
    """The other ends of the TCP connections of one process. Used by the threads of all its lines."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._peer_of: dict[str, str] = {}

    def connected(self, line: str, peer: str) -> None:
        """`line` is connected to `peer`: address and port, "" where it is gone again. Logged where another line is."""
        with self._lock:
            others = [name for name, known in self._peer_of.items() if peer and known == peer and name != line]
            self._peer_of[line] = peer
        if others:
            log.warning("lines share a device", line=line, lines=others, peer=peer)

    def closed(self, line: str) -> None:
        """`line` is not connected any more."""
        with self._lock:
            self._peer_of.pop(line, None)
