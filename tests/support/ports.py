"""TCP ports for servers that cannot choose one themselves."""

from __future__ import annotations

import random
import socket

# Below the ports that the system gives to whoever asks for any (ip_local_port_range).
_OWN = range(12_000, 32_000)


def free_port() -> int:
    """A port of this computer at which nobody listens. The system gives it to nobody else meanwhile."""
    chosen = random.SystemRandom()
    while True:
        port = chosen.choice(_OWN)
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:  # taken
                continue
            return port
