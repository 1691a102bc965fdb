"""Serial ports of this computer, and which preset gets an answer on them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from serial.tools.list_ports import comports

from compd.clock import MonotonicClock
from compd.commissioning.open_gauge import PortArguments, line_settings
from compd.gauge import Gauge, LineFault
from compd.lines import open_line
from compd.plugins import GAUGES, load, names

BY_ID = Path("/dev/serial/by-id")
PROBE_TIMEOUT_S = 0.5


@dataclass(frozen=True)
class ComputerPort:
    """A serial port of this computer.

    path : stays the same when the adapter moves to another socket, where the system knows such a name.
    device : /dev/ttyUSB0 and the like; description : maker, product and serial number, as far as known.
    """

    path: str
    device: str
    description: str


def serial_ports(by_id: Path = BY_ID) -> list[ComputerPort]:
    """Every serial port, sorted by path. `by_id`: the folder with the lasting names."""
    lasting = {str(link.resolve()): str(link) for link in sorted(by_id.glob("*"))} if by_id.is_dir() else {}
    ports = [ComputerPort(lasting.get(p.device, p.device), p.device, _description(p)) for p in comports()]
    known = {port.device for port in ports}
    ports += [ComputerPort(path, device, "") for device, path in lasting.items() if device not in known]
    return sorted(ports, key=lambda port: port.path)


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
        line = open_line(settings, MonotonicClock())
        try:
            return readings_text(candidate.gauge, candidate.gauge.read(line))
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
