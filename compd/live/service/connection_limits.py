"""Limits on clients, and which of them lose their place, so that no host on the network can shut the owner out."""

from __future__ import annotations

import math
import socket

from compd.live.service.client_session import ClientSession
from compd.live.service.messages import ErrorCode, ProtocolError

MAX_CLIENTS = 32
# The other places are for clients of the Unix socket: the owner's own.
MAX_TCP_CLIENTS = 24
# A TCP client that neither watches, nor asks, nor is the controller.
IDLE_AFTER_S = 60.0
# A TCP client that has to show a token first.
AUTH_WITHIN_S = 5.0
# Delay (s) after a wrong token, which prevents guessing.
WRONG_TOKEN_REST_S = 1.0

# A peer whose computer or cable is gone is noticed after about 10 s, tcp(7).
KEEPALIVE = {
    (socket.SOL_SOCKET, socket.SO_KEEPALIVE): 1,
    (socket.IPPROTO_TCP, socket.TCP_KEEPIDLE): 4,  # s without a word, then a probe
    (socket.IPPROTO_TCP, socket.TCP_KEEPINTVL): 2,  # s between two probes
    (socket.IPPROTO_TCP, socket.TCP_KEEPCNT): 3,  # probes without an answer
    (socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT): 10_000,  # ms that data may stay unacknowledged
}


def prepare_tcp(connection: socket.socket) -> None:
    """Send without delay, and notice a peer that has gone without a word."""
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    for (level, option), value in KEEPALIVE.items():
        connection.setsockopt(level, option, value)


def seat_refused(local: bool, clients: int, tcp_clients: int) -> ProtocolError | None:
    """Why there is no place for another client, next to `clients`, of which `tcp_clients` came over TCP."""
    if clients >= MAX_CLIENTS:
        return ProtocolError(ErrorCode.TOO_MANY_CLIENTS, f"{MAX_CLIENTS} clients at most")
    if not local and tcp_clients >= MAX_TCP_CLIENTS:
        return ProtocolError(ErrorCode.TOO_MANY_CLIENTS, f"{MAX_TCP_CLIENTS} clients over TCP at most")
    return None


def seat_lost(session: ClientSession, is_controller: bool, now_s: float) -> ProtocolError | None:
    """Why a client loses its place at `now_s`; None where it keeps it."""
    if session.local:
        return None
    if not session.authorized:
        if now_s - session.connected_s > AUTH_WITHIN_S:
            return ProtocolError(ErrorCode.NOT_AUTHORIZED, f"no token within {AUTH_WITHIN_S:g} s")
        return None
    watches = session.due_s < math.inf
    if not watches and not is_controller and now_s - session.asked_s > IDLE_AFTER_S:
        return ProtocolError(ErrorCode.IDLE, f"watched nothing and asked nothing for {IDLE_AFTER_S:g} s")
    return None
