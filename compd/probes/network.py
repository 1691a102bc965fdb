"""A device of the network: does it answer?"""

from __future__ import annotations

import socket

from compd.probes.finding import Finding, fault, good, unknown

_CONNECT_TIMEOUT_S = 1.0


def tcp_finding(subject: str, host: str, port: int, daemon_runs: bool) -> Finding:
    """Whether a device takes a connection. daemon_runs : it is then not connected to a second time."""
    address = f"{host}:{port}"
    if daemon_runs:
        return unknown(subject, f"{address} belongs to the running daemon; `compd status` says whether it answers")
    try:
        socket.create_connection((host, port), _CONNECT_TIMEOUT_S).close()
    except OSError as error:
        why = error.strerror or str(error)
        return fault(
            subject, f"{address} does not answer: {why}", f"{subject}: switch {host} on, check cable and address"
        )
    return good(subject, f"{address} answers")
