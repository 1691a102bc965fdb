"""The other end of a described binary gauge: answers its `out` with its `frame`."""

from __future__ import annotations

import math
import struct
from typing import Any

from compd.twins import Sense, SimulatedByteDevice
from compd_drivers.simulated.serial_ascii import checksum
from compd_drivers.simulated.shared import number_for

FLOATS = {"float32": "f", "float64": "d"}


class SimulatedFrame(SimulatedByteDevice):
    """A sensor that is off shows its first `invalid` number, nan in a float, or else nothing."""

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        self._request = bytes.fromhex(options.out) if options.out_checksum is None else self._printed_request()
        self._received = b""

    @property
    def error_replies(self) -> dict[bytes, str]:
        """Each described error in the form on the wire, with its quality."""
        tokens = {error: error.frame.split() for error in self.options.errors}
        return {
            bytes(0 if token in {"..", "CS"} else int(token, 16) for token in frame): error.quality
            for error, frame in tokens.items()
        }

    def _printed_request(self) -> bytes:
        tokens = self.options.out.split()
        return with_checksum(
            tokens, bytearray(0 if token == "CS" else int(token, 16) for token in tokens), self.options.out_checksum
        )

    def receive(self, data: bytes) -> bytes:
        self._received += data
        replies = b""
        while self._request in self._received:
            _, _, self._received = self._received.partition(self._request)
            replies += self._frame()
        self._received = self._received[-len(self._request) :]
        return replies

    def _frame(self) -> bytes:
        tokens = self.options.frame.split()
        frame = bytearray(0 if token in {"..", "CS"} else int(token, 16) for token in tokens)
        for channel in self.options.channels:
            number = self._number(channel)
            if number is None:
                return b""
            frame[channel.at : channel.at + channel.length] = number
        return with_checksum(tokens, frame, self.options.checksum) if "CS" in tokens else bytes(frame)

    def _number(self, channel: Any) -> bytes | None:
        value = self.sense(channel.name)
        if not math.isfinite(value):
            if not channel.invalid and channel.type not in FLOATS:
                return None
            number = next(iter(channel.invalid), math.nan)
        else:
            number = number_for(channel, value) / channel.scale
        if channel.type in FLOATS:
            return struct.pack(f"{'<' if channel.byte_order == 'little' else '>'}{FLOATS[channel.type]}", number)
        signed = channel.type.startswith("int")
        length = int(channel.length)
        bits = 8 * length
        low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
        count = min(high, max(low, round(number)))
        return int(count).to_bytes(length, "little" if channel.byte_order == "little" else "big", signed=signed)


def with_checksum(tokens: list[str], frame: bytearray, check: Any) -> bytes:
    """The frame with its checksum where `tokens` say CS, made as the description's `check` says."""
    first = tokens.index("CS")
    digits = checksum(check.kind, bytes(frame[check.first : check.end or first]), "0")
    made = bytes.fromhex(digits)
    frame[first : first + len(made)] = made[::-1] if check.byte_order == "little" else made
    return bytes(frame)
