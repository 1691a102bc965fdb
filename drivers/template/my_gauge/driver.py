r"""MyGauge 100: a comparator on RS-232.

Source: write here which manual, which page, and what you only guess. This template's device does not exist:
9600 8N1; `?` CR asks for the value, the reply is a sign, two digits, a point, four digits, unit, CR LF:

    +01.2345mm\r\n

`ER` and two digits instead is an error: 01 no probe, 02 over range, 03 under range, others the unit's own.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

from pydantic import Field

from compd.gauge import ByteLine, Channel, Gauge, GaugeOptions, LineFault, Quality, Reading, bad, good

REQUEST = b"?\r"
END = b"\r\n"
MAX_REPLY = 12  # bytes: +01.2345mm CR LF
# As narrow as the manual allows: anything that does not fit exactly is damage on the wire.
_VALUE = re.compile(rb"([+-]\d{2}\.\d{4})(mm|in)")
_ERROR = re.compile(rb"ER(\d{2})")
_ERRORS = {b"01": Quality.SENSOR_FAULT, b"02": Quality.OVER_RANGE, b"03": Quality.UNDER_RANGE}
_MM = {"mm": 1.0, "in": 25.4}  # exact, by definition


class MyGaugeOptions(GaugeOptions):
    """Keys of this gauge in the configuration. Defaults come from a measurement or a manual."""

    unit: Literal["mm", "in"] = Field(description="the unit's setting; the other one is refused")


class MyGauge(Gauge[ByteLine]):
    """One comparator, one channel `value` in mm."""

    Options = MyGaugeOptions
    line_kind = "bytes"
    integrity = "format"  # no checksum on this wire
    usual_line = (9600, "8N1")
    # `compd gauge test-driver my_gauge` tries the driver with these
    sample_options: ClassVar[Mapping[str, Any]] = {"unit": "mm"}

    def __init__(self, options: MyGaugeOptions) -> None:
        super().__init__(options)
        self._mm = _MM[options.unit]

    @property
    def channels(self) -> Sequence[Channel]:
        return (Channel("value"),)

    def traffic(self) -> Sequence[tuple[int, int]]:
        return [(len(REQUEST), MAX_REPLY)]

    def read(self, line: ByteLine) -> Sequence[Reading]:
        """Raises LineFault: MISMATCH unless the reply is whole and in the configured unit; others as the line does."""
        time_s = line.send(REQUEST)
        reply = line.receive_until(END, MAX_REPLY).removesuffix(END)
        if error := _ERROR.fullmatch(reply):
            return [bad(time_s, _ERRORS.get(error[1], Quality.DEVICE_ERROR), reply.decode())]
        value = _VALUE.fullmatch(reply)
        if value is None:
            raise LineFault(Quality.MISMATCH, repr(reply))
        if value[2].decode() != self.options.unit:
            raise LineFault(Quality.MISMATCH, f"the unit is not set to {self.options.unit}: {reply!r}")
        return [good(float(value[1]) * self._mm, time_s)]
