"""Warnings of `compd check` about two names of one device: its lines would wait for each other."""

from __future__ import annotations

import socket
from collections.abc import Iterator

from compd.configuration import Configuration, ModbusTcpLine, TcpLine
from compd.errors import Problem


def shared_address_warnings(configuration: Configuration) -> list[Problem]:
    """Lines over TCP with different host names, but a common address and port.

    A name that cannot be resolved on this computer is no warning: it may be one of the machine's network.
    """
    return list(_shared_addresses(configuration))


def _shared_addresses(configuration: Configuration) -> Iterator[Problem]:
    line_of: dict[tuple[str, int], str] = {}
    over_tcp = {name: line for name, line in configuration.lines.items() if isinstance(line, ModbusTcpLine | TcpLine)}
    ports = [line.port for line in over_tcp.values()]
    for name, line in over_tcp.items():
        if ports.count(line.port) == 1:  # nothing to compare with; a resolver that is far away may take seconds
            continue
        addresses = _addresses(line.host)
        others = [line_of[address, line.port] for address in addresses if (address, line.port) in line_of]
        if others:
            yield Problem(
                where=configuration.where("lines", name, "host"),
                what=f"resolves to the same address as `{over_tcp[others[0]].host}` of line `{others[0]}`: "
                "behind a gateway the units of both wait for each other",
                value=f"{line.host}:{line.port}",
                allowed="one line per device",
                next_step="hang all its gauges on one line",
            )
        for address in addresses:
            line_of.setdefault((address, line.port), name)


def _addresses(host: str) -> list[str]:
    """The numeric addresses of a host; empty if its name cannot be resolved."""
    try:
        resolved = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        return []
    return [str(address[0]) for *_, address in resolved]
