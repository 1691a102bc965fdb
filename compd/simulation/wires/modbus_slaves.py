"""Modbus slaves behind one wire: requests in, replies out, in RTU or TCP framing.

Framing is done by pymodbus, so that compd's own RTU master is tested against an independent implementation.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from pymodbus.framer.rtu import FramerRTU
from pymodbus.framer.socket import FramerSocket
from pymodbus.pdu import DecodePDU, ExceptionResponse, ModbusPDU
from pymodbus.pdu.register_message import ReadHoldingRegistersResponse, ReadInputRegistersResponse

from compd.simulation.wires.device import SimulatedRegisterDevice

READ_HOLDING, READ_INPUT = 3, 4
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS = 1, 2
RTU_REQUEST = 8  # unit, function, address, count, CRC
MBAP = struct.Struct(">HHH")  # transaction, protocol, length of what follows


class ModbusSlaves:
    """The slaves on one wire, by unit number; requests to an absent unit get no reply."""

    def __init__(self, devices: Sequence[SimulatedRegisterDevice], over_tcp: bool) -> None:
        """over_tcp : Modbus TCP framing (MBAP) instead of RTU."""
        self._devices = {device.unit: device for device in devices}
        self._over_tcp = over_tcp
        self._framer = FramerSocket(DecodePDU(True)) if over_tcp else FramerRTU(DecodePDU(True))
        self._received = b""

    def hear(self, data: bytes) -> bytes:
        """Receive bytes, in pieces of any size; returns the replies to complete requests."""
        self._received += data
        replies = b""
        while request := self._next():
            replies += self._answer(request)
        return replies

    def _next(self) -> bytes:
        """Take the next complete request from the received bytes; b"" if there is none yet."""
        if self._over_tcp:
            length = MBAP.size
            if len(self._received) >= length:
                _, protocol, rest = MBAP.unpack_from(self._received)
                if protocol != 0:  # not Modbus: a device discards it
                    self._received = b""
                length += rest
        else:
            length = RTU_REQUEST
            while len(self._received) >= length and not _crc_matches(self._received[:length]):
                self._received = self._received[1:]  # noise before a frame
        if len(self._received) < length:
            return b""
        request, self._received = self._received[:length], self._received[length:]
        return request

    def _answer(self, request: bytes) -> bytes:
        """The reply to one complete frame; b"" for an absent unit."""
        if self._over_tcp:
            transaction, unit, message = MBAP.unpack_from(request)[0], request[6], request[7:]
        else:
            transaction, unit, message = 0, request[0], request[1:-2]
        device = self._devices.get(unit)
        if device is None:
            return b""
        reply = _reply(device, message)
        reply.dev_id, reply.transaction_id = unit, transaction
        return self._framer.buildFrame(reply)


def _crc_matches(frame: bytes) -> bool:
    return FramerRTU.check_CRC(frame[:-2], int.from_bytes(frame[-2:], "big"))


def _reply(device: SimulatedRegisterDevice, message: bytes) -> ModbusPDU:
    function = message[0]
    if function not in (READ_HOLDING, READ_INPUT) or len(message) != 5:
        return ExceptionResponse(function, ILLEGAL_FUNCTION)
    address, count = struct.unpack(">HH", message[1:])
    registers = device.registers(function, address, count)
    if registers is None:
        return ExceptionResponse(function, ILLEGAL_ADDRESS)
    kind = ReadHoldingRegistersResponse if function == READ_HOLDING else ReadInputRegistersResponse
    return kind(registers=registers)
