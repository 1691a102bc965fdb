"""Modbus TCP: frames and messages by pymodbus, over a connection that outlives a missed reply.

Behind a gateway a unit that does not answer is usual, and the gateway is busy while it waits for it. So a timeout does
not close the connection: a late reply is recognised by its transaction number and discarded, and the requests that are
behind it are answered in turn. The connection is closed where nothing has come for long, and where what came is no
frame: nothing that follows could be read.

Source: Modbus Messaging on TCP/IP Implementation Guide V1.0b (transaction numbers, 3.1.3 and 4.2).
"""

from __future__ import annotations

import logging
import math
import struct
import threading
from collections.abc import Mapping, Sequence

from pymodbus.exceptions import ModbusException
from pymodbus.framer import FramerSocket
from pymodbus.pdu import DecodePDU, ExceptionResponse, ModbusPDU
from pymodbus.pdu.bit_message import ReadCoilsRequest, ReadDiscreteInputsRequest, WriteSingleCoilRequest
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)

from compd.clock import Clock
from compd.gauge import LineFault, Quality, RegisterReply
from compd.lines.modbus_serial import WRITE_COIL, WRITE_REGISTER, WRITE_REGISTERS, exception_fault
from compd.lines.port import NetworkPort
from compd.lines.ports import PORTS, Ports
from compd.lines.usual_time import UsualWait

# Every fault becomes a LineFault and reaches STATUS; pymodbus would log each one, and each late reply, as well.
logging.getLogger("pymodbus").addHandler(logging.NullHandler())
logging.getLogger("pymodbus").propagate = False

LAST_TRANSACTION = 0xFFFF
# Longest silence (s) of a connection beyond the gateway's wait; it is then closed, since a device may have forgotten
# it. Above the waits of a slow gateway for two units (usually 1 to 2 s each).
MAX_SILENCE_S = 5.0


