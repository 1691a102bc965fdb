"""A file of gauges and their lines, written by `compd gauge learn --to` for `read` and `watch`.

Its two sections stand in a machine's configuration in the same words, so that they are pasted there as they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from compd.configuration import SECTIONS, gauges_of, in_order, load
from compd.documents import CONFIGURATION, Document, read_document, validate
from compd.errors import ConfigurationError, Problem
from compd.files import FileKind
from compd.gauge import Gauge, GaugeOptions
from compd.gauge_tools.open_gauge import STALE_AFTER_S, GaugeTarget, line_settings
from compd.line_settings import LineSettings, powered
from compd.lines import PortArguments

LEARNED_GAUGE, LEARNED_LINE = "learned_gauge", "learned_line"
_SECTIONS = {"gauges", "lines"}
GAUGE_FILE = FileKind(
    "a file of gauges or a configuration",
    frozenset({"gauges"}),
    least=1,
    others=CONFIGURATION.keys,
    next_step="`compd gauge learn --to` writes one",
)


def gauge_file_text(options: Mapping[str, Any], line: LineSettings | None) -> str:
    """The file of one learned gauge. line : its line; None for a file without it."""
    gauge = {"driver": options["driver"], "line": LEARNED_LINE, **options}
    sections: dict[str, Any] = {}
    if line is not None:
        keys = line.model_dump(mode="json", exclude_unset=True)
        sections["lines"] = {LEARNED_LINE: {"kind": line.kind, **keys}}
    sections["gauges"] = {LEARNED_GAUGE: gauge}
    return yaml.safe_dump(sections, sort_keys=False, default_flow_style=None, width=120)


def gauge_of_file(path: Path, name: str | None, port: PortArguments) -> GaugeTarget:
    """The gauge `name` of a machine's configuration or of a file of gauges; None for the only one.

    port : where it hangs if the file does not say it; what the file says counts otherwise.
    Raises ConfigurationError for every problem of the file, and where there is no such gauge, or no line.
    """
    document = read_document(path, GAUGE_FILE)
    if set(document.data) - _SECTIONS:
        configuration = load(path)
        stale_after_s = configuration.loop.stale_after_s
        gauges, drivers = configuration.gauges, configuration.drivers
        return _target(document, name, port, gauges, drivers, configuration.lines, stale_after_s)
    problems: list[Problem] = []
    lines = validate(SECTIONS["lines"], document, ("lines",), problems) if "lines" in document.data else {}
    gauges, drivers = gauges_of(document, problems)
    if problems:
        raise ConfigurationError(in_order(problems))
    return _target(document, name, port, gauges, drivers, lines)


def _target(
    document: Document,
    name: str | None,
    port: PortArguments,
    gauges: Mapping[str, GaugeOptions],
    drivers: Mapping[str, type[Gauge[Any]]],
    lines: Mapping[str, LineSettings],
    stale_after_s: float = STALE_AFTER_S,
) -> GaugeTarget:
    if name is None and len(gauges) == 1:
        (name,) = gauges
    if name is None or name not in gauges:
        raise ConfigurationError.of(
            f"{document.path} gauges",
            "no such gauge" if name else "name one of its gauges",
            value=name or "",
            allowed=", ".join(gauges),
        )
    options = gauges[name]
    line = lines.get(options.line)
    if line is None and not port.port:
        raise ConfigurationError.of(
            document.where(("gauges", name, "line")),
            "the file has no line of this name",
            value=options.line,
            next_step="--port, and --baud and --format for a serial port; or add it under `lines:`",
        )
    if line is None:
        line = line_settings(port, drivers[name].line_kind)
    on_line = [drivers[other](gauges[other]) for other in gauges if gauges[other].line == options.line]
    return GaugeTarget(name, drivers[name](options), powered(line, on_line), options.stale_after_s or stale_after_s)
