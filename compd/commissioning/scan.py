"""Serial ports of this computer, and which preset gets an answer on them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from serial.tools.list_ports import comports

from compd.clock import MonotonicClock
from compd.commissioning.open_gauge import PortArguments, line_settings
from compd.configuration.lines import powered
from compd.gauge import Gauge, LineFault
from compd.lines import open_line
from compd.lines.echo import explained
from compd.plugins import GAUGES, load, names

BY_ID = Path("/dev/serial/by-id")
BY_PATH = Path("/dev/serial/by-path")
PROBE_TIMEOUT_S = 0.5
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


@dataclass(frozen=True)
class PresetCandidate:
    """A preset that can be tried without knowing more of the device."""

    name: str
    gauge: Gauge[Any]
    baud: int
    format: str


def preset_candidates() -> list[PresetCandidate]:
    """Presets that say how their device is delivered and need no other options than their sample's."""
    candidates = []
    for name in names(GAUGES):
        driver = load(GAUGES, name, name)
        if driver.usual_line is not None:
            options = driver.Options.model_validate({"driver": name, "line": "probe", **(driver.sample_options or {})})
            candidates.append(PresetCandidate(name, driver(options), *driver.usual_line))
    return candidates


def probe_ports(ports: Sequence[ComputerPort]) -> Iterator[tuple[ComputerPort, PresetCandidate, str]]:
    """Every port with every candidate and the outcome of one read, as `probe_port` gives it. SENDS BYTES."""
    candidates = preset_candidates()
    for port in ports:
        for candidate in candidates:
            yield port, candidate, probe_port(port.path, candidate)


def probe_port(path: str, candidate: PresetCandidate) -> str:
    """The outcome of one read on the port `path`: values, or the fault in words. SENDS the candidate's request.

    A mismatch, too, means that some device answers there.
    """
    registers = candidate.gauge.line_kind == "registers"
    try:
        settings = line_settings(PortArguments(path, candidate.baud, candidate.format, PROBE_TIMEOUT_S), registers)
        line = open_line(powered(settings, [candidate.gauge]), MonotonicClock())
        try:
            return readings_text(candidate.gauge, candidate.gauge.read(line))
        except LineFault as fault:
            raise explained(fault, line) from fault
        finally:
            line.close()
    except LineFault as fault:
        return str(fault)


def readings_text(gauge: Gauge[Any], readings: Sequence[Any]) -> str:
    """Readings in one line."""
    return ", ".join(
        f"{channel.name} {reading.value:.6g} {channel.unit}" if reading.ok else f"{channel.name} {reading.quality}"
        for channel, reading in zip(gauge.channels, readings, strict=True)
    )
