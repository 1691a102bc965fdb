"""Lines of bytes over TCP."""

from __future__ import annotations

from typing import TYPE_CHECKING

from compd.clock import Clock
from compd.lines.kinds.tcp.settings import TcpLine
from compd.lines.tcp_definition import TcpDefinition

if TYPE_CHECKING:
    from compd.lines.ports import Ports
    from compd.lines.stream import StreamLine
    from compd.twins import PolledTwin

# Silence before a request, by which a late or repeated reply is noticed before the next one is asked for. TCP has no
# character times: a second copy of a reply follows the first within this, s.
GAP_S = 1e-3


class Tcp(TcpDefinition):
    """A stream of bytes over TCP."""

    kind = "tcp"
    carries = "bytes"
    settings = TcpLine
    order = 20
    tries_drivers = True

    def stream(self, settings: TcpLine, clock: Clock, ports: Ports) -> StreamLine:
        from compd.lines.stream import StreamLine

        port = ports.of_stream(ports.tcp(settings.host, settings.port, settings.timeout_s))
        return StreamLine(port, settings.timeout_s, max(GAP_S, settings.pause_s), clock, settings.echo)

    @property
    def twin(self) -> PolledTwin:
        from compd.lines.kinds.tcp.twin import TWIN

        return TWIN


KIND = Tcp()
