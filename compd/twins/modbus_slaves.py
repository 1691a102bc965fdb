"""Modbus slaves behind one wire: requests in, replies out, in RTU, TCP or ASCII framing.

Framing is done by pymodbus, so that compd's own RTU master is tested against an independent implementation.
"""

from __future__ import annotations

import binascii
import struct
from collections.abc import Sequence
from typing import Any, Protocol

from pymodbus.framer.ascii import FramerAscii
from pymodbus.framer.rtu import FramerRTU
from pymodbus.framer.socket import FramerSocket
from pymodbus.pdu import DecodePDU, ExceptionResponse, ModbusPDU
from pymodbus.pdu.bit_message import ReadCoilsResponse, ReadDiscreteInputsResponse, WriteSingleCoilResponse
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersResponse,
    ReadInputRegistersResponse,
    WriteMultipleRegistersResponse,
    WriteSingleRegisterResponse,
)

from compd.twins.device import SimulatedRegisterDevice
from compd.twins.latch import Latch

READ_COILS, READ_HOLDING, WRITE_REGISTERS = 1, 3, 16
COIL_ON = 0xFF00
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS = 1, 2
RTU_REQUEST = 8  # unit, function, address, count or value, CRC
RTU_WRITE = 9  # unit, function, address, count, byte count, CRC; and the registers
MBAP = struct.Struct(">HHH")  # transaction, protocol, length of what follows


class LatchingWrite(Protocol):
    """The write of a round trigger: to the coil or register `address` of `unit`, by `function`."""

    @property
    def unit(self) -> int: ...
    @property
    def function(self) -> int: ...
    @property
    def address(self) -> int: ...


class ModbusSlaves:
    """The slaves on one wire, by unit number; requests to an absent unit get no reply."""

    def __init__(
        self,
        devices: Sequence[SimulatedRegisterDevice],
        over_tcp: bool = False,
        as_text: bool = False,
        trigger: LatchingWrite | None = None,
        latch: Latch | None = None,
    ) -> None:
        """over_tcp : Modbus TCP framing (MBAP) instead of RTU. as_text : ASCII framing instead.

        trigger : the write by which the devices latch what they sense, in `latch`.
        """
        self._trigger = trigger
        self._latch = latch
        self._devices = {device.unit: device for device in devices}
        self._over_tcp = over_tcp
        self._as_text = as_text
        self._framer = (FramerAscii if as_text else FramerSocket if over_tcp else FramerRTU)(DecodePDU(True))
        self._received = b""

    def receive(self, data: bytes) -> bytes:
        """Receive bytes, in pieces of any size; returns the replies to complete requests."""
        self._received += data
        replies = b""
        while request := self._next():
            replies += self._answer(request)
        return replies

    def _next(self) -> bytes:
        """Take the next complete request from the received bytes; b"" if there is none yet."""
        if self._as_text:
            text, end, rest = self._received.partition(b"\r\n")
            if not end:
                return b""
            self._received = rest
            return text[text.rfind(b":") :]
        if self._over_tcp:
            length = MBAP.size
            if len(self._received) >= length:
                _, protocol, rest = MBAP.unpack_from(self._received)
                if protocol != 0:  # not Modbus: a device discards it
                    self._received = b""
                length += rest
        else:
            length = self._rtu_length()
            while len(self._received) >= length and not _crc_matches(self._received[:length]):
                self._received = self._received[1:]  # noise before a frame
                length = self._rtu_length()
        if len(self._received) < length:
            return b""
        request, self._received = self._received[:length], self._received[length:]
        return request

    def _rtu_length(self) -> int:
        """Length of the RTU request at the beginning of what was received."""
        if len(self._received) < RTU_REQUEST or self._received[1] != WRITE_REGISTERS:
            return RTU_REQUEST
        count, byte_count = struct.unpack_from(">HB", self._received, 4)
        return RTU_WRITE + byte_count if byte_count == 2 * count else RTU_REQUEST

    def _answer(self, request: bytes) -> bytes:
        """The reply to one complete frame; b"" for an absent unit."""
        if self._as_text:
            frame = _unit_and_message(request)
            if not frame:
                return b""
            transaction, unit, message = 0, frame[0], frame[1:]
        elif self._over_tcp:
            transaction, unit, message = MBAP.unpack_from(request)[0], request[6], request[7:]
        else:
            transaction, unit, message = 0, request[0], request[1:-2]
        latched = self._is_trigger(unit, message)
        if latched and self._latch is not None:
            self._latch.close()
        if unit == 0 and not self._over_tcp:  # a broadcast, which has no reply
            for each in self._devices.values():
                _reply(each, message)
            return b""
        device = self._devices.get(unit)
        if device is None and not latched:
            return b""
        reply = _reply(device, message, latched)
        reply.dev_id, reply.transaction_id = unit, transaction
        return self._framer.buildFrame(reply)

    def _is_trigger(self, unit: int, message: bytes) -> bool:
        trigger = self._trigger
        if trigger is None or unit != trigger.unit or len(message) < 5:
            return False
        return (message[0], int.from_bytes(message[1:3], "big")) == (trigger.function, trigger.address)


