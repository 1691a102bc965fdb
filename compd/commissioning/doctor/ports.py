"""Serial ports and network devices of a configuration: presence, and permission of this user to open them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from compd.line_settings import LineSettings
from compd.lines import definition_of
from compd.probes import Computer, Finding


def port_findings(computer: Computer, lines: Mapping[str, LineSettings], daemon_runs: bool) -> Iterator[Finding]:
    """For every line of a configuration. daemon_runs : its devices are then not connected to a second time."""
    for name, line in lines.items():
        yield from definition_of(line).probe(computer, f"line {name}", line, daemon_runs)
