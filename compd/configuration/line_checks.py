"""Checks of the lines against each other and against the gauges on them: ports, kinds, signals, power, processes."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec

from compd.configuration.sections import Sections
from compd.documents import Location
from compd.errors import Problem
from compd.extras import install_line
from compd.lines import kinds_that_carry, readable_definition
from compd.text import join_words


def line_problems(sections: Sections) -> Iterator[Problem]:
    """Every contradiction between lines, and between a line and its gauges, in the readable parts."""
    yield from _port_problems(sections)
    yield from _kind_problems(sections)
    yield from _library_problems(sections)
    yield from _signal_problems(sections)
    yield from _power_problems(sections)
    yield from _process_problems(sections)


def _port_problems(sections: Sections) -> Iterator[Problem]:
    """A port or an address of two lines: units behind one gateway wait for each other."""
    line_of_port: dict[str, str] = {}
    for name, line in sections.lines.items():
        definition = readable_definition(line)
        port = "" if definition is None else endpoint(definition.device(line))
        if not port:
            continue
        if port in line_of_port:
            yield Problem(
                sections.document.where(("lines", name, "port")),
                f"line `{line_of_port[port]}` has the same port",
                value=port,
                allowed="one line per port",
                next_step="hang both gauges on one line",
            )
        line_of_port[port] = name


def endpoint(port: str) -> str:
    """A port in a canonical spelling: host:port for any TCP port, independent of its protocol."""
    scheme, slashes, address = port.partition("//")
    if not slashes or scheme not in ("", "socket:", "rfc2217:"):
        return port
    host, _, number = address.split("?")[0].rstrip("/").rpartition(":")
    host = host.lower().rstrip(".")
    return f"{'127.0.0.1' if host == 'localhost' else host}:{number}"


def _kind_problems(sections: Sections) -> Iterator[Problem]:
    """A gauge whose line does not exist, or carries registers where the driver needs bytes or the other way round."""
    lines, gauges = sections.document.data.get("lines"), sections.document.data.get("gauges")
    if not isinstance(lines, dict) or not isinstance(gauges, dict):
        return
    for name, options in gauges.items():
        line_name = options.get("line") if isinstance(options, dict) else None
        if not isinstance(line_name, str):
            continue
        location: Location = ("gauges", name, "line")
        if line_name not in lines:
            yield Problem(
                sections.document.where(location),
                "no such line",
                value=line_name,
                allowed=", ".join(map(str, lines)),
                next_step="write the name of a line under `lines:`",
            )
            continue
        definition = readable_definition(sections.lines.get(line_name))
        if definition is None or name not in sections.drivers:
            continue
        needed = sections.drivers[name].line_kind
        if needed != definition.carries:
            yield Problem(
                sections.document.where(location),
                f"driver {options['driver']} needs a line that carries {needed}",
                value=f"{line_name} (kind {definition.kind})",
                allowed="kind " + join_words([kind.kind for kind in kinds_that_carry(needed)], "or"),
            )


def _library_problems(sections: Sections) -> Iterator[Problem]:
    """A line of a kind without its library."""
    for name, line in sections.lines.items():
        definition = readable_definition(line)
        library = None if definition is None else definition.library
        if library is not None and find_spec(library.package) is None:
            yield Problem(
                sections.document.where(("lines", name, "kind")),
                f"needs the package {library.package}, which is not installed",
                value=line.kind,
                next_step=install_line(library.extra),
            )


def _signal_problems(sections: Sections) -> Iterator[Problem]:
    """A gauge whose request needs a signal that its line lacks."""
    for name, options in sections.gauges.items():
        line = sections.lines.get(options.line)
        definition = readable_definition(line)
        without = "" if definition is None else definition.without_signals(line)
        if without and (signals := sections.drivers[name](options).serial_signals):
            yield Problem(
                sections.document.where(("gauges", name, "line")),
                f"is asked by {' and '.join(signals)}, which {without} does not have",
                value=options.line,
                allowed="a serial port, or rfc2217://host:port",
                next_step="let the device server speak RFC 2217, or use a port of this computer",
            )


def _power_problems(sections: Sections) -> Iterator[Problem]:
    """A line whose DTR or RTS contradicts the power supply of a gauge."""
    needed: dict[tuple[str, str], tuple[str, bool]] = {}
    for name, options in sections.gauges.items():
        line = sections.lines.get(options.line)
        for pin, high in sections.drivers[name](options).line_needs.items():
            by, wanted = needed.setdefault((options.line, pin), (name, high))
            set_to = getattr(line, pin, None)
            against = ""
            if set_to not in (None, high):
                against = f"`{pin}: {str(set_to).lower()}` of line `{options.line}`"
            elif pin == "rts" and getattr(line, "rs485", None) is not None:
                against = f"`rs485` of line `{options.line}`"
            elif wanted != high:
                against = f"gauge `{by}` on line `{options.line}`"
            if against:
                yield Problem(
                    sections.document.where(("gauges", name)),
                    f"is powered from {pin.upper()}, which {against} sets otherwise",
                    allowed=f"{pin}: {str(high).lower()}",
                    next_step="remove the line's key, or give the gauge a line of its own",
                )


def _process_problems(sections: Sections) -> Iterator[Problem]:
    """A line for a process of its own that does not exist or is listed twice."""
    lines = sections.document.data.get("lines")
    if not isinstance(lines, dict):
        return
    named: set[str] = set()
    for i, name in enumerate(getattr(sections.acquisition, "own_process", None) or ()):
        if name is None:
            continue
        where = sections.document.where(("acquisition", "own_process", i))
        if name not in lines:
            yield Problem(
                where,
                "no such line",
                value=name,
                allowed=", ".join(map(str, lines)),
                next_step="write the name of a line under `lines:`",
            )
        elif name in named:
            yield Problem(where, "named twice", value=name, allowed="each line once", next_step="remove it")
        named.add(name)
