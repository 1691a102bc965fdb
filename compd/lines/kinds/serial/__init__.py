"""Lines of bytes on a serial port."""

from __future__ import annotations

from typing import TYPE_CHECKING

from compd.lines.kinds.serial.settings import SerialLine
from compd.lines.serial_definition import SerialDefinition

if TYPE_CHECKING:
    from compd.twins.polled_twin import PolledTwin


class Serial(SerialDefinition):
    """RS-232 or RS-485."""

    kind = "serial"
    carries = "bytes"
    settings = SerialLine
    order = 10
    tries_drivers = True

    @property
    def twin(self) -> PolledTwin:
        from compd.lines.kinds.serial.twin import TWIN

        return TWIN


KIND = Serial()
