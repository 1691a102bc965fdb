"""Heidenhain ND 221 B / ND 281 B: a scale's position display on RS-232.

Source: the display's manual, pages 39 to 42 (M, read in a manual): 7E2, 9600 or 38400 baud; STX (02) asks for
the displayed value, the reply is 17 bytes:

    sign, 10 characters (leading zeros as spaces), space, unit, sort, series, CR, LF

unit: blank = mm, " = inch, ? = fault. sort: < > = ? compare with the display's limits and do not touch the
value. series: S, G and D are read as smallest, greatest and difference of a series of measurements (P, plausible
only), which is not where the scale is: they are refused. The display's other commands (ESC A0200: C, read in
public code) are not used. The frame has no checksum: parity guards it, so leave the line at 7E2, and a
position that jumps is asked for twice.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Literal

from pydantic import Field

from compd.gauge import ByteLine, Channel, Gauge, GaugeOptions, LineFault, Quality, Reading, bad, good

STX = b"\x02"
REPLY_LENGTH = 17
MM_PER_INCH = 25.4  # exact, by definition
_REPLY = re.compile(rb'([+\- ])([ 0-9.]{10}) ([ "?])[<>=? ]([SAGD ])\r\n')
_NUMBER = re.compile(rb" *\d*\.\d+")
_UNITS = {"mm": b" ", "inch": b'"'}


class HeidenhainNd28xOptions(GaugeOptions):
    """Options of a scale display."""

    unit: Literal["mm", "inch"] = Field(
        default="mm", description="unit of the display; the other one is refused, so that switching it is noticed"
    )


class HeidenhainNd28x(Gauge[ByteLine]):
    """One display, one channel `position` in mm."""

    Options = HeidenhainNd28xOptions
    line_kind = "bytes"
    usual_line = (9600, "7E2")

    def __init__(self, options: HeidenhainNd28xOptions) -> None:
        super().__init__(options)
        self._unit = _UNITS[options.unit]
        self._mm = MM_PER_INCH if options.unit == "inch" else 1.0

    @property
    def channels(self) -> Sequence[Channel]:
        return (Channel("position"),)

    def traffic(self) -> Sequence[tuple[int, int]]:
        return [(len(STX), REPLY_LENGTH)]

    def read(self, line: ByteLine) -> Sequence[Reading]:
        """Raises LineFault: MISMATCH unless the reply is whole and in the configured unit."""
        time_s = line.send(STX)
        reply = line.receive(REPLY_LENGTH)
        match = _REPLY.fullmatch(reply)
        if match is None or not _NUMBER.fullmatch(match[2]):
            raise LineFault(Quality.MISMATCH, repr(reply))
        sign, digits, unit, series = match.groups()
        if unit == b"?":
            return (bad(time_s, Quality.SENSOR_FAULT, repr(reply)),)
        if unit != self._unit:
            raise LineFault(Quality.MISMATCH, f"the display is not set to {self.options.unit}: {reply!r}")
        if series not in b" A":
            raise LineFault(Quality.MISMATCH, f"the display shows a series ({series.decode()}), not the position")
        value_mm = float(digits) * self._mm
        return (good(-value_mm if sign == b"-" else value_mm, time_s),)
