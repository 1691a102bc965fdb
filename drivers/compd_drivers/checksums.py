"""Checksums of serial protocols, by the names that manuals give them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import reduce
from typing import Literal, NamedTuple

ChecksumKind = Literal["sum8", "negative_sum8", "xor8", "crc8", "crc16_modbus"]


class Checksum(NamedTuple):
    """`length` bytes on the wire, low byte first, of `value(data)`."""

    length: int
    value: Callable[[bytes], int]

    def of(self, data: bytes) -> bytes:
        """The checksum as the wire carries it."""
        return self.value(data).to_bytes(self.length, "little")


def _crc8(data: bytes) -> int:
    """CRC-8, polynomial 0x07 from 0 (SMBus 3.1, 6.4.1.2)."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ 0x07) & 0xFF if crc & 0x80 else crc << 1
    return crc


def _crc16_modbus(data: bytes) -> int:
    """CRC-16, polynomial 0xA001 reflected from 0xFFFF (Modbus over Serial Line V1.02, 6.2.2)."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return crc


CHECKSUMS: Mapping[ChecksumKind, Checksum] = {
    "sum8": Checksum(1, lambda data: sum(data) % 256),
    "negative_sum8": Checksum(1, lambda data: -sum(data) % 256),  # data and checksum add up to 0
    "xor8": Checksum(1, lambda data: reduce(lambda a, b: a ^ b, data, 0)),
    "crc8": Checksum(1, _crc8),
    "crc16_modbus": Checksum(2, _crc16_modbus),
}
