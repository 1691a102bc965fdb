"""Lines by connected device: finds two lines to one gateway even if they name it differently."""

from __future__ import annotations

import threading

import structlog

log = structlog.get_logger()


class Peers:
    """The far ends of one process's TCP connections. Used by the threads of all its lines."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._peer_of: dict[str, str] = {}

    def connected(self, line: str, peer: str) -> None:
        """Note that `line` is connected to `peer` (address and port; "" once it is gone). A shared peer is logged."""
        with self._lock:
            others = [name for name, known in self._peer_of.items() if peer and known == peer and name != line]
            self._peer_of[line] = peer
        if others:
            log.warning("lines share a device", line=line, lines=others, peer=peer)

    def closed(self, line: str) -> None:
        """Note that `line` is disconnected."""
        with self._lock:
            self._peer_of.pop(line, None)
