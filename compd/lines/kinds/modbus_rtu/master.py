"""Modbus RTU: frames with a CRC, of which the master knows the exact length.

Source: Modbus over Serial Line V1.02 (frame, CRC, 3.5 characters of silence).
"""

from __future__ import annotations

from compd.gauge import MAX_SKIPPED_BYTES, LineFault, Quality
from compd.lines.modbus_serial import CONFIRMED, WRITES, SerialMaster
from compd.lines.stream import StreamLine, shown

MIN_FRAME = 5  # unit, function, exception or byte count, CRC
CONFIRMATION = 2 + CONFIRMED + 2  # of a write


def gap_s(baud: int) -> float:
    """Silence before a frame, s: 3.5 characters of 11 bits; above 19200 baud 1.75 ms (Serial Line V1.02, 2.5.1.1)."""
    return 3.5 * 11 / baud if baud <= 19200 else 1.75e-3


def _crc_table() -> tuple[int, ...]:
    """The CRC-16 of each single byte, from a start value of 0."""
    table = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
        table.append(crc)
    return tuple(table)


_CRC_TABLE = _crc_table()


def crc16(data: bytes) -> int:
    """CRC-16 of Modbus: polynomial 0x8005 (0xA001 reflected), start value 0xFFFF (Serial Line V1.02, 6.2.2).

    It is 0 over a frame that ends in its own CRC, low byte first.
    """
    crc = 0xFFFF
    for byte in data:
        crc = (crc >> 8) ^ _CRC_TABLE[(crc ^ byte) & 0xFF]
    return crc


def _frame_length(begin: bytes) -> int:
    """Bytes of the frame that begins so, with three bytes or more: as it counts, or as a write confirms."""
    if begin[1] & 0x80:
        return MIN_FRAME
    return CONFIRMATION if begin[1] in WRITES else MIN_FRAME + begin[2]


class RtuMaster(SerialMaster):
    """A `RegisterLine` over a stream of bytes: a serial port, or RTU over TCP. Used by one thread."""

    def __init__(self, stream: StreamLine, ask_one_more: bool = True, skip_bytes: int = 0) -> None:
        """`skip_bytes`: most damaged bytes before a reply whose rest has a matching CRC."""
        super().__init__(stream, ask_one_more)
        self._skip_bytes = skip_bytes
        self._function = 0  # of the last request

    def _send(self, unit: int, message: bytes) -> float:
        request = bytes([unit]) + message
        self._function = message[0]
        return self._stream.send(request + crc16(request).to_bytes(2, "little"))

    def _receive(self, unit: int) -> bytes:
        frame = self._stream.receive_head(MIN_FRAME)
        try:
            frame += self._stream.receive_rest(frame, _frame_length(frame) - MIN_FRAME)
            if crc16(frame):
                raise LineFault(Quality.CRC, shown(frame))
        except LineFault as fault:
            if fault.quality is Quality.LINE_LOST:
                raise
            frame = self._behind_damage(unit, frame, fault)
        if frame[0] != unit:
            raise LineFault(Quality.MISMATCH, f"asked unit {unit}, unit {frame[0]} answered")
        return frame[1:-2]

    def _behind_damage(self, unit: int, begin: bytes, fault: LineFault) -> bytes:
        """The whole frame that stands behind a few bytes. Raises `fault`, with a hint where there is one.

        A transceiver that changes its direction late, or a line without bias resistors, makes a byte of an edge.
        """
        for count in range(1, MAX_SKIPPED_BYTES + 1):
            came = begin[count:] + self._stream.received
            if len(came) < 3 or came[0] != unit or came[1] & 0x7F != self._function:
                continue
            more = count + _frame_length(came) - len(begin)
            try:
                # all of it may have been taken for a longer frame: then there is nothing to wait for
                frame = begin[count:] + (self._stream.receive_rest(begin, more) if more > 0 else b"")
            except LineFault as missing:
                if missing.quality is Quality.LINE_LOST:
                    raise
                continue
            if crc16(frame):
                begin = begin[:count] + frame
            elif count <= self._skip_bytes:
                return frame
            else:
                bytes_text = "one byte" if count == 1 else f"{count} bytes"
                hint = f"{bytes_text} before the reply ({begin[:count].hex(' ')}); the rest fits"
                raise LineFault(fault.quality, f"{hint}: write `skip_bytes: {count}` on the line") from fault
        raise fault
