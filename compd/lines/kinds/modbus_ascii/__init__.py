"""Modbus ASCII lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

from compd.clock import Clock
from compd.lines.kinds.modbus_ascii.settings import ModbusAsciiLine
from compd.lines.serial_definition import SerialDefinition

if TYPE_CHECKING:
    from compd.lines.kinds.modbus_ascii.master import AsciiMaster
    from compd.lines.ports import Ports
    from compd.twins import PolledTwin


class ModbusAscii(SerialDefinition):
    """Modbus registers, in frames of hexadecimal digits."""

    kind = "modbus_ascii"
    carries = "registers"
    settings = ModbusAsciiLine
    order = 40

    def open(self, settings: ModbusAsciiLine, clock: Clock, ports: Ports) -> AsciiMaster:
        from compd.lines.kinds.modbus_ascii.master import AsciiMaster

        return AsciiMaster(self.stream(settings, clock, ports), settings.ask_one_more)

    def bytes_on_wire(self, sent: int, received: int) -> tuple[int, int]:
        """Two digits for each byte, one byte of LRC for two of CRC, and : CR LF."""
        return 2 * (sent - 1) + 3, 2 * (received - 1) + 3 if received else 0

    @property
    def twin(self) -> PolledTwin:
        from compd.lines.kinds.modbus_ascii.twin import TWIN

        return TWIN


KIND = ModbusAscii()
