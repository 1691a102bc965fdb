"""A Modbus RTU master that reads registers and knows the exact length of every reply.

Source: Modbus over Serial Line V1.02 (frame, CRC, 3.5 characters of silence), Modbus Application Protocol V1.1b3
(functions 3 and 4, exceptions).

RTU has no transaction number, so a late reply looks like the answer to the next request. Therefore every second request
asks for one register more than needed: a reply to the request before has the wrong length. A slave whose registers end
there refuses the extra one (exception 2) and is not asked for it again.
"""

from __future__ import annotations

import struct

from compd.gauge import LineFault, Quality, RegisterReply
from compd.lines.stream import StreamLine, shown

# Modbus Application Protocol V1.1b3, chapter 7
EXCEPTIONS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "slave device failure",
    5: "acknowledge",
    6: "slave device busy",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "gateway target device failed to respond",
}
ILLEGAL_DATA_ADDRESS = 2
MOST_REGISTERS = 125  # of one reply, functions 3 and 4
SHORTEST_FRAME = 5  # unit, function, exception or byte count, CRC


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


class RtuMaster:
    """A `RegisterLine` over a stream of bytes: a serial port, or RTU over TCP. Used by one thread."""

    def __init__(self, stream: StreamLine, alternate: bool = True) -> None:
        """`alternate`: ask for one register more every second time, where the slave has it."""
        self._stream = stream
        self._alternate = alternate
        self._extended = False
        self._not_extensible: set[tuple[int, int, int, int]] = set()  # requests whose extra register was refused

    def read_registers(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        """`count` registers from `address` of slave `unit` by function 3 or 4.

        Raises LineFault: TIMEOUT, INCOMPLETE, CRC, MISMATCH (a whole reply to another request), DEVICE_ERROR (with the
        exception's name), LINE_LOST.
        """
        block = (unit, function, address, count)
        self._extended = not self._extended
        if self._extended and self._may_extend(block):
            time_s, code, registers = self._transact(unit, function, address, count + 1)
            if code == 0:
                return RegisterReply(registers[:count], time_s)
            if code == ILLEGAL_DATA_ADDRESS:
                self._not_extensible.add(block)
        time_s, code, registers = self._transact(unit, function, address, count)
        if code:
            raise LineFault(Quality.DEVICE_ERROR, f"exception {code}, {EXCEPTIONS.get(code, 'unknown')}")
        return RegisterReply(registers, time_s)

    def drain(self, quiet_s: float | None = None) -> bytes:
        """Wait until nothing has come for `quiet_s`, the line's timeout if None; what came."""
        return self._stream.drain(quiet_s)

    def close(self) -> None:
        """Close the port."""
        self._stream.close()

    @property
    def last_request_s(self) -> float:
        """Monotonic time of the last request, s; -inf before the first."""
        return self._stream.last_request_s

    @property
    def unexpected_bytes(self) -> int:
        """Bytes that came without a request."""
        return self._stream.unexpected_bytes

    def _may_extend(self, block: tuple[int, int, int, int]) -> bool:
        """Whether one register more may be asked for: within the protocol's limits, and not yet refused."""
        _, _, address, count = block
        return (
            self._alternate
            and count < MOST_REGISTERS
            and address + count < 0x10000
            and block not in self._not_extensible
        )

    def _transact(self, unit: int, function: int, address: int, count: int) -> tuple[float, int, tuple[int, ...]]:
        """One request and its reply: the time of asking (s), the exception code or 0, and the registers."""
        request = struct.pack(">BBHH", unit, function, address, count)
        time_s = self._stream.send(request + crc16(request).to_bytes(2, "little"))
        frame = self._stream.receive(SHORTEST_FRAME)
        refused = bool(frame[1] & 0x80)
        if not refused:
            frame += self._receive_rest(frame)
        if crc16(frame):
            raise LineFault(Quality.CRC, shown(frame))
        if frame[0] != unit:
            raise LineFault(Quality.MISMATCH, f"asked unit {unit}, unit {frame[0]} answered")
        if frame[1] & 0x7F != function:
            raise LineFault(Quality.MISMATCH, f"asked function {function}, got {frame[1]}")
        if refused:
            return time_s, frame[2], ()
        if frame[2] != 2 * count:
            raise LineFault(Quality.MISMATCH, f"asked {2 * count} bytes, got {frame[2]}: an answer to another request")
        return time_s, 0, struct.unpack_from(f">{count}H", frame, 3)

    def _receive_rest(self, head: bytes) -> bytes:
        """The bytes that follow the shortest frame `head`, as many as its byte count says."""
        try:
            return self._stream.receive(head[2])
        except LineFault as fault:
            if fault.quality is not Quality.TIMEOUT:
                raise
            raise LineFault(Quality.INCOMPLETE, f"only {len(head)} bytes: {shown(head)}") from fault
