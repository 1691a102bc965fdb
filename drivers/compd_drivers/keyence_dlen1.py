"""Keyence GT2 contact sensors through one DL-EN1: up to 15 comparator heads over Ethernet.

Source: public code of a DL-EN1 simulator and of clients (C, read in public code; Jakob-Stadler/ILSim on GitHub), no
manual: TCP port 64000, `MS` CR LF is answered by `MS` and, per head, a two-digit output state and a number of nine
digits with sign. The number is an integer: value = number / 10^decimals; the GT2 shows 0.0001 mm, that is 4
decimals, but the amplifier's setting decides (`FR` reads it), so it is an option without default.

    state     00 none, 01 high, 02 low, 04 go, 08 HH, 16 LL: judgements, which do not touch the value;
              03 error of the amplifier
    number    +099999999 over range, -099999999 under range, -099999998 invalid, +100000000 error
    ER,MS,n   031 while it starts its communication, 254 system error or starting, 255 format

Plausible only: any sum of the judgements may be sent, so other states than 03 are not refused.
TCP keeps the bytes, and the connection keeps requests and replies in order; behind a serial device server a value
that jumps is asked for twice.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from pydantic import Field

from compd.gauge import ByteLine, Channel, Gauge, GaugeOptions, LineFault, Quality, Reading, bad, good

MAX_HEADS = 15
END = b"\r\n"
_STATE = re.compile(rb"\d{2}")
_NUMBER = re.compile(rb"[+-]\d{9}")
_ERROR = re.compile(rb"ER,MS,(\d{3})")
_FIELDS_LENGTH = 14  # of `,ss,+ddddddddd`
STATE_ERROR = b"03"
INSTEAD = {
    b"+099999999": (Quality.OVER_RANGE, "over range"),
    b"-099999999": (Quality.UNDER_RANGE, "under range"),
    b"-099999998": (Quality.SENSOR_FAULT, "invalid"),
    b"+100000000": (Quality.SENSOR_FAULT, "amplifier error"),
}
LARGEST = 99_999_997  # larger numbers are codes
ERRORS = {b"031": "starting its communication", b"254": "system error, or starting", b"255": "format"}


class KeyenceDlEn1Options(GaugeOptions):
    """Options of a DL-EN1."""

    heads: int = Field(ge=1, le=MAX_HEADS, description="number of heads on the unit; channels are named 1, 2 ...")
    decimals: int = Field(ge=0, le=6, description="of the amplifiers' display; GT2 in 0.1 um: 4")


class KeyenceDlEn1(Gauge[ByteLine]):
    """All heads of one unit in one reply: channels `1`, `2` ... in mm."""

    Options = KeyenceDlEn1Options
    line_kind = "bytes"
    sample_options: ClassVar[Mapping[str, Any] | None] = {"heads": 3, "decimals": 4}

    def __init__(self, options: KeyenceDlEn1Options) -> None:
        super().__init__(options)
        self._steps_per_mm = 10**options.decimals
        self._limit = max(4 + options.heads * _FIELDS_LENGTH, len("ER,MS,254\r\n"))
        self._channels = tuple(Channel(str(head + 1)) for head in range(options.heads))

    @property
    def channels(self) -> Sequence[Channel]:
        return self._channels

    def traffic(self) -> Sequence[tuple[int, int]]:
        return [(len(b"MS" + END), self._limit)]

    def read(self, line: ByteLine) -> Sequence[Reading]:
        """Raises LineFault: DEVICE_ERROR for `ER`, MISMATCH unless there are two fields per head."""
        time_s = line.send(b"MS" + END)
        reply = line.receive_until(END, self._limit)[: -len(END)]
        if error := _ERROR.fullmatch(reply):
            why = ERRORS.get(error[1], "")
            raise LineFault(Quality.DEVICE_ERROR, f"{reply.decode()}: {why}" if why else reply.decode())
        name, *fields = reply.split(b",")
        if name != b"MS" or len(fields) % 2:
            raise LineFault(Quality.MISMATCH, repr(reply))
        if len(fields) != 2 * len(self._channels):
            raise LineFault(
                Quality.MISMATCH,
                f"{len(fields) // 2} heads answered, {len(self._channels)} are configured: {reply!r}",
            )
        return [
            self._reading(state, number, time_s, reply) for state, number in zip(fields[::2], fields[1::2], strict=True)
        ]

    def _reading(self, state: bytes, number: bytes, time_s: float, reply: bytes) -> Reading:
        if not (_STATE.fullmatch(state) and _NUMBER.fullmatch(number)):
            raise LineFault(Quality.MISMATCH, repr(reply))
        if number in INSTEAD:
            quality, why = INSTEAD[number]
            return bad(time_s, quality, f"{number.decode()}: {why}")
        if state == STATE_ERROR or abs(int(number)) > LARGEST:
            return bad(time_s, Quality.SENSOR_FAULT, f"state {state.decode()}, {number.decode()}")
        return good(int(number) / self._steps_per_mm, time_s)
