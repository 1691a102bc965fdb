"""A Modbus master on a serial line, whatever its framing: requests, replies of exact length, and exceptions.

Source: Modbus Application Protocol V1.1b3 (functions 1 to 6 and 16, exceptions).

A serial line has no transaction numbers, so a late reply looks like the answer to the next request. Therefore a request
that is as long as the last one to the same slave asks for one register more than needed: a reply to the one before has
the wrong length. Slaves differ in what they do where their registers end: they refuse the extra one by an exception, by
silence, or by a shorter reply. One that does so to the first such request, and then answers the plain one, is not asked
for it again.
"""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from collections.abc import Sequence

from compd.gauge import LineFault, Quality, RegisterReply
from compd.lines.stream import StreamLine

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
READ_BITS = (1, 2)
WRITE_COIL, WRITE_REGISTER, WRITE_REGISTERS = 5, 6, 16
WRITES = (WRITE_COIL, WRITE_REGISTER, WRITE_REGISTERS)
CONFIRMED = 4  # bytes behind the function of a write's confirmation: the address, and what was written
MAX_REGISTERS, MAX_BITS = 125, 2000  # of one reply
COIL_ON = 0xFF00
BROADCAST = 0  # the unit that is all slaves of a serial line
# Qualities of a slave's answer for a missing register; damage on the wire does not count.
REFUSALS = (Quality.DEVICE_ERROR, Quality.TIMEOUT, Quality.MISMATCH)

# Unit, function, first address, count.
Block = tuple[int, int, int, int]


def exception_fault(code: int) -> LineFault:
    """The fault for a slave's exception, with its name."""
    return LineFault(Quality.DEVICE_ERROR, f"exception {code}, {EXCEPTIONS.get(code, 'unknown')}")


def write_message(function: int, address: int, values: Sequence[int]) -> bytes:
    """Function and data of a request that writes, by function 5, 6 or 16."""
    if function == WRITE_REGISTERS:
        head = struct.pack(">BHHB", function, address, len(values), 2 * len(values))
        return head + struct.pack(f">{len(values)}H", *values)
    (value,) = values
    return struct.pack(">BHH", function, address, COIL_ON * (value != 0) if function == WRITE_COIL else value)


class SerialMaster(ABC):
    """A `RegisterLine` over a stream of bytes; the framing is that of a derived class. Used by one thread."""

    def __init__(self, stream: StreamLine, ask_one_more: bool = True) -> None:
        """`ask_one_more`: ask for one register more every second time, where the slave has it."""
        self._stream = stream
        self._ask_one_more = ask_one_more
        self._last_count: dict[tuple[int, int], int] = {}  # asked for last, by unit and function
        self._extensible: set[Block] = set()  # an extra register was answered
        self._not_extensible: set[Block] = set()  # and these end before it
        self._suspected: dict[Block, int] = {}  # refused so far, with the line's unexpected bytes until then

    def read_registers(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        """`count` registers from `address` of slave `unit` by function 3 or 4.

        Raises LineFault: TIMEOUT, INCOMPLETE, CRC, MISMATCH (a whole reply to another request), DEVICE_ERROR (with the
        exception's name), LINE_LOST.
        """
        return self._read((unit, function, address, count), 1, MAX_REGISTERS)

    def read_bits(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        """`count` bits from `address` of slave `unit` by function 1 or 2. Raises LineFault as `read_registers` does."""
        return self._read((unit, function, address, count), 8, MAX_BITS)  # eight more make the reply longer

    def write(self, unit: int, function: int, address: int, values: Sequence[int], settle_s: float = 0.0) -> float:
        """Write by function 5, 6 or 16; see `RegisterLine`. Raises LineFault as `read_registers` does."""
        message = write_message(function, address, values)
        if unit == BROADCAST:
            time_s = self._send(unit, message)
        else:
            time_s, reply = self._asked(unit, message)
            # the address, and what was written or how much of it
            if reply != message[:5]:
                raise LineFault(Quality.MISMATCH, f"wrote {message[:5].hex(' ')}, {reply.hex(' ')} was confirmed")
        self._stream.rest_until(time_s + settle_s)
        return time_s

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

    @property
    def request_came_back(self) -> bool:
        """Whether the first bytes after the last request are that request: see `compd.lines.echo`."""
        return self._stream.request_came_back

    @abstractmethod
    def _send(self, unit: int, message: bytes) -> float:
        """Send one message (function and data) to `unit`; the time at which it will have left, s. Raises LineFault."""

    @abstractmethod
    def _receive(self, unit: int) -> bytes:
        """The message of the reply of `unit`.

        Raises LineFault: TIMEOUT, INCOMPLETE, CRC, MISMATCH for another unit's reply, LINE_LOST.
        """

    def _read(self, block: Block, more: int, most: int) -> RegisterReply:
        """A block, of which every second time `more` is asked for than it has, but never beyond `most`."""
        unit, function, address, count = block
        if self._last_count.get((unit, function)) == count and self._may_extend(block, more, most):
            try:
                reply = self._values(unit, function, address, count + more)
            except LineFault as fault:
                if fault.quality in REFUSALS and block not in self._extensible:
                    self._suspected[block] = self.unexpected_bytes
                if fault.quality is not Quality.DEVICE_ERROR:  # a reply may be under way still
                    raise
            else:
                self._extensible.add(block)
                self._suspected.pop(block, None)
                return RegisterReply(reply.registers[:count], reply.time_s)
        suspected = self._suspected.pop(block, None)  # for good, where this fails as well: that says nothing of the map
        reply = self._values(unit, function, address, count)
        if suspected == self.unexpected_bytes:  # else a reply came after all: it was late, the slave has the register
            self._not_extensible.add(block)
        return reply

    def _may_extend(self, block: Block, more: int, most: int) -> bool:
        """Whether more may be asked for: within the protocol's limits, and not yet refused."""
        _, _, address, count = block
        return (
            self._ask_one_more
            and count + more <= most
            and address + count + more <= 0x10000
            and block not in self._not_extensible
        )

    def _values(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        """The reply to one request, which must have exactly `count` registers or bits. Raises LineFault."""
        self._last_count[unit, function] = count
        time_s, reply = self._asked(unit, struct.pack(">BHH", function, address, count))
        length = -(-count // 8) if function in READ_BITS else 2 * count
        if reply[1] != length or len(reply) != 2 + length:
            raise LineFault(Quality.MISMATCH, f"asked {length} bytes, got {reply[1]}: an answer to another request")
        if function in READ_BITS:
            return RegisterReply(tuple(reply[2 + i // 8] >> i % 8 & 1 for i in range(count)), time_s)
        return RegisterReply(struct.unpack_from(f">{count}H", reply, 2), time_s)

    def _asked(self, unit: int, message: bytes) -> tuple[float, bytes]:
        """One exchange: its time, s, and a reply of the same function.

        Raises LineFault, DEVICE_ERROR for the slave's exception.
        """
        function = message[0]
        time_s = self._send(unit, message)
        reply = self._receive(unit)
        if reply[0] & 0x7F != function:
            raise LineFault(Quality.MISMATCH, f"asked function {function}, got {reply[0]}")
        if reply[0] & 0x80:
            raise exception_fault(reply[1])
        return time_s, reply
