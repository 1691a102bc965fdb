"""The device's replies for other values of its sensors, which decide whether a number is right, wrong, or neither.

A number is right if the device, with its sensor at that number, would have sent what it sent: no more than the last
digit of the device lies between them. A number out of a damaged reply that is not right is either the driver's fault,
or the device would itself have sent these very bytes for it: then the damage is undetectable.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from compd.conformance.peer import Exchange, Peer, SensorValues

# Largest distance (digits) of a number from the values that the device shows alike. One that is off by a digit is
# wrong.
SLACK_DIGITS = 0.25
ROUNDING = 1e-9  # share of the value or the range: floating point
NEAR = 1e-6  # share of the value or the range: distance of values of another channel, or beyond an end
PART_OF_A_DIGIT = 1 / 4096  # accuracy of the search for the ends of a digit
MIN_STEP = 1e-10  # share of the range: start of the search for a digit
BEYOND = 1e3  # multiple of the value or the range at which an unchanged display shows the device's end
_LEADING = re.compile(rb"(?<!\d)(?<!\d[.,])( *)([+-]?)([ 0]*)(?=\d)")
_EXPONENT_OF_ZERO = re.compile(rb"(?<=\d[eE])-(?=0+(?!\d))")
CONTROL = frozenset(b"\r\n\t\x02\x03\x04\x06\x15\x1b")


def is_text(reply: bytes) -> bool:
    """Whether a reply consists of printable characters and framing ones."""
    return bool(reply) and all(0x20 <= byte < 0x7F or byte in CONTROL for byte in reply)


class DeviceReplies:
    """The device's replies as a function of its sensors' values.

    digit : by channel, the smallest step of the device that was seen so far, in the channel's unit.
    """

    def __init__(self, peer: Peer, sensors: SensorValues) -> None:
        self.digit: dict[str, float] = {}
        self._peer = peer
        self._sensors = sensors
        self._lengths: dict[bytes, set[int]] = {}  # of replies with values, by request

    def learn(self, exchanges: Sequence[Exchange]) -> None:
        """Remember the lengths of the replies in a poll without faults."""
        for exchange in exchanges:
            self._lengths.setdefault(exchange.request, set()).add(len(exchange.reply))

    def at(self, exchanges: Sequence[Exchange], **values: float) -> tuple[bytes, ...] | None:
        """The replies of these exchanges with other values of some channels; None if the simulated device fails."""
        try:
            return self._peer.would_answer((e.request for e in exchanges), {**self._sensors.values, **values})
        except Exception:  # noqa: BLE001  foreign code: a simulated device may have no form for such a value
            return None

    def is_right(self, channel: str, number: float, exchanges: Sequence[Exchange]) -> bool:
        """Whether `number` is the device's display of the present value of `channel`, to its last digit."""
        value = self._sensors.values[channel]
        if abs(number - value) <= self._rounding(channel) + self.digit.get(channel, 0.0) / 2:
            return True
        if not exchanges or not math.isfinite(value):
            return False
        if self._shows(exchanges, {channel: number}):
            near = abs(number - value) <= NEAR * self._scale(channel)
            return near or bool(self.channels_shown(exchanges, [channel]))
        lowest, highest = self.interval(channel, exchanges)
        if not math.isfinite(lowest) and not math.isfinite(highest):
            return False
        slack = SLACK_DIGITS * (highest - lowest) if math.isfinite(highest - lowest) else 0.0
        return lowest - slack <= number <= highest + slack

    def are_right(self, numbers: Mapping[str, float], exchanges: Sequence[Exchange]) -> bool:
        """Whether all of `numbers` are certainly right; faster than checking each."""
        values = self._sensors.values
        far = {
            k: v for k, v in numbers.items() if not abs(v - values[k]) <= self._rounding(k) + self.digit.get(k, 0) / 2
        }
        near = all(abs(v - values[k]) <= NEAR * self._scale(k) for k, v in far.items())
        return not far or (near and bool(exchanges) and self._shows(exchanges, far))

    def could_be(self, numbers: Mapping[str, float], exchanges: Sequence[Exchange]) -> bool:
        """Whether the device would send what was delivered if its sensors had these values.

        Where it shows no number for them, because they are beyond its range, only the shape of its replies counts.
        """
        for nudge in (
            0.0,
            SLACK_DIGITS,
            -SLACK_DIGITS,
        ):  # a device that truncates its last digit shows a number just below
            values = {
                name: number + math.copysign(nudge * self.digit.get(name, 0.0), number)
                for name, number in numbers.items()
            }
            replies = self.at(exchanges, **values)
            pairs = list(zip(exchanges, replies or [b""] * len(exchanges), strict=True))
            if all(
                self._alike(exchange.delivered, reply, exchange.request) or _is_beyond(exchange, reply)
                for exchange, reply in pairs
            ):
                return True
        return False

    def interval(self, channel: str, exchanges: Sequence[Exchange]) -> tuple[float, float]:
        """Lowest and highest value of `channel` with the same display as the present one; infinite at its ends."""
        value = self._sensors.values[channel]
        ends = []
        for direction in (-1.0, 1.0):
            step = max(self.digit.get(channel, 0.0) / 4, MIN_STEP * self._scale(channel))
            alike = 0.0
            while self._shows(exchanges, {channel: value + direction * step}):
                alike, step = step, 2 * step
                if step > BEYOND * self._scale(channel):
                    alike = step = math.inf
                    break
            while math.isfinite(alike) and step - alike > PART_OF_A_DIGIT * self.digit.get(channel, step):
                middle = (alike + step) / 2
                if middle in (alike, step):  # no number between them
                    break
                if self._shows(exchanges, {channel: value + direction * middle}):
                    alike = middle
                else:
                    step = middle
            ends.append(value + direction * (alike + step) / 2)
        lowest, highest = ends
        if 0 < highest - lowest < math.inf:
            self.digit[channel] = min(self.digit.get(channel, math.inf), highest - lowest)
        return lowest, highest

    def channels_shown(self, exchanges: Sequence[Exchange], channels: Sequence[str]) -> list[str]:
        """Those of `channels` that the replies depend on."""
        return [
            name
            for name in channels
            if not all(self._shows(exchanges, {name: end}) for end in self._sensors.extents[name])
        ]

    def _shows(self, exchanges: Sequence[Exchange], values: Mapping[str, float]) -> bool:
        """Whether the device, with other values of some channels, would have sent what it sent."""
        replies = self.at(exchanges, **values)
        return replies is not None and all(
            reply == exchange.reply for reply, exchange in zip(replies, exchanges, strict=True)
        )

    def _scale(self, channel: str) -> float:
        return max(abs(self._sensors.values[channel]), *map(abs, self._sensors.extents[channel]))

    def _rounding(self, channel: str) -> float:
        return ROUNDING * self._scale(channel)

    def _alike(self, delivered: bytes, reply: bytes, request: bytes) -> bool:
        """Whether two replies are equal up to the padding before a number, and the sign of an exponent of 0."""
        if delivered == reply:
            return True
        if not (is_text(delivered) and is_text(reply)):
            return False
        fixed = len(self._lengths.get(request, ())) < 2

        def plain(text: bytes) -> bytes:
            text = _LEADING.sub(lambda m: m[2] + (b"0" * (len(m[1]) + len(m[3])) if fixed else b""), text)
            return _EXPONENT_OF_ZERO.sub(b"+", text)

        return plain(delivered) == plain(reply)


def _is_beyond(exchange: Exchange, reply: bytes) -> bool:
    """Whether a damaged reply kept its shape, while the device has another one for its value, `reply`."""
    shape = _shape(exchange.delivered)
    damaged = is_text(exchange.delivered) and exchange.delivered != exchange.reply
    return damaged and shape == _shape(exchange.reply) and shape != _shape(reply)


def _shape(reply: bytes) -> bytes:
    """A reply with all digits, and the blanks before them, as 0, and all signs as +."""
    return re.sub(rb"[+-]", b"+", re.sub(rb"[0-9 ]", b"0", reply))
