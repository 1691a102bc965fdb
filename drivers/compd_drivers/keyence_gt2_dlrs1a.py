"""Keyence GT2 contact sensors through one DL-RS1A: up to 15 comparator heads on one RS-232 line.

Source: manual of the DL-RS1A (M) and public code (C): 9600 8N1, 2400 to 38400 baud; `M0` CR LF is answered by
`M0` and one field `,+ddd.dddd` in mm per head; `MS` puts a two-digit status before each value; an error is
`ER,command,nn`. A value that is not a number, or of 199.999 mm and more, means that the head has none.
The protocol has no checksum: a value that jumps is asked for twice.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

from pydantic import Field

from compd.gauge import ByteLine, Channel, Gauge, GaugeOptions, LineFault, Quality, Reading, bad, good

MAX_HEADS = 15
NO_VALUE_MM = 199.999  # from here on numbers are codes
END = b"\r\n"
_NUMBER = re.compile(rb"[+-]\d{3}\.\d{4}")
_NO_NUMBER = re.compile(rb"[^\d,]{1,9}")  # dashes or letters in place of digits
_STATUS = re.compile(rb"\d{2}")
_ERROR = re.compile(rb"ER,(\w+),(\d{1,3})")
_FIELD_LENGTH = 10  # of `,+ddd.dddd`
_STATUS_LENGTH = 3  # of `,dd`


class KeyenceGt2DlRs1aOptions(GaugeOptions):
    """Options of a DL-RS1A."""

    heads: int = Field(ge=1, le=MAX_HEADS, description="number of heads on the unit; channels are named 1, 2 ...")
    request: Literal["M0", "MS"] = Field(
        default="M0", description="M0: values; MS: values with each head's status, for units that want it"
    )


class KeyenceGt2DlRs1a(Gauge[ByteLine]):
    """All heads of one unit in one reply: channels `1`, `2` ... in mm."""

    Options = KeyenceGt2DlRs1aOptions
    line_kind = "bytes"
    usual_line = (9600, "8N1")
    sample_options: ClassVar[Mapping[str, Any]] = {"heads": 9}

    def __init__(self, options: KeyenceGt2DlRs1aOptions) -> None:
        super().__init__(options)
        self._name = options.request.encode()
        self._with_status = options.request == "MS"
        self._limit = 4 + options.heads * (_FIELD_LENGTH + _STATUS_LENGTH * self._with_status)
        self._channels = tuple(Channel(str(head + 1)) for head in range(options.heads))

    @property
    def channels(self) -> Sequence[Channel]:
        return self._channels

    def traffic(self) -> Sequence[tuple[int, int]]:
        return [(len(self._name + END), self._limit)]

    def read(self, line: ByteLine) -> Sequence[Reading]:
        """Raises LineFault: DEVICE_ERROR for `ER`, MISMATCH unless there is one field per head."""
        time_s = line.send(self._name + END)
        reply = line.receive_until(END, self._limit)[: -len(END)]
        name, *fields = reply.split(b",")
        if _ERROR.fullmatch(reply):
            raise LineFault(Quality.DEVICE_ERROR, reply.decode())
        if name != self._name:
            raise LineFault(Quality.MISMATCH, repr(reply))
        if self._with_status:
            if not all(_STATUS.fullmatch(status) for status in fields[::2]):
                raise LineFault(Quality.MISMATCH, repr(reply))
            fields = fields[1::2]
        if len(fields) != len(self._channels):
            raise LineFault(
                Quality.MISMATCH, f"{len(fields)} heads answered, {len(self._channels)} are configured: {reply!r}"
            )
        return [_reading(field, time_s, reply) for field in fields]


def _reading(field: bytes, time_s: float, reply: bytes) -> Reading:
    """One head. Digits mixed with other characters are damage on the wire, which makes every field doubtful."""
    if not _NUMBER.fullmatch(field):
        if _NO_NUMBER.fullmatch(field):
            return bad(time_s, Quality.SENSOR_FAULT, field.decode("ascii", "backslashreplace"))
        raise LineFault(Quality.MISMATCH, repr(reply))
    value_mm = float(field)
    if abs(value_mm) >= NO_VALUE_MM:
        return bad(time_s, Quality.OVER_RANGE if value_mm > 0 else Quality.UNDER_RANGE, field.decode())
    return good(value_mm, time_s)
