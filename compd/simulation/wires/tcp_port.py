"""The TCP port that the daemon of a simulated machine listens on."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager

LOOPBACK = "127.0.0.1"
ANY = 0


@contextmanager
def claimed_port(wanted: int) -> Iterator[int]:
    """The configured TCP port, or 0 (any) if a daemon uses it or another simulator has claimed it.

    The daemon starts later than the simulator and binds the port itself, so a claim is a name in Linux's abstract
    namespace of Unix sockets, which goes with the process that holds it.
    """
    with socket.socket(socket.AF_UNIX) as claim:
        try:
            claim.bind(f"\0compd-simulate-tcp-{wanted}")
        except OSError:
            yield ANY
            return
        yield wanted if _is_free(wanted) else ANY


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError:
            return False
    return True
