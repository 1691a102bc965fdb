"""Modbus TCP lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

from compd.clock import Clock
from compd.lines.kinds.modbus_tcp.settings import ModbusTcpLine
from compd.lines.tcp_definition import TcpDefinition

if TYPE_CHECKING:
    from compd.lines.kinds.modbus_tcp.master import ModbusTcp
    from compd.lines.ports import Ports
    from compd.twins import PolledTwin


class ModbusTcpDefinition(TcpDefinition):
    """Modbus registers over TCP."""

    kind = "modbus_tcp"
    carries = "registers"
    settings = ModbusTcpLine
    order = 50
    example_port = "192.168.1.9:502"
    broadcast_answered = True
    tries_drivers = True

    def open(self, settings: ModbusTcpLine, clock: Clock, ports: Ports) -> ModbusTcp:
        """The line; nothing is put around its port."""
        from compd.lines.kinds.modbus_tcp.master import ModbusTcp

        return ModbusTcp(
            settings.host, settings.port, settings.timeout_s, clock, settings.pause_s, settings.gateway_wait_s, ports
        )

    def absent_wait_s(self, settings: ModbusTcpLine) -> float:
        """The request goes out, and nothing comes for the timeout, or a gateway is busy for longer."""
        return max(settings.timeout_s, settings.gateway_wait_s or 0.0)

    @property
    def twin(self) -> PolledTwin:
        from compd.lines.kinds.modbus_tcp.twin import TWIN

        return TWIN


KIND = ModbusTcpDefinition()