class ModbusTcp:
    """A `RegisterLine` over Modbus TCP. Used by one thread."""

    last_request_s = -math.inf  # not noted: a reply names its request
    unexpected_bytes = 0  # late replies are discarded by their transaction number, uncounted
    request_came_back = False  # TCP has no echo

    def __init__(
        self,
        host: str,
        port: int,
        timeout_s: float,
        clock: Clock,
        pause_s: float = 0.0,
        gateway_wait_s: float | None = None,
        ports: Ports = PORTS,
    ) -> None:
        """Connect within `timeout_s`. `pause_s`: from a reply to the next request, s.

        gateway_wait_s : how long a gateway waits for a unit that does not answer, s: as much later the reply to the
            next request may come. None: `timeout_s`.

        Raises LineFault (LINE_LOST) when the device cannot be reached.
        """
        self._address = (host, port)
        self._ports = ports
        self._timeout_s = timeout_s
        self._reply = UsualWait(timeout_s)
        self._gateway_wait_s = timeout_s if gateway_wait_s is None else gateway_wait_s
        self._clock = clock
        self._pause_s = pause_s
        self._last_reply_s = -math.inf
        self._no_event = threading.Event()  # never set: the clock waits for it to pause
        self._framer = FramerSocket(DecodePDU(is_server=False))
        self._transaction = 0
        self._received = bytearray()
        self._unanswered = 0  # requests since the last reply
        self._busy_until_s = -math.inf  # until then the gateway may wait for a unit that was asked before
        self._last_bytes_s = -math.inf
        self._port: NetworkPort | None = self._connect()

    @property
    def peer(self) -> str:
        """Address and port of the device; "" if the connection is closed."""
        return "" if self._port is None else self._port.peer

    def read_registers(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        """`count` registers from `address` of slave `unit` by function 3 or 4.

        Raises LineFault: TIMEOUT, MISMATCH, DEVICE_ERROR (with the exception's name), LINE_LOST.
        """
        message = ReadHoldingRegistersRequest if function == 3 else ReadInputRegistersRequest
        time_s, reply = self._exchange(message(address=address, count=count, dev_id=unit))
        if len(reply.registers) != count:
            raise self._closed(Quality.MISMATCH, f"asked {count} registers, got {len(reply.registers)}")
        return RegisterReply(tuple(reply.registers), time_s)

    def read_bits(self, unit: int, function: int, address: int, count: int) -> RegisterReply:
        """`count` bits from `address` of slave `unit` by function 1 or 2. Raises LineFault as `read_registers` does."""
        message = ReadCoilsRequest if function == 1 else ReadDiscreteInputsRequest
        time_s, reply = self._exchange(message(address=address, count=count, dev_id=unit))
        if len(reply.bits) != 8 * -(-count // 8):  # whole bytes
            raise self._closed(Quality.MISMATCH, f"asked {count} bits, got {len(reply.bits)}")
        return RegisterReply(tuple(map(int, reply.bits[:count])), time_s)

    def write(self, unit: int, function: int, address: int, values: Sequence[int], settle_s: float = 0.0) -> float:
        """Write by function 5, 6 or 16; see `RegisterLine`. Over TCP unit 0 is a device like any other.

        Raises LineFault as `read_registers` does.
        """
        first = values[0]
        messages: Mapping[int, ModbusPDU] = {
            WRITE_COIL: WriteSingleCoilRequest(address=address, bits=[bool(first)], dev_id=unit),
            WRITE_REGISTER: WriteSingleRegisterRequest(address=address, registers=[first], dev_id=unit),
            WRITE_REGISTERS: WriteMultipleRegistersRequest(address=address, registers=list(values), dev_id=unit),
        }
        time_s, reply = self._exchange(messages[function])
        confirmed = {
            WRITE_COIL: list(map(int, reply.bits[:1])) == [int(bool(first))],
            WRITE_REGISTER: list(reply.registers) == [first],
            WRITE_REGISTERS: reply.count == len(values),
        }
        if reply.address != address or not confirmed[function]:
            raise self._closed(Quality.MISMATCH, f"wrote {list(values)} to {address}, something else was confirmed")
        self._wait_until(time_s + settle_s)
        return time_s

    def drain(self, quiet_s: float | None = None) -> bytes:
        """Nothing: a late reply has another transaction number."""
        return b""

    def close(self) -> None:
        """Close the connection."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _wait_until(self, time_s: float) -> None:
        rest_s = time_s - self._clock.monotonic()
        if rest_s > 0:
            self._clock.wait(self._no_event, rest_s)

    def _connect(self) -> NetworkPort:
        """A new connection, in which nothing of an old reply can be left. Raises LineFault (LINE_LOST)."""
        port = self._ports.tcp(*self._address, self._timeout_s)
        self._received.clear()
        self._unanswered = 0
        self._busy_until_s = -math.inf
        self._last_bytes_s = self._clock.monotonic()
        return port

    def _exchange(self, request: ModbusPDU) -> tuple[float, ModbusPDU]:
        """One exchange: its time, s, and a reply of the same function. Raises LineFault for any other."""
        if self._port is None:
            self._port = self._connect()
        self._wait_until(self._last_reply_s + self._pause_s)
        self._transaction = self._transaction % LAST_TRANSACTION + 1
        request.transaction_id = self._transaction
        time_s = self._clock.monotonic()
        try:
            self._port.write(self._framer.buildFrame(request))
            reply = self._receive(self._port, request, time_s)
        except LineFault as fault:
            if fault.quality is Quality.LINE_LOST:
                self.close()
            raise
        except (ModbusException, struct.error, IndexError, ValueError) as error:
            raise self._closed(Quality.MISMATCH, f"not to be decoded: {error}") from error
        self._last_reply_s = self._clock.monotonic()
        self._unanswered, self._busy_until_s = 0, -math.inf
        if self._received:
            self.close()  # unsolicited bytes behind the reply to the last request
        if isinstance(reply, ExceptionResponse):
            raise exception_fault(reply.exception_code)
        if reply.function_code != request.function_code:
            raise self._closed(Quality.MISMATCH, f"asked function {request.function_code}, got {reply.function_code}")
        return time_s, reply

    def _receive(self, port: NetworkPort, request: ModbusPDU, time_s: float) -> ModbusPDU:
        """The reply to the request that was made at `time_s` (s). Raises LineFault, and what pymodbus raises.

        A late reply to an earlier request shows that the gateway has come to the next: the timeout begins anew.
        """
        wait_s = self._reply.wait_s if self._busy_until_s <= time_s else self._timeout_s
        until_s = max(time_s, self._busy_until_s) + wait_s
        late = 0
        while data := port.read(until_s - self._clock.monotonic()):
            self._last_bytes_s = self._clock.monotonic()
            self._received += data
            used, reply = self._framer.handleFrame(bytes(self._received), request.dev_id, request.transaction_id)
            del self._received[:used]
            if reply is not None:
                self._reply.took(self._last_bytes_s - time_s)
                return reply
            if used and late < self._unanswered:
                late += 1
                self._reply.came_late()
                until_s = max(until_s, self._last_bytes_s + self._timeout_s)
        self._reply.missed()
        now_s = self._clock.monotonic()
        self._unanswered += 1
        self._busy_until_s = max(self._busy_until_s, time_s) + self._gateway_wait_s
        if self._received or now_s - self._last_bytes_s > MAX_SILENCE_S + self._gateway_wait_s:
            self.close()
        raise LineFault(Quality.TIMEOUT, f"no answer to this request within {until_s - time_s:.3g} s")

    def _closed(self, quality: Quality, detail: str) -> LineFault:
        """Close the connection, and make the fault to raise."""
        self.close()
        return LineFault(quality, detail)
