"""The lasting name of the port of every gauge, by which a gauge is known again on another day.

A kernel counts its serial ports in the order in which they appear: /dev/ttyUSB0 may be another adapter after every
start, and is called by its name in /dev/serial/by-id.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from compd.configuration import Configuration
from compd.line_settings import LineSettings
from compd.lines import serial_ports


def port_names(configuration: Configuration) -> dict[str, str]:
    """By gauge: its port, with its unit there where it has one; gauges are left out whose port is not known now."""
    lasting = {port.device: port.path for port in serial_ports()}
    ports = {name: _port(line, lasting) for name, line in configuration.lines.items()}
    return {
        gauge: ":".join([ports[options.line], *_unit(options)])
        for gauge, options in configuration.gauges.items()
        if ports[options.line]
    }


def changed_ports(before: Mapping[str, str], now: Mapping[str, str]) -> dict[str, str]:
    """In words, by gauge: its ports before and now, where both are known and differ."""
    return {
        gauge: f"was at {before[gauge]}, is at {port}"
        for gauge, port in now.items()
        if gauge in before and before[gauge] != port
    }


def _port(line: LineSettings, lasting: Mapping[str, str]) -> str:
    """`lasting`: names of serial ports by device."""
    port = line.address
    if not port.startswith("/") or port.startswith("/dev/serial/"):
        return port
    device = os.path.realpath(port)
    # one that the kernel has counted and that is not there now is not known
    return lasting.get(device, "" if port == device and device.startswith("/dev/tty") else port)


def _unit(options: Any) -> list[str]:
    unit = getattr(options, "unit", None)
    return [str(unit)] if isinstance(unit, int) else []
