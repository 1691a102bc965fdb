"""A serial port of this computer: is it there, and may this user open it?"""

from __future__ import annotations

import grp
import os
from collections.abc import Iterator
from pathlib import Path

from compd.probes.finding import Computer, Finding, advice, fault, good, unknown

_BY_ID, _BY_PATH = "/dev/serial/by-id", "/dev/serial/by-path"
# Their other end is held by another program as a matter of course.
_PSEUDO_TERMINALS = "/dev/pts"
# FTDI's default keeps bytes back for 16 ms.
_SHORT_LATENCY_MS = 2


def serial_findings(computer: Computer, subject: str, port: str, low_latency: bool) -> Iterator[Finding]:
    """`port`: device path or pyserial URL. low_latency : whether the adapter is asked to hold no bytes back."""
    if "://" in port:
        yield unknown(subject, f"{port} is looked at only by opening it")
        return
    shared = _shared_names(computer)
    device = computer.resolve(port)
    if device is None:
        there = sorted(path.name for path in computer.path(_BY_ID).glob("*"))
        names = f"there are: {', '.join(there)}" if there else f"{_BY_ID} is empty"
        yield fault(subject, f"{port} is not there", f"{subject}: plug the adapter in, or correct the port; {names}")
        return
    real = computer.path(device)
    if not os.access(real, os.R_OK | os.W_OK):
        yield fault(subject, f"{port} may not be opened by this user", f"{subject}: {_how_to_be_permitted(real)}")
    elif device.is_relative_to(_PSEUDO_TERMINALS):
        yield good(subject, f"{port} is a pseudo terminal: a simulated gauge, or a program in between")
    elif holders := [holder for holder in computer.holders(device) if f"({os.getpid()})" not in holder]:
        if all(holder.startswith("compd") for holder in holders):
            yield good(subject, f"{port} is held by the daemon, {holders[0]}")
        else:
            yield fault(subject, f"{port} is held by {', '.join(holders)}", f"{subject}: end {', '.join(holders)}")
    else:
        yield good(subject, f"{port} is there and may be opened")
    if device in shared:
        yield fault(
            subject,
            f"two adapters have the same name ({shared[device]}, no serial number): after a start the gauges may be "
            "exchanged",
            f"{subject}: name the socket instead: {_by_path(computer, device)}",
        )
    elif port.startswith("/dev/tty"):
        lasting = _link(computer, _BY_ID, device)
        if lasting is not None:
            step = f"{subject}: write `port: {lasting}`"
            yield advice(subject, f"{port} depends on the order in which adapters are plugged in", step)
    yield from _latency_findings(computer, subject, device, low_latency)


def _how_to_be_permitted(device: Path) -> str:
    try:
        group = grp.getgrgid(device.stat().st_gid).gr_name
    except (OSError, KeyError):
        group = "dialout"
    if group == "root":
        return f"as root: chgrp dialout {device}; chmod g+rw {device}"
    return f"as root: usermod --append --groups {group} USER; then log in again"


def _shared_names(computer: Computer) -> dict[Path, str]:
    """Adapters that udev cannot tell apart, by device: of the same vendor, product and serial number, if any."""
    by_identity: dict[tuple[str, str, str], list[Path]] = {}
    for entry in sorted(computer.path("/sys/class/tty").glob("tty[UA][SC][BM]*")):
        if (identity := _identity(computer, entry.name)) is not None:
            by_identity.setdefault(identity, []).append(Path("/dev") / entry.name)
    return {
        device: f"{vendor}:{product}"
        for (vendor, product, _), devices in by_identity.items()
        for device in devices
        if len(devices) > 1
    }


def _identity(computer: Computer, tty: str) -> tuple[str, str, str] | None:
    """Vendor, product and serial number with the interface, of the USB device that a port belongs to."""
    start = computer.resolve(f"/sys/class/tty/{tty}/device")
    interface = ""
    for place in () if start is None else (start, *start.parents):
        interface = interface or (computer.read(place / "bInterfaceNumber") or "")
        vendor = computer.read(place / "idVendor")
        if vendor is not None:
            product, serial = computer.read(place / "idProduct") or "", computer.read(place / "serial") or ""
            return vendor, product, f"{serial}:{interface}"
    return None


def _by_path(computer: Computer, device: Path) -> str:
    return _link(computer, _BY_PATH, device) or f"the one below {_BY_PATH}"


def _link(computer: Computer, directory: str, device: Path) -> str | None:
    """The name in a directory of udev's that leads to a device."""
    names = [path.name for path in sorted(computer.path(directory).glob("*"))]
    return next((f"{directory}/{name}" for name in names if computer.resolve(f"{directory}/{name}") == device), None)


def _latency_findings(computer: Computer, subject: str, device: Path, low_latency: bool) -> Iterator[Finding]:
    timer_ms = computer.read(f"/sys/bus/usb-serial/devices/{device.name}/latency_timer")
    if timer_ms is None or not timer_ms.isdigit() or int(timer_ms) <= _SHORT_LATENCY_MS:
        return
    if low_latency:
        yield good(
            subject, f"the adapter's latency timer is {timer_ms} ms now; `low_latency` shortens it when it is opened"
        )
    else:
        yield advice(
            subject,
            f"the adapter keeps bytes back for up to {timer_ms} ms (latency timer)",
            f"{subject}: leave `low_latency` out",
        )
