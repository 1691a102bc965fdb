"""Packets to one address, over UDP."""

from __future__ import annotations

import socket
from typing import Any


class Datagrams:
    """A UDP socket that sends to one address, and never waits."""

    def __init__(self, host: str, port: int) -> None:
        """Raises OSError for an unknown host."""
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self._address: Any = address
        self._socket = socket.socket(family, kind, protocol)
        self._socket.setblocking(False)

    def send(self, packet: bytes) -> None:
        """Send a packet. Raises OSError where the system does not take it at once."""
        self._socket.sendto(packet, self._address)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
