"""What the kinds of line over TCP have in common."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from compd.line_settings import Pace, network_pace
from compd.lines.line_definition import PolledDefinition
from compd.lines.port_arguments import PortArguments

if TYPE_CHECKING:
    from compd.probes import Computer, Finding


class TcpDefinition(PolledDefinition):
    """A kind of line over TCP, with the keys `host` and `port`."""

    over_network = True
    example_port = "192.168.1.9:4001"

    def pace(self, settings: Any, turnaround_s: float | None = None) -> Pace:
        return network_pace(settings.pause_s, turnaround_s)

    def probe(self, computer: Computer, subject: str, settings: Any, daemon_runs: bool) -> Iterator[Finding]:
        from compd.probes import tcp_finding

        yield tcp_finding(subject, settings.host, settings.port, daemon_runs)

    def port_keys(self, port: PortArguments) -> dict[str, Any]:
        return port.network_keys("is no address", self.example_port)

    def claims(self, port: str) -> bool:
        return PortArguments(port, None, None, 0.0).host_and_port is not None

    def device(self, line: Any) -> str:
        return "" if line.port is None else f"//{line.host}:{line.port}"

    def without_signals(self, line: Any) -> str:
        return "a TCP connection"
