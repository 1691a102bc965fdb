"""Modbus ASCII: frames of hexadecimal digits between a colon and CR LF, with an LRC; the length of each is known.

Source: Modbus over Serial Line V1.02, 2.5.2 (frame) and 6.2.1 (LRC).
"""

from __future__ import annotations

from compd.gauge import LineFault, Quality
from compd.lines.modbus_serial import CONFIRMED, WRITES, SerialMaster
from compd.lines.stream import shown

START, END = b":", b"\r\n"
MIN_FRAME = 11  # colon; unit, function, exception or byte count, LRC in two digits each; CR LF
COUNTED = 3  # bytes until the byte count


def lrc(data: bytes) -> int:
    """Longitudinal redundancy check: what makes the sum of all bytes 0, modulo 256."""
    return -sum(data) % 256


class AsciiMaster(SerialMaster):
    """A `RegisterLine` over a stream of bytes, in Modbus ASCII. Used by one thread."""

    def _send(self, unit: int, message: bytes) -> float:
        request = bytes([unit]) + message
        return self._stream.send(START + (request + bytes([lrc(request)])).hex().upper().encode() + END)

    def _receive(self, unit: int) -> bytes:
        text = self._stream.receive_head(MIN_FRAME)
        head = _decoded(text[: 1 + 2 * COUNTED], text)
        # a shortest frame has no data; a reply has as much as it counts, a confirmation as every one
        more = 0 if head[1] & 0x80 else CONFIRMED - 1 if head[1] in WRITES else head[2]
        text += self._stream.receive_rest(text, 2 * more)
        if not text.endswith(END):
            raise LineFault(Quality.MISMATCH, f"no CR LF at the end of {shown(text)}")
        frame = _decoded(text[: -len(END)], text)
        if sum(frame) % 256:
            raise LineFault(Quality.CRC, shown(text))
        if frame[0] != unit:
            raise LineFault(Quality.MISMATCH, f"asked unit {unit}, unit {frame[0]} answered")
        return frame[1:-1]


def _decoded(digits: bytes, text: bytes) -> bytes:
    """The bytes that a frame's digits, behind its colon, stand for. Raises LineFault for anything else.

    text : all that came, for the fault.
    """
    if not digits.startswith(START):
        raise LineFault(Quality.MISMATCH, f"no colon at the beginning of {shown(text)}")
    try:
        if digits[1:].isalnum():  # `fromhex` would take blanks
            return bytes.fromhex(digits[1:].decode("ascii"))
    except ValueError:
        pass
    raise LineFault(Quality.CRC, f"not hexadecimal digits: {shown(text)}")
