"""A Modbus master on a serial line, whatever its framing: requests, replies of exact length, and exceptions.

Source: Modbus Application Protocol V1.1b3 (functions 3 and 4, exceptions).

A serial line has no transaction numbers, so a late reply looks like the answer to the next request. Therefore a request
that is as long as the last one to the same slave asks for one register more than needed: a reply to the one before has
the wrong length. Slaves differ in what they do where their registers end: they refuse the extra one by an exception, by
silence, or by a shorter reply. One that does so to the first such request, and then answers the plain one, is not asked
for it again.
"""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod

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
MOST_REGISTERS = 125  # of one reply, functions 3 and 4
# What a slave may do about a register that it does not have; damage on the wire says nothing about it.
REFUSALS = (Quality.DEVICE_ERROR, Quality.TIMEOUT, Quality.MISMATCH)

# Unit, function, first address, count.
Block = tuple[int, int, int, int]


def exception_fault(code: int) -> LineFault:
    """The fault for a slave's exception, with its name."""
    return LineFault(Quality.DEVICE_ERROR, f"exception {code}, {EXCEPTIONS.get(code, 'unknown')}")


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
        block = (unit, function, address, count)
        if self._last_count.get((unit, function)) == count and self._may_extend(block):
            try:
                reply = self._registers(unit, function, address, count + 1)
            except LineFault as fault:
                if fault.quality in REFUSALS and block not in self._extensible:
                    self._suspected[block] = self.unexpected_bytes
                if fault.quality is not Quality.DEVICE_ERROR:  # a reply may be under way still
                    raise
            else:
                self._extensible.add(block)
                self._suspected.pop(block, None)
                return RegisterReply(reply.registers[:count], reply.time_s)
        reply = self._registers(unit, function, address, count)
        # a reply that came after all was late: the slave has the register
        if self._suspected.pop(block, None) == self.unexpected_bytes:
            self._not_extensible.add(block)
        return reply

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
    def _exchange(self, unit: int, message: bytes) -> tuple[float, bytes]:
        """Send one message (function and data) to `unit`: the time of asking (s), and the message of its reply.

        Raises LineFault: TIMEOUT, INCOMPLETE, CRC, MISMATCH for another unit's reply, LINE_LOST.
        """

    def _may_extend(self, block: Block) -> bool:
        """Whether one register more may be asked for: within the protocol's limits, and not yet refused."""
        _, _, address, count = block
        return (
            self._ask_one_more
            and count < MOST_REGISTERS
            and address + count < 0x10000
            and block not in self._not_extensible
        )

    def _registers(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        """The reply to one request, which must have exactly `count` registers. Raises LineFault."""
        self._last_count[unit, function] = count
        time_s, reply = self._asked(unit, struct.pack(">BHH", function, address, count))
        if reply[1] != 2 * count:
            raise LineFault(Quality.MISMATCH, f"asked {2 * count} bytes, got {reply[1]}: an answer to another request")
        return RegisterReply(struct.unpack_from(f">{count}H", reply, 2), time_s)

    def _asked(self, unit: int, message: bytes) -> tuple[float, bytes]:
        """`_exchange`, for a reply of the same function. Raises LineFault, DEVICE_ERROR for the slave's exception."""
        function = message[0]
        time_s, reply = self._exchange(unit, message)
        if reply[0] & 0x7F != function:
            raise LineFault(Quality.MISMATCH, f"asked function {function}, got {reply[0]}")
        if reply[0] & 0x80:
            raise exception_fault(reply[1])
        return time_s, reply
