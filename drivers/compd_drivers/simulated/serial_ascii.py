"""The other end of a described ASCII gauge: answers its `out` with what its `in` shows, printed as C would.

It answers only the requests of the description. A sensor that is off is shown by a word or an error reply that the
description has for it; without one the device is silent.
"""

from __future__ import annotations

import binascii
import math
import re
from typing import Any

from compd.twins import Sense, SimulatedByteDevice
from compd_drivers.simulated.shared import number_for

ESCAPES = {"r": "\r", "n": "\n", "t": "\t", "\\": "\\"}
TOKEN = re.compile(
    r"%%|%([0#]?)(\d*)(?:\.(\d+))?<(\w+)>|%\*\??(\d*)(?:[cdefxs]|\[(\^?)\]?([^\]]*)\])"
    r"|%(?:\((\w+)\))?([+ 0]*\d*(?:\.\d+)?)(?:([fdex])|\{([^}]*)\})"
)


def plain(text: str) -> str:
    r"""Text with \r, \xHH and the like replaced."""
    return re.sub(
        r"\\(?:x([0-9A-Fa-f]{2})|(.))", lambda m: chr(int(m[1], 16)) if m[1] else ESCAPES[m[2]], text, flags=re.DOTALL
    )


class SimulatedAscii(SimulatedByteDevice):
    """Answers the measuring request, the `init` exchanges and the `echo`."""

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        end = plain(options.out_terminator)
        exchanges = [*options.init, *([options.echo] if options.echo else [])]
        self._replies = {(plain(exchange.out) + end).encode("latin-1"): exchange.in_ for exchange in exchanges}
        self._forms = [options.in_, *(request.in_ for request in options.requests)]  # of replies with values
        for out, form in [(options.out, options.in_), *((request.out, request.in_) for request in options.requests)]:
            if out:
                self._replies[(plain(out) + end).encode("latin-1")] = form
        self._received = b""

    @property
    def error_replies(self) -> dict[bytes, str]:
        """Each described error in the form on the wire, with its quality."""
        end = plain(self.options.in_terminator)
        return {(self._printed(error.in_, {}) + end).encode("latin-1"): error.quality for error in self.options.errors}

    def receive(self, data: bytes) -> bytes:
        self._received += data
        replies = ""
        while asked := self._next():
            replies += self._answer(self._replies[asked])
        return replies.encode("latin-1")

    def speak(self) -> bytes:
        asked = self.options.out or self.options.requests
        return b"" if asked else self._answer(self.options.in_).encode("latin-1")

    def _next(self) -> bytes:
        """Take the first whole request out of the received bytes."""
        places = {request: self._received.find(request) for request in self._replies}
        requests = {request: place for request, place in places.items() if place >= 0}
        if not requests:
            self._received = self._received[-max(map(len, self._replies), default=0) :]
            return b""
        first = min(requests, key=lambda request: (requests[request], -len(request)))
        self._received = self._received[requests[first] + len(first) :]
        return first

    def _answer(self, form: str) -> str:
        end = plain(self.options.in_terminator)
        words = {}
        for channel in self.options.channels if form in self._forms else ():
            if f"({channel.name})" not in form and self.options.requests:
                continue
            value = self.sense(channel.name)
            if not math.isfinite(value):
                word = next((word for word, meant in channel.instead.items() if meant == "sensor_fault"), None)
                if word is None:
                    error = self._error_of("sensor_fault") or self._error_of("device_error")
                    return self._printed(error, {}) + end if error else ""
                words[channel.name] = plain(word)
            elif (error := self._error_of("over_range")) and _beyond(channel, value):
                return self._printed(error, {}) + end
        return self._printed(form, words) + end

    def _error_of(self, quality: str) -> str:
        """The first error reply of this meaning; "" if the description has none."""
        return next((error.in_ for error in self.options.errors if error.quality == quality), "")

    def _printed(self, form: str, words: dict[str, str]) -> str:
        """`form` with numbers, blanks for skipped text, and checksums."""
        text, done, at = plain(form), "", 0
        for token in TOKEN.finditer(text):
            done += text[at : token.start()]
            at = token.end()
            done += self._token(token, done, words)
        return done + text[at:]

    def _token(self, token: re.Match[str], before: str, words: dict[str, str]) -> str:
        if token[0] == "%%":
            return "%"
        if token[4]:
            covered = before[int(token[2] or 0) : len(before) - int(token[3] or 0)]
            return checksum(token[4], covered.encode("latin-1"), token[1])
        name = token[8] or self.options.channels[0].name
        if token[11] is not None:
            return self._factor(name, token[11])[0]
        if token[10]:
            return words.get(name) or self._number(name, f"%{token[9]}{token[10]}")
        if "?" in token[0]:
            return ""
        filler = "0" if token[0][-1] in "cdefx" or token[6] else (token[7] or "x")[0]
        return filler * int(token[5] or 1)

    def _factor(self, name: str, choices: str) -> tuple[str, float]:
        """The word beside a channel's number, and its factor: the first whose sign is that of the value."""
        pairs = [(word, float(factor)) for word, _, factor in (part.rpartition("=") for part in choices.split("|"))]
        value = self._scaled(name)
        turned = any(factor < 0 for _, factor in pairs) and value < 0
        return next(((word, factor) for word, factor in pairs if (factor < 0) == turned), pairs[0])

    def _channel(self, name: str) -> Any:
        return next(channel for channel in self.options.channels if channel.name == name)

    def _scaled(self, name: str) -> float:
        """The number before the words beside it."""
        channel = self._channel(name)
        value = self.sense(name)
        return number_for(channel, value) / channel.scale * 10**channel.decimals if math.isfinite(value) else 0.0

    def _number(self, name: str, form: str) -> str:
        value = self._scaled(name)
        for token in TOKEN.finditer(plain("".join(self._forms))):
            if token[11] is not None and (token[8] or name) == name:
                value /= self._factor(name, token[11])[1]
        width = int(re.sub(r"\D", "", form.partition(".")[0]) or 0)
        if form[-1] == "x" and "+" in form:  # two's complement
            return f"{round(value) % 16**width:0{width}X}"
        text = str(form % (round(value) if form[-1] in "dx" else value))
        # an exact width without room for the zero before the point: -.050000
        text = text.replace("0.", ".", 1) if 0 < width < len(text) and abs(value) < 1 else text
        return text.replace(".", self.options.decimal_mark)


