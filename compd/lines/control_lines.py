"""The lines of a serial port beside its data: DTR and RTS, which may power a cable, and RTS as the direction of RS-485.

Sources: pyserial (`dtr`, `rts`, `rs485_mode`), Linux `tty_ioctl(4)` (TIOCMGET, TIOCMSET, TIOCSRS485).
"""

from __future__ import annotations

import fcntl
import struct
import termios
from typing import Any, NamedTuple

import serial.rs485

from compd.line_settings import Rs485


class ControlLines(NamedTuple):
    """How the lines of a port are set while it is open: True is HIGH, None leaves them as the system sets them."""

    dtr: bool | None = None
    rts: bool | None = None
    rs485: Rs485 | None = None

    def prepare(self, port: Any) -> None:
        """Set what a port of pyserial, not open yet, does when it is opened."""
        if self.dtr is not None:
            port.dtr = self.dtr
        if self.rts is not None:
            port.rts = self.rts

    def check(self, port: Any) -> str:
        """Set the direction of RS-485 on the open device `port`; what of all this it does not have, or ""."""
        try:
            if self.dtr is not None or self.rts is not None:
                fcntl.ioctl(port.fileno(), termios.TIOCMGET, struct.pack("I", 0))
            if self.rs485 is not None:
                port.rs485_mode = serial.rs485.RS485Settings(
                    rts_level_for_tx=self.rs485.rts_when_sending,
                    rts_level_for_rx=not self.rs485.rts_when_sending,
                    delay_before_tx=self.rs485.delay_before_s,
                    delay_before_rx=self.rs485.delay_after_s,
                )
        except (OSError, ValueError) as error:
            return str(error)
        return ""
