"""Warnings of `compd check` about two names of one device: its lines would wait for each other."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from typing import Any

from compd.configuration import Configuration
from compd.errors import Problem
from compd.lines import definition_of


def shared_address_warnings(configuration: Configuration) -> list[Problem]:
    """Lines over a network whose hosts have different names, but an address and the port in common.

    A name that cannot be resolved on this computer is no warning: it may be one of the machine's network.
    """
    return list(_shared_addresses(configuration))


def _shared_addresses(configuration: Configuration) -> Iterator[Problem]:
    line_of: dict[tuple[str, str, int], str] = {}
    networked = {name: _transport_and_device(line) for name, line in configuration.lines.items()}
    devices = {name: device for name, device in networked.items() if device is not None}
    ports = [(transport, port) for transport, _, port in devices.values()]
    for name, (transport, host, port) in devices.items():
        if ports.count((transport, port)) == 1:  # nothing to compare with; a resolver that is far away may take seconds
            continue
        addresses = _addresses(host)
        others = [line_of[transport, address, port] for address in addresses if (transport, address, port) in line_of]
        if others:
            yield Problem(
                configuration.where("lines", name, "host"),
                f"resolves to the same address as `{devices[others[0]][1]}` of line `{others[0]}`: "
                "behind a gateway the units of both wait for each other",
                value=f"{host}:{port}",
                allowed="one line per device",
                next_step="hang all its gauges on one line",
            )
        for address in addresses:
            line_of.setdefault((transport, address, port), name)


def _transport_and_device(line: Any) -> tuple[str, str, int] | None:
    """What precedes // in the name of a line's device, its host and its port; None where the line shares its other end,
    or has no host of its own."""
    device = definition_of(line).device(line)
    return (device.partition("//")[0], line.host, line.port) if device and hasattr(line, "host") else None


def _addresses(host: str) -> list[str]:
    """The numeric addresses of a host; empty if its name cannot be resolved."""
    try:
        resolved = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        return []
    return [str(address[0]) for *_, address in resolved]
