"""Lines to OPC UA servers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from compd.clock import Clock
from compd.lines.kinds.opc_ua.settings import OpcUaLine
from compd.lines.line_definition import Library, PushedDefinition
from compd.lines.port_arguments import PortArguments

if TYPE_CHECKING:
    from compd.lines.kinds.opc_ua.subscriber import OpcUaSubscriber
    from compd.lines.kinds.opc_ua.twin import OpcUaNodes
    from compd.probes import Computer, Finding


class OpcUa(PushedDefinition):
    """Nodes of an OPC UA server, by a subscription."""

    kind = "opc_ua"
    carries = "nodes"
    settings = OpcUaLine
    order = 60
    example_port = "opc.tcp://192.168.1.9:4840/server"
    library = Library("asyncua", "opcua")

    def subscriber(self, settings: OpcUaLine, clock: Clock) -> OpcUaSubscriber:
        from compd.lines.kinds.opc_ua.subscriber import OpcUaSubscriber

        return OpcUaSubscriber(settings, clock)

    def simulated_line(self, name: str, devices: Sequence[Any], broker: tuple[str, int] | None) -> OpcUaNodes:
        from compd.lines.kinds.opc_ua.twin import OpcUaNodes

        return OpcUaNodes(name, devices)

    def probe(self, computer: Computer, subject: str, settings: OpcUaLine, daemon_runs: bool) -> Iterator[Finding]:
        from compd.probes import tcp_finding

        address = urlsplit(settings.endpoint)
        yield tcp_finding(subject, address.hostname or "", address.port or 0, daemon_runs)

    def port_keys(self, port: PortArguments) -> dict[str, Any]:
        return {"endpoint": port.port}


KIND = OpcUa()
