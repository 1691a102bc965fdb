"""The other end of a scale display ND 221 B / ND 281 B: STX is answered by the 17 bytes of the manual's page 39."""

from __future__ import annotations

import math

from compd.twins import SimulatedByteDevice

DECIMALS_MM = 4  # display step 0.1 um
DECIMALS_INCH = 5  # display step 0.25 um
MM_IN_AN_INCH = 25.4


class SimulatedNd28x(SimulatedByteDevice):
    """Shows its channel `position`; a sensor that is off gives the unit `?`."""

    def receive(self, data: bytes) -> bytes:
        """One reply for every STX among the bytes; other bytes are ignored."""
        return b"".join(self._shown() for byte in data if byte == 0x02)

    def _shown(self) -> bytes:
        position_mm = self.sense("position")
        unit = " "
        number, decimals = position_mm, DECIMALS_MM
        if self.options.unit == "inch":
            number, decimals, unit = position_mm / MM_IN_AN_INCH, DECIMALS_INCH, '"'
        if not math.isfinite(position_mm):
            number, unit = 0.0, "?"
        sign = "-" if number < 0 else "+"
        return f"{sign}{abs(number):10.{decimals}f} {unit}  \r\n".encode("ascii")
