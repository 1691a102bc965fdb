"""What devices of the shipped tripod send: whole requests, whole replies, the numbers in them.

Written from the protocols and without compd's own parsers: a number that is changed here comes with a checksum that
fits, so that nothing but the number is wrong.
"""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

Values = dict[str, float]  # by channel: mm, degC
MBAP_BYTES = 6  # transaction, protocol, length
READ_REPLY_HEAD = 3  # unit, function, count of bytes
CRC_BYTES = 2
EXCEPTION = 0x80


class Protocol(ABC):
    """One line's protocol. channels : names of the numbers in its replies."""

    channels: tuple[str, ...]

    @abstractmethod
    def request_length(self, data: bytes) -> int:
        """Bytes of the first whole request in `data`; 0 while it is not whole."""

    @abstractmethod
    def reply_length(self, data: bytes) -> int:
        """Bytes of the first whole reply in `data`; 0 while it is not whole."""

    @abstractmethod
    def values(self, request: bytes, reply: bytes) -> Values:
        """The numbers in a whole reply, by channel; empty for an error message."""

    @abstractmethod
    def with_values(self, request: bytes, reply: bytes, values: Mapping[str, float]) -> bytes:
        """The reply with these numbers in place of its own, and with a checksum that fits."""


class Display(Protocol):
    """A scale display: STX is answered by a sign, ten characters, a space, three characters, CR and LF."""

    channels = ("position",)

    def request_length(self, data: bytes) -> int:
        return 1 if data else 0

    def reply_length(self, data: bytes) -> int:
        return data.find(b"\r\n") + 2 if b"\r\n" in data else 0

    def values(self, request: bytes, reply: bytes) -> Values:
        return {"position": float(reply[:11].replace(b" ", b""))}

    def with_values(self, request: bytes, reply: bytes, values: Mapping[str, float]) -> bytes:
        mm = values["position"]
        return f"{'-' if mm < 0 else '+'}{abs(mm):10.4f}".encode() + reply[11:]


class HeadsUnit(Protocol):
    """A unit with comparator heads: a command, answered by the command and a number of nine characters per head."""

    def __init__(self, heads: int) -> None:
        self.channels = tuple(str(head + 1) for head in range(heads))

    def request_length(self, data: bytes) -> int:
        return data.find(b"\r\n") + 2 if b"\r\n" in data else 0

    def reply_length(self, data: bytes) -> int:
        return self.request_length(data)

    def values(self, request: bytes, reply: bytes) -> Values:
        command, *fields = reply.decode().strip().split(",")
        return {} if command == "ER" else dict(zip(self.channels, map(float, fields), strict=True))

    def with_values(self, request: bytes, reply: bytes, values: Mapping[str, float]) -> bytes:
        if not self.values(request, reply):
            return reply
        fields = [f"{values[channel]:+09.4f}" for channel in self.channels]
        return ",".join([reply.decode().partition(",")[0], *fields]).encode() + b"\r\n"


class Registers(Protocol):
    """A Modbus slave, RTU or TCP: float32 or scaled int16 in the registers of its map."""

    def __init__(self, channels: list[Mapping[str, Any]], over_tcp: bool) -> None:
        """channels : of the gauge, as in the configuration."""
        self._map = {channel["name"]: channel for channel in channels}
        self._over_tcp = over_tcp
        self._head = MBAP_BYTES if over_tcp else 0
        self.channels = tuple(self._map)

    def request_length(self, data: bytes) -> int:
        if self._over_tcp:
            return self._tcp_length(data)
        return 8 if len(data) >= 8 else 0

    def reply_length(self, data: bytes) -> int:
        if self._over_tcp:
            return self._tcp_length(data)
        if len(data) < READ_REPLY_HEAD:
            return 0
        length = 5 if data[1] & EXCEPTION else READ_REPLY_HEAD + data[2] + CRC_BYTES
        return length if len(data) >= length else 0

    def values(self, request: bytes, reply: bytes) -> Values:
        return {name: self._read(reply, offset, self._map[name]) for name, offset in self._places(request, reply)}

    def with_values(self, request: bytes, reply: bytes, values: Mapping[str, float]) -> bytes:
        data = bytearray(reply)
        for name, offset in self._places(request, reply):
            channel = self._map[name]
            if channel["type"] == "float32":
                struct.pack_into(">f", data, offset, values[name])
            else:
                struct.pack_into(">h", data, offset, round(values[name] / channel["scale"]))
        if not self._over_tcp:
            data[-CRC_BYTES:] = crc16(bytes(data[:-CRC_BYTES]))
        return bytes(data)

    def _tcp_length(self, data: bytes) -> int:
        if len(data) < MBAP_BYTES:
            return 0
        length = MBAP_BYTES + int.from_bytes(data[4:6], "big")
        return length if len(data) >= length else 0

    def _places(self, request: bytes, reply: bytes) -> list[tuple[str, int]]:
        """Channel and offset in the reply of each number in it."""
        head = self._head
        if reply[head + 1] & EXCEPTION:
            return []
        address, count = struct.unpack_from(">HH", request, head + 2)
        places = []
        for name, channel in self._map.items():
            first = channel["address"] - address
            words = 2 if channel["type"] == "float32" else 1
            if first >= 0 and first + words <= count:
                places.append((name, head + READ_REPLY_HEAD + 2 * first))
        return places

    @staticmethod
    def _read(reply: bytes, offset: int, channel: Mapping[str, Any]) -> float:
        if channel["type"] == "float32":
            return float(struct.unpack_from(">f", reply, offset)[0])
        return float(struct.unpack_from(">h", reply, offset)[0] * channel["scale"])


def crc16(data: bytes) -> bytes:
    """The CRC of Modbus RTU, low byte first, bit by bit as its specification describes it."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return crc.to_bytes(2, "little")


def protocol_of(line: str, configuration: Mapping[str, Any]) -> Protocol:
    """The protocol of a line with one gauge on it, from a configuration document."""
    gauge = next(gauge for gauge in configuration["gauges"].values() if gauge["line"] == line)
    match gauge["driver"]:
        case "heidenhain_nd28x":
            return Display()
        case "keyence_gt2_dlrs1a":
            return HeadsUnit(gauge["heads"])
        case "modbus":
            return Registers(gauge["channels"], over_tcp=configuration["lines"][line]["kind"] == "modbus_tcp")
    raise ValueError(f"the injector does not know the replies of {gauge['driver']}")