def _beyond(channel: Any, value: float) -> bool:
    return channel.range is not None and not channel.range[0] <= value <= channel.range[1]


def checksum(kind: str, data: bytes, digits: str) -> str:
    """A checksum in its form on the wire. digits : "" for bytes, "0" for hexadecimal, "#" for decimal digits."""
    length, low_first, value = 1, True, 0
    if kind == "crc16_modbus":
        length, value = 2, 0xFFFF
        for byte in data:
            value ^= byte
            for _ in range(8):
                value = (value >> 1) ^ (0xA001 if value & 1 else 0)
    elif kind in ("crc_ccitt", "crc_xmodem"):
        length, low_first = 2, False
        value = binascii.crc_hqx(data, 0xFFFF if kind == "crc_ccitt" else 0)
    elif kind == "sum16":
        length, low_first, value = 2, False, sum(data) & 0xFFFF
    elif kind == "sum100":
        value = sum(data) % 100
    elif kind == "modbus_lrc":
        value = (0x100 - sum(binascii.unhexlify(data))) & 0xFF
    else:
        value = _byte_checksum(kind, data)
    if digits == "#":
        return f"{value:0{2 if kind == 'sum100' else 5 if length == 2 else 3}d}"
    if digits:
        return f"{value:0{2 * length}X}"
    return value.to_bytes(length, "little" if low_first else "big").decode("latin-1")


def _byte_checksum(kind: str, data: bytes) -> int:
    value = 0
    for byte in data:
        match kind:
            case "sum8":
                value = (value + byte) % 256
            case "negative_sum8":
                value = (value - byte) % 256
            case "xor8":
                value ^= byte
            case "crc8":
                value ^= byte
                for _ in range(8):
                    value = ((value << 1) ^ (0x07 if value & 0x80 else 0)) & 0xFF
    return value