def register_listener(
    settings: Any,
    devices: Sequence[SimulatedRegisterDevice],
    over_tcp: bool = False,
    as_text: bool = False,
) -> ModbusSlaves:
    """The slaves, latched by the write `settings.round_trigger` where that is not None; else as of `ModbusSlaves`."""
    trigger = settings.round_trigger
    return ModbusSlaves(devices, over_tcp, as_text, trigger, None if trigger is None else Latch(devices))


def _unit_and_message(text: bytes) -> bytes:
    """The bytes of an ASCII frame without its LRC; b"" for anything else, which a slave ignores."""
    try:
        frame = binascii.unhexlify(text.removeprefix(b":"))
    except binascii.Error:
        return b""
    return frame[:-1] if len(frame) > 2 and FramerAscii.check_LRC(frame[:-1], frame[-1]) else b""


def _crc_matches(frame: bytes) -> bool:
    return FramerRTU.check_CRC(frame[:-2], int.from_bytes(frame[-2:], "big"))


def _reply(device: SimulatedRegisterDevice | None, message: bytes, latched: bool = False) -> ModbusPDU:
    """The reply to a request; `latched`: it is the round trigger, which every register accepts."""
    function = message[0]
    if len(message) < 5:
        return ExceptionResponse(function, ILLEGAL_FUNCTION)
    address, count = struct.unpack_from(">HH", message, 1)
    match function:
        case 1 | 2 if len(message) == 5 and device is not None:
            bits = device.bits(function, address, count)
            kind = ReadCoilsResponse if function == READ_COILS else ReadDiscreteInputsResponse
            return ExceptionResponse(function, ILLEGAL_ADDRESS) if bits is None else kind(bits=bits)
        case 3 | 4 if len(message) == 5 and device is not None:
            registers = device.registers(function, address, count)
            holding = ReadHoldingRegistersResponse if function == READ_HOLDING else ReadInputRegistersResponse
            return ExceptionResponse(function, ILLEGAL_ADDRESS) if registers is None else holding(registers=registers)
        case 5 if len(message) == 5:
            values: tuple[int, ...] = (int(count == COIL_ON),)
            written: ModbusPDU = WriteSingleCoilResponse(address=address, bits=[bool(values[0])])
        case 6 if len(message) == 5:
            values = (count,)
            written = WriteSingleRegisterResponse(address=address, registers=[count])
        case 16 if len(message) == 6 + 2 * count:
            values = struct.unpack_from(f">{count}H", message, 6)
            written = WriteMultipleRegistersResponse(address=address, count=count)
        case _:
            return ExceptionResponse(function, ILLEGAL_FUNCTION)
    taken = latched or (device is not None and device.write(function, address, values))
    return written if taken else ExceptionResponse(function, ILLEGAL_ADDRESS)
