"""The other end of a described ASCII gauge: answers its `out` with what its `in` shows, printed as C would.

It hears only what the description holds. A sensor that is off is shown by a word or an error reply that the
description has for it; without one the device is silent.
"""

from __future__ import annotations

import math
import re
from typing import Any

from compd.simulation.wires.device import Sense, SimulatedByteDevice
from compd_drivers.simulated.shared import number_for

ESCAPES = {"r": "\r", "n": "\n", "t": "\t", "\\": "\\"}
TOKEN = re.compile(
    r"%%|%(0?)(\d*)<(\w+)>|%\*\??(\d*)(?:[cdefxs]|\[(\^?)\]?([^\]]*)\])|%(?:\((\w+)\))?([+ 0]*\d*(?:\.\d+)?)([fdex])"
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
        if options.out:
            self._replies[(plain(options.out) + end).encode("latin-1")] = options.in_
        self._heard = b""

    @property
    def error_replies(self) -> dict[bytes, str]:
        """Each described error as it goes over the wire, and the quality that it means."""
        end = plain(self.options.in_terminator)
        return {(self._printed(error.in_, {}) + end).encode("latin-1"): error.quality for error in self.options.errors}

    def hear(self, data: bytes) -> bytes:
        self._heard += data
        replies = ""
        while asked := self._next():
            replies += self._answer(self._replies[asked])
        return replies.encode("latin-1")

    def asked_by_dtr(self) -> bytes:
        return self._answer(self.options.in_).encode("latin-1") if self.options.dtr_pulse_s else b""

    def _next(self) -> bytes:
        """The first whole request in what was heard, taken out of it."""
        places = {request: self._heard.find(request) for request in self._replies}
        requests = {request: place for request, place in places.items() if place >= 0}
        if not requests:
            self._heard = self._heard[-max(map(len, self._replies), default=0) :]
            return b""
        first = min(requests, key=lambda request: (requests[request], -len(request)))
        self._heard = self._heard[requests[first] + len(first) :]
        return first

    def _answer(self, form: str) -> str:
        end = plain(self.options.in_terminator)
        words = {}
        for channel in self.options.channels if form == self.options.in_ else ():
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
        """`form` with numbers, blanks for what the driver skips, and checksums."""
        text, done, at = plain(form), "", 0
        for token in TOKEN.finditer(text):
            done += text[at : token.start()]
            at = token.end()
            done += self._token(token, done, words)
        return done + text[at:]

    def _token(self, token: re.Match[str], before: str, words: dict[str, str]) -> str:
        if token[0] == "%%":
            return "%"
        if token[3]:
            return checksum(token[3], before[int(token[2] or 0) :].encode("latin-1"), bool(token[1]))
        if token[9]:
            name = token[7] or self.options.channels[0].name
            return words.get(name) or self._number(name, f"%{token[8]}{token[9]}")
        if "?" in token[0]:
            return ""
        filler = "0" if token[0][-1] in "cdefx" or token[5] else (token[6] or "x")[0]
        return filler * int(token[4] or 1)

    def _number(self, name: str, form: str) -> str:
        channel = next(channel for channel in self.options.channels if channel.name == name)
        value = number_for(channel, self.sense(name)) / channel.scale * 10**channel.decimals
        width = int(re.sub(r"\D", "", form.partition(".")[0]) or 0)
        if form[-1] == "x" and "+" in form:  # two's complement
            return f"{round(value) % 16**width:0{width}X}"
        text = str(form % (round(value) if form[-1] in "dx" else value))
        # an exact width without room for the zero before the point: -.050000
        return text.replace("0.", ".", 1) if 0 < width < len(text) and abs(value) < 1 else text


def _beyond(channel: Any, value: float) -> bool:
    return channel.range is not None and not channel.range[0] <= value <= channel.range[1]


def checksum(kind: str, data: bytes, hexadecimal: bool) -> str:
    if kind == "crc16_modbus":
        crc = 0xFFFF
        for byte in data:
            crc ^= byte
            for _ in range(8):
                crc = (crc >> 1) ^ (0xA001 if crc & 1 else 0)
        return f"{crc:04X}" if hexadecimal else crc.to_bytes(2, "little").decode("latin-1")
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
    return f"{value:02X}" if hexadecimal else chr(value)
