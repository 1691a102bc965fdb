"""What no single section can know: does the wiring fit the gauges, the gauges the lines, the lines the ports?"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from compd.configuration.document import Document, Location
from compd.configuration.geometry import Geometry
from compd.configuration.lines import LineSettings, ModbusRtuLine, ModbusTcpLine, SerialLine, TcpLine
from compd.configuration.operation import FRAME_DISTANCES, JointWire, Wiring
from compd.errors import Problem
from compd.gauge import Gauge, GaugeOptions


@dataclass(frozen=True)
class Parts:
    """The sections that could be read; None for those that could not."""

    document: Document
    geometry: Geometry | None
    lines: Mapping[str, LineSettings] | None
    gauges: Mapping[str, GaugeOptions]
    drivers: Mapping[str, type[Gauge[Any]]]
    wiring: Wiring | None


def problems(parts: Parts) -> list[Problem]:
    """Everything that contradicts; checks only what could be read."""
    found = [*_ports(parts), *_gauges_on_lines(parts)]
    if parts.wiring is not None:
        found += [*_channels(parts, parts.wiring), *_completeness(parts, parts.wiring)]
    return found


def warnings(parts: Parts) -> list[Problem]:
    """What works but is probably not meant."""
    found: list[Problem] = []
    used = {options.line for options in parts.gauges.values()}
    found += [
        Problem(
            where=parts.document.where(("lines", name)),
            what="no gauge uses this line",
            next_step="remove it or wire a gauge",
        )
        for name in parts.lines or {}
        if name not in used
    ]
    if parts.wiring is not None:
        wired = {reference.split(".")[0] for _, reference, _ in _references(parts.wiring)}
        found += [
            Problem(
                where=parts.document.where(("gauges", name)),
                what="polled but wired to nothing",
                next_step="name it under `wiring:` or remove it",
            )
            for name in parts.gauges
            if name not in wired
        ]
    return found


def resolve(reference: str, gauges: Mapping[str, GaugeOptions], drivers: Mapping[str, type[Gauge[Any]]]) -> str | None:
    """ "gauge" or "gauge.channel" -> "gauge.channel"; None if there is no such channel, or more than one fits."""
    name, _, channel = reference.partition(".")
    if name not in gauges:
        return None
    channels = [c.name for c in drivers[name](gauges[name]).channels]
    if not channel:
        return f"{name}.{channels[0]}" if len(channels) == 1 else None
    return reference if channel in channels else None


def _ports(parts: Parts) -> Iterator[Problem]:
    seen: dict[str, str] = {}
    for name, line in (parts.lines or {}).items():
        match line:
            case SerialLine() | ModbusRtuLine():
                port = line.port
            case TcpLine() | ModbusTcpLine():
                port = f"{line.host}:{line.port}"
        if port in seen:
            yield Problem(
                where=parts.document.where(("lines", name, "port")),
                what=f"line `{seen[port]}` has the same port",
                value=port,
                allowed="one line per port",
                next_step="hang both gauges on one line",
            )
        seen[port] = name


def _gauges_on_lines(parts: Parts) -> Iterator[Problem]:
    if parts.lines is None:
        return
    for name, options in parts.gauges.items():
        location: Location = ("gauges", name, "line")
        line = parts.lines.get(options.line)
        if line is None:
            if options.line not in (parts.document.data.get("lines") or {}):
                yield Problem(
                    where=parts.document.where(location),
                    what="no such line",
                    value=options.line,
                    allowed=", ".join(parts.lines),
                    next_step="write the name of a line under `lines:`",
                )
            continue
        carries: Literal["bytes", "registers"] = "registers" if line.kind.startswith("modbus") else "bytes"
        if carries != parts.drivers[name].line_kind:
            yield Problem(
                where=parts.document.where(location),
                what=f"driver {options.driver} needs a line that carries {parts.drivers[name].line_kind}",
                value=f"{options.line} (kind {line.kind})",
                allowed="kind modbus_rtu or modbus_tcp" if carries == "bytes" else "kind serial or tcp",
            )


def _references(wiring: Wiring) -> Iterator[tuple[Location, str, str]]:
    """Every wire: where it stands, the gauge it names, the unit it must have."""
    for kind in ("scale", "joint", "frame"):
        for i, wire in enumerate(getattr(wiring, kind)):
            yield ("wiring", kind, i, "gauge"), wire.gauge, "mm"
    for i, quantity in enumerate(wiring.quantities):
        yield ("wiring", "quantities", i, "gauge"), quantity.gauge, quantity.name.rsplit("_", 1)[1]


def _channels(parts: Parts, wiring: Wiring) -> Iterator[Problem]:
    seen: dict[str, Location] = {}
    written = parts.document.data.get("gauges") or {}
    for location, reference, unit in _references(wiring):
        name = reference.split(".")[0]
        where = parts.document.where(location)
        if name not in parts.gauges:
            if name not in written:  # a gauge with a problem of its own is reported there
                yield Problem(
                    where=where,
                    what="no such gauge",
                    value=reference,
                    allowed=", ".join(written),
                    next_step="write a name under `gauges:`",
                )
            continue
        channels = {c.name: c.unit for c in parts.drivers[name](parts.gauges[name]).channels}
        full = resolve(reference, parts.gauges, parts.drivers)
        if full is None:
            yield Problem(
                where=where,
                what=f"gauge `{name}` has no such single channel",
                value=reference,
                allowed=", ".join(f"{name}.{channel}" for channel in channels),
                next_step="write gauge.channel",
            )
            continue
        delivers = channels[full.split(".")[1]]
        if delivers != unit:
            yield Problem(where=where, what=f"needs a gauge in {unit}, this one delivers {delivers}", value=reference)
        if full in seen:
            yield Problem(
                where=where,
                what=f"wired already at {parts.document.where(seen[full])}",
                value=reference,
                allowed="each channel once",
            )
        seen[full] = location


def _completeness(parts: Parts, wiring: Wiring) -> Iterator[Problem]:
    where = parts.document.where
    counts: Counter[str] = Counter(wire.distance for wire in wiring.frame)
    for distance in FRAME_DISTANCES:
        if counts[distance] != 1:
            yield Problem(
                where=where(("wiring", "frame")),
                what=f"frame distance {distance} is wired {counts[distance]} times",
                allowed="t1..t3 and u1..u6, each exactly once",
            )
    names = Counter(quantity.name for quantity in wiring.quantities)
    for name, count in names.items():
        if count > 1:
            yield Problem(
                where=where(("wiring", "quantities")), what=f"{name} is wired {count} times", allowed="each name once"
            )
    if parts.geometry is None:
        return
    links = parts.geometry.links
    scales = Counter(wire.link for wire in wiring.scale)
    for link in sorted({*range(1, links + 1), *scales}):
        if scales[link] != (1 if link <= links else 0):
            yield Problem(
                where=where(("wiring", "scale")),
                what=f"link {link} has {scales[link]} scales",
                allowed=f"links 1..{links}, each exactly one",
            )
    by_link: dict[int, list[JointWire]] = defaultdict(list)
    for wire in wiring.joint:
        by_link[wire.link].append(wire)
    for link, wires in sorted(by_link.items()):
        roles = Counter(wire.role for wire in wires)
        if link > links:
            yield Problem(where=where(("wiring", "joint")), what=f"there is no link {link}", allowed=f"1..{links}")
        if max(roles.values()) > 1 or roles["Ra"] != roles["Rb"] or (roles["B"] and roles["Ra"]):
            yield Problem(
                where=where(("wiring", "joint")),
                what=f"link {link} has comparators {', '.join(sorted(roles.elements()))}",
                allowed="at most one S, and either one B or Ra and Rb together",
            )
