"""Modbus RTU lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

from compd.clock import Clock
from compd.line_settings import SerialPortSettings
from compd.lines.kinds.modbus_rtu.settings import ModbusRtuLine
from compd.lines.serial_definition import SerialDefinition

if TYPE_CHECKING:
    from compd.lines.kinds.modbus_rtu.master import RtuMaster
    from compd.lines.ports import Ports
    from compd.twins import PolledTwin


class ModbusRtu(SerialDefinition):
    """Modbus registers, in frames with a CRC."""

    kind = "modbus_rtu"
    carries = "registers"
    settings = ModbusRtuLine
    order = 30
    rtu = True
    tries_drivers = True

    def open(self, settings: ModbusRtuLine, clock: Clock, ports: Ports) -> RtuMaster:
        from compd.lines.kinds.modbus_rtu.master import RtuMaster

        return RtuMaster(self.stream(settings, clock, ports), settings.ask_one_more, settings.skip_bytes)

    def min_gap_s(self, settings: SerialPortSettings) -> float:
        from compd.lines.kinds.modbus_rtu.master import gap_s

        return max(super().min_gap_s(settings), gap_s(settings.baud))

    @property
    def twin(self) -> PolledTwin:
        from compd.lines.kinds.modbus_rtu.twin import TWIN

        return TWIN


KIND = ModbusRtu()
