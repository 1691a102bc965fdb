"""Serial ports of this computer, by names that last."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from serial.tools.list_ports import comports

BY_ID = Path("/dev/serial/by-id")
BY_PATH = Path("/dev/serial/by-path")
FOLLOWS_SOCKET = "the adapter has no name of its own: this one is that of the USB socket; do not plug it in elsewhere"


@dataclass(frozen=True)
class ComputerPort:
    """A serial port of this computer.

    path : stays the same from one start to the next, where the system knows such a name.
    device : /dev/ttyUSB0 and the like; description : maker, product and serial number, as far as known.
    note : what a person must know of the path, or "".
    """

    path: str
    device: str
    description: str
    note: str = ""


def serial_ports(
    by_id: Path = BY_ID, by_path: Path = BY_PATH, found: Callable[[], Iterable[Any]] = comports
) -> list[ComputerPort]:
    """Every serial port, sorted by path.

    by_id : the folder with the names of adapters, which they keep in every socket. by_path : with those of sockets. Two
    adapters without serial numbers share one name in by_id, which is that of the one plugged in last: such an adapter
    is named by its socket. found : the ports that the system knows.
    """
    ports = list(found())
    names, sockets = _links(by_id), _links(by_path)
    # of two adapters that share a name, one is left without
    shared = {_identity(port) for port in ports if port.device not in names and port.vid is not None}
    named = []
    for port in ports:
        own_name = port.serial_number is not None and _identity(port) not in shared
        path, note = names.get(port.device, port.device), ""
        if port.vid is not None and not own_name and port.device in sockets:
            path, note = sockets[port.device], FOLLOWS_SOCKET
        named.append(ComputerPort(path, port.device, _description(port), note))
    known = {port.device for port in ports}
    named += [ComputerPort(path, device, "") for device, path in names.items() if device not in known]
    return sorted(named, key=lambda port: port.path)


def _links(directory: Path) -> dict[str, str]:
    """The links in a folder, by the device that each leads to; the first by name where several do."""
    if not directory.is_dir():
        return {}
    return {str(link.resolve()): str(link) for link in sorted(directory.glob("*"), reverse=True)}


def _identity(port: Any) -> tuple[Any, ...]:
    """What the system makes an adapter's name of."""
    return port.vid, port.pid, port.serial_number


def _description(port: Any) -> str:
    parts = [port.manufacturer, port.product or port.description, port.serial_number and f"serial {port.serial_number}"]
    return ", ".join(part for part in parts if part and part != "n/a")
