"""Checks across sections: the wiring against the gauges, the gauges against the lines, the lines against each other."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from compd.configuration.document import Document, Location
from compd.configuration.geometry import Geometry
from compd.configuration.lines import LineSettings, ModbusRtuLine, ModbusTcpLine, SerialLine, TcpLine
from compd.configuration.operation import FRAME_DISTANCES, AcquisitionSettings, JointWire, SocketSettings, Wiring
from compd.errors import Problem
from compd.gauge import Gauge, GaugeOptions

# Packages whose drivers are tried with compd's own tests, wire by wire.
_OWN_PACKAGES = ("compd", "compd_drivers")


@dataclass(frozen=True)
class Sections:
    """What could be read of a document; None, or left out of the mapping, where a section or a gauge has a problem.

    gauges : options by name. drivers : the gauges' driver classes by name.
    """

    document: Document
    geometry: Geometry | None
    lines: Mapping[str, LineSettings] | None
    gauges: Mapping[str, GaugeOptions]
    drivers: Mapping[str, type[Gauge[Any]]]
    wiring: Wiring | None
    acquisition: AcquisitionSettings | None = None
    sockets: SocketSettings | None = None


def problems(sections: Sections) -> list[Problem]:
    """Every contradiction between sections that could be read."""
    contradictions = [*_port_problems(sections), *_line_problems(sections), *_process_problems(sections)]
    if sections.wiring is not None:
        contradictions += [
            *_channel_problems(sections, sections.wiring),
            *_completeness_problems(sections, sections.wiring),
        ]
    return contradictions


def warnings(sections: Sections) -> list[Problem]:
    """What can be used but is probably a mistake or a risk: lines without gauges, gauges without wires, drivers from
    elsewhere in the process of the other lines."""
    used_lines = {options.line for options in sections.gauges.values()}
    unused = [
        Problem(
            where=sections.document.where(("lines", name)),
            what="no gauge uses this line",
            next_step="remove it or wire a gauge",
        )
        for name in sections.lines or {}
        if name not in used_lines
    ]
    if sections.wiring is not None:
        wired_gauges = {channel.split(".")[0] for _, channel, _ in _wires(sections.wiring)}
        unused += [
            Problem(
                where=sections.document.where(("gauges", name)),
                what="polled but wired to nothing",
                next_step="name it under `wiring:` or remove it",
            )
            for name in sections.gauges
            if name not in wired_gauges
        ]
    return [*unused, *_shared_process_warnings(sections), *_open_port_warnings(sections)]


def resolve_channel(
    channel: str, gauges: Mapping[str, GaugeOptions], drivers: Mapping[str, type[Gauge[Any]]]
) -> str | None:
    """The full name "gauge.channel" of a channel, which may be written "gauge" where the gauge has only one.

    None if there is no such channel, or if several fit.
    """
    gauge, _, channel_name = channel.partition(".")
    if gauge not in gauges:
        return None
    names = [channel.name for channel in drivers[gauge](gauges[gauge]).channels]
    if not channel_name:
        return f"{gauge}.{names[0]}" if len(names) == 1 else None
    return channel if channel_name in names else None


def _port_problems(sections: Sections) -> Iterator[Problem]:
    """A port that two lines name."""
    line_of_port: dict[str, str] = {}
    for name, line in (sections.lines or {}).items():
        match line:
            case SerialLine() | ModbusRtuLine():
                port = line.port
            case TcpLine() | ModbusTcpLine():
                port = f"{line.host}:{line.port}"
        if port in line_of_port:
            yield Problem(
                where=sections.document.where(("lines", name, "port")),
                what=f"line `{line_of_port[port]}` has the same port",
                value=port,
                allowed="one line per port",
                next_step="hang both gauges on one line",
            )
        line_of_port[port] = name


def _line_problems(sections: Sections) -> Iterator[Problem]:
    """A gauge whose line does not exist, or carries registers where the driver needs bytes or the other way round."""
    if sections.lines is None:
        return
    for name, options in sections.gauges.items():
        location: Location = ("gauges", name, "line")
        line = sections.lines.get(options.line)
        if line is None:
            if options.line not in (sections.document.data.get("lines") or {}):
                yield Problem(
                    where=sections.document.where(location),
                    what="no such line",
                    value=options.line,
                    allowed=", ".join(sections.lines),
                    next_step="write the name of a line under `lines:`",
                )
            continue
        carries: Literal["bytes", "registers"] = "registers" if line.kind.startswith("modbus") else "bytes"
        if carries != sections.drivers[name].line_kind:
            yield Problem(
                where=sections.document.where(location),
                what=f"driver {options.driver} needs a line that carries {sections.drivers[name].line_kind}",
                value=f"{options.line} (kind {line.kind})",
                allowed="kind modbus_rtu or modbus_tcp" if carries == "bytes" else "kind serial or tcp",
            )


def _process_problems(sections: Sections) -> Iterator[Problem]:
    """A line that is to have a process of its own and does not exist, or is named twice."""
    lines = sections.document.data.get("lines")
    if sections.acquisition is None or not isinstance(lines, dict):
        return
    named: set[str] = set()
    for i, name in enumerate(sections.acquisition.own_process):
        where = sections.document.where(("acquisition", "own_process", i))
        if name not in lines:
            yield Problem(
                where=where,
                what="no such line",
                value=name,
                allowed=", ".join(map(str, lines)),
                next_step="write the name of a line under `lines:`",
            )
        elif name in named:
            yield Problem(where=where, what="named twice", value=name, allowed="each line once", next_step="remove it")
        named.add(name)


def _shared_process_warnings(sections: Sections) -> Iterator[Problem]:
    """A driver that is not part of compd, on a line that shares its process with others."""
    if sections.acquisition is None:
        return
    own_process = sections.acquisition.own_process
    for name, options in sections.gauges.items():
        shared = set(sections.lines or ()).difference(own_process)
        if options.line in shared and len(shared) > 1 and _from_elsewhere(options.driver, sections.drivers[name]):
            yield Problem(
                where=sections.document.where(("gauges", name, "driver")),
                what="this driver is not part of compd and shares a process with other lines: if it keeps the "
                "interpreter or crashes, their readings are late or lost too",
                value=options.driver,
                next_step=f"write `{options.line}` under `acquisition: own_process:`",
            )


def _open_port_warnings(sections: Sections) -> Iterator[Problem]:
    """A TCP port that other computers can reach."""
    tcp = None if sections.sockets is None else sections.sockets.tcp
    if tcp is not None and tcp.is_open:
        yield Problem(
            where=sections.document.where(("sockets", "tcp", "host")),
            what="OPEN TO THE NETWORK: other computers can watch and, with the token, move this machine; nothing "
            "on the way is encrypted, the token neither",
            value=f"{tcp.host}, allowed from {', '.join(tcp.allow)}",
            next_step="let compd listen on 127.0.0.1 and a proxy with TLS on the network, or keep this network to the "
            "machine; `target: {unix_only: true}` under `sockets:` lets other computers only watch",
        )


def _from_elsewhere(driver: str, kind: type[Gauge[Any]]) -> bool:
    """Whether a driver is a person's own file, or of another package than compd's. driver : as the file names it."""
    return driver.startswith("/") or kind.__module__.partition(".")[0] not in _OWN_PACKAGES


def _wires(wiring: Wiring) -> Iterator[tuple[Location, str, str]]:
    """Every wire: its location in the document, the channel that it names, the unit that it must have."""
    for kind in ("scale", "joint", "frame"):
        for i, wire in enumerate(getattr(wiring, kind)):
            yield ("wiring", kind, i, "gauge"), wire.gauge, "mm"
    for i, quantity in enumerate(wiring.quantities):
        yield ("wiring", "quantities", i, "gauge"), quantity.gauge, quantity.name.rsplit("_", 1)[1]


def _channel_problems(sections: Sections, wiring: Wiring) -> Iterator[Problem]:
    """A wire whose channel does not exist, has another unit, or is wired already."""
    location_of_channel: dict[str, Location] = {}
    gauges_in_file = sections.document.data.get("gauges") or {}
    for location, channel, unit in _wires(wiring):
        name = channel.split(".")[0]
        where = sections.document.where(location)
        if name not in sections.gauges:
            if name not in gauges_in_file:  # a gauge with a problem of its own is reported already
                yield Problem(
                    where=where,
                    what="no such gauge",
                    value=channel,
                    allowed=", ".join(gauges_in_file),
                    next_step="write a name under `gauges:`",
                )
            continue
        units = {channel.name: channel.unit for channel in sections.drivers[name](sections.gauges[name]).channels}
        full_name = resolve_channel(channel, sections.gauges, sections.drivers)
        if full_name is None:
            yield Problem(
                where=where,
                what=f"gauge `{name}` has no such single channel",
                value=channel,
                allowed=", ".join(f"{name}.{channel_name}" for channel_name in units),
                next_step="write gauge.channel",
            )
            continue
        delivers = units[full_name.split(".")[1]]
        if delivers != unit:
            yield Problem(where=where, what=f"needs a gauge in {unit}, this one delivers {delivers}", value=channel)
        if full_name in location_of_channel:
            yield Problem(
                where=where,
                what=f"wired already at {sections.document.where(location_of_channel[full_name])}",
                value=channel,
                allowed="each channel once",
            )
        location_of_channel[full_name] = location


def _completeness_problems(sections: Sections, wiring: Wiring) -> Iterator[Problem]:
    """Frame distances, quantities, scales and joint comparators that are wired too rarely or too often."""
    where = sections.document.where
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
    if sections.geometry is None:
        return
    links = sections.geometry.links
    scales = Counter(wire.link for wire in wiring.scale)
    for link in sorted({*range(1, links + 1), *scales}):
        if scales[link] != (1 if link <= links else 0):
            yield Problem(
                where=where(("wiring", "scale")),
                what=f"link {link} has {scales[link]} scales",
                allowed=f"links 1..{links}, each exactly one",
            )
    joints_by_link: dict[int, list[JointWire]] = defaultdict(list)
    for wire in wiring.joint:
        joints_by_link[wire.link].append(wire)
    for link, wires in sorted(joints_by_link.items()):
        roles = Counter(wire.role for wire in wires)
        if link > links:
            yield Problem(where=where(("wiring", "joint")), what=f"there is no link {link}", allowed=f"1..{links}")
        if max(roles.values()) > 1 or roles["Ra"] != roles["Rb"] or (roles["B"] and roles["Ra"]):
            yield Problem(
                where=where(("wiring", "joint")),
                what=f"link {link} has comparators {', '.join(sorted(roles.elements()))}",
                allowed="at most one S, and either one B or Ra and Rb together",
            )
