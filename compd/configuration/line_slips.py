"""Slips in a line's port, rate or address that prevent opening it, or open something else."""

from __future__ import annotations

import ipaddress
import re
import socket
import stat
from collections.abc import Iterator
from pathlib import Path

from serial import Serial

from compd.configuration.line_checks import endpoint
from compd.configuration.sections import Sections
from compd.errors import Problem

# Baud rates missing in pyserial's list: MIDI, DMX512, and those of older modems and micro-controllers.
_BAUDRATES = (*Serial.BAUDRATES, 14_400, 28_800, 31_250, 56_000, 76_800, 128_000, 250_000, 256_000)
# URL schemes of pyserial.
_SCHEMES = ("socket", "rfc2217", "loop", "spy", "alt", "cp2110", "hwgrep")
# Host names by RFC 1123, with the underscore of networks without a name server.
_HOST_NAME = re.compile(r"[A-Za-z0-9_]([A-Za-z0-9_-]*[A-Za-z0-9_])?(\.[A-Za-z0-9_]([A-Za-z0-9_-]*[A-Za-z0-9_])?)*\.?")


def line_slips(sections: Sections) -> Iterator[Problem]:
    """A warning for each."""
    for name, line in sections.lines.items():
        port, baud, host = (getattr(line, key, None) for key in ("port", "baud", "host"))
        if isinstance(port, str):
            scheme, slashes, address = port.partition("://")
            if slashes and scheme in ("socket", "rfc2217"):
                host = address.split("?")[0].rpartition(":")[0]
            if why := _why_no_port(port, scheme if slashes else ""):
                yield Problem(
                    sections.document.where(("lines", name, "port")),
                    why,
                    value=port,
                    allowed="a path as /dev/serial/by-id/..., or socket://host:port, rfc2217://host:port",
                    next_step="`compd gauge scan` lists the ports",
                )
        if isinstance(baud, int) and baud not in _BAUDRATES:
            nearest = min(_BAUDRATES, key=lambda rate: abs(rate - baud))
            yield Problem(
                sections.document.where(("lines", name, "baud")),
                "is no usual rate",
                value=str(baud),
                next_step=f"the nearest is {nearest}; ignore this where the device has its own",
            )
        if host is not None and (why := _why_no_host(host)):
            key = "port" if isinstance(port, str) else "host"
            yield Problem(
                sections.document.where(("lines", name, key)),
                why,
                value=host,
                allowed="four numbers from 0 to 255, an IPv6 address, or a name",
                next_step="write the device's own address",
            )
        yield from _own_port(sections, name, f"{host}:{port}" if not isinstance(port, str) else port)


def _why_no_port(port: str, scheme: str) -> str:
    if scheme:
        return "" if scheme in _SCHEMES else f"{scheme}:// is no scheme of a serial line"
    if not port.startswith("/"):
        return "is no port of this computer"
    try:
        mode = Path(port).stat().st_mode
    except (OSError, ValueError):  # not there yet, or unknown: another user's directory, too long a name
        return ""
    return "" if stat.S_ISCHR(mode) else "is no serial port, but something else"


def _why_no_host(host: str) -> str:
    """The fault of an address; "" for a possible address of a device, and for a name."""
    try:
        address = ipaddress.ip_address(host.strip("[]"))
    except ValueError:
        labels = host.rstrip(".").split(".")
        numbers = sum(label.isdecimal() for label in labels)
        # the system takes a name that ends in a number for an address of fewer parts: 192.168.10 is 192.168.0.10
        if re.fullmatch(r"\d+|0[xX][0-9a-fA-F]+", labels[-1]) or 2 * numbers > len(labels):
            return "is no IP address: that has four numbers. The system may take it for another one"
        return "" if _HOST_NAME.fullmatch(host) else "is neither an IP address nor a name"
    # of IPv6, ::1 and the mapped addresses ::ffff:a.b.c.d count as reserved, too
    if address.is_unspecified or address.is_multicast or (address.is_reserved and address.version == 4):
        return "is no single device's address"
    return ""


def _own_port(sections: Sections, name: str, address: str) -> Iterator[Problem]:
    """A line to the daemon itself."""
    tcp = sections.document.value(("sockets", "tcp"))
    if not isinstance(tcp, dict) or "port" not in tcp:
        return
    host, _, number = endpoint(address if "://" in address else f"//{address}").rpartition(":")
    own = {str(tcp.get("host")), "localhost", socket.gethostname().lower()}
    if number == str(tcp["port"]) and (host in own or _is_loopback(host)):
        yield Problem(
            sections.document.where(("lines", name, "port")),
            "is the daemon's own port, under sockets.tcp",
            value=address,
            next_step="write the device's address and port",
        )


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False
