"""Checksums of serial protocols, by the names that manuals give them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Literal, NamedTuple

ChecksumKind = Literal[
    "sum8", "negative_sum8", "xor8", "crc8", "crc16_modbus", "sum16", "crc_ccitt", "crc_xmodem", "modbus_lrc", "sum100"
]


class Checksum(NamedTuple):
    """`value(data)` in `length` bytes, of which a text has the low one first, but for `high_first`.

    decimals : digits that it takes in decimal.
    """

    length: int
    value: Callable[[bytes], int]
    high_first: bool = False
    decimals: int = 3

    def of(self, data: bytes) -> bytes:
        """The checksum, low byte first."""
        return self.value(data).to_bytes(self.length, "little")

    def on_the_wire(self, data: bytes) -> bytes:
        """The checksum as bytes, in the usual order of its kind."""
        return self.of(data)[::-1] if self.high_first else self.of(data)

    def hexadecimal(self, data: bytes) -> bytes:
        """The checksum as hexadecimal digits."""
        return self.of(data)[::-1].hex().upper().encode()

    def decimal(self, data: bytes) -> bytes:
        """The checksum as decimal digits, with leading zeros."""
        return f"{self.value(data):0{self.decimals}}".encode()


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


def _crc16_ccitt(data: bytes, start: int) -> int:
    """CRC-16, polynomial 0x1021, high bit first (ITU-T V.41); from 0 it is XMODEM's, from 0xFFFF "CCITT-FALSE"."""
    crc = start
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021) & 0xFFFF if crc & 0x8000 else crc << 1
    return crc


def _modbus_lrc(data: bytes) -> int:
    """Two's complement of the sum of what hexadecimal digits stand for (Modbus over Serial Line V1.02, 6.2.1).

    ValueError for other characters.
    """
    return -sum(bytes.fromhex(data.decode("ascii"))) % 256


CHECKSUMS: Mapping[ChecksumKind, Checksum] = {
    "sum8": Checksum(1, lambda data: sum(data) % 256),
    "negative_sum8": Checksum(1, lambda data: -sum(data) % 256),  # data and checksum add up to 0
    "xor8": Checksum(1, lambda data: reduce(lambda a, b: a ^ b, data, 0)),
    "crc8": Checksum(1, _crc8),
    "crc16_modbus": Checksum(2, _crc16_modbus, decimals=5),
    "sum16": Checksum(2, lambda data: sum(data) % 0x10000, high_first=True, decimals=5),
    "crc_ccitt": Checksum(2, lambda data: _crc16_ccitt(data, 0xFFFF), high_first=True, decimals=5),
    "crc_xmodem": Checksum(2, lambda data: _crc16_ccitt(data, 0), high_first=True, decimals=5),
    "modbus_lrc": Checksum(1, _modbus_lrc),
    "sum100": Checksum(1, lambda data: sum(data) % 100, decimals=2),  # two decimal digits
}


@dataclass(frozen=True)
class ChecksumField:
    """A checksum in the reply: of the bytes from `start` up to `behind` bytes before its group `group`."""

    group: str
    kind: ChecksumKind
    start: int
    behind: int
    digits: Literal["", "0", "#"]

    def of(self, before: bytes) -> bytes:
        """The checksum as it stands behind `before`. ValueError where it cannot be made of that."""
        checksum = CHECKSUMS[self.kind]
        data = before[self.start : len(before) - self.behind]
        if self.digits == "#":
            return checksum.decimal(data)
        return checksum.hexadecimal(data) if self.digits else checksum.on_the_wire(data)

    @property
    def length(self) -> int:
        """Bytes that it takes."""
        checksum = CHECKSUMS[self.kind]
        return checksum.decimals if self.digits == "#" else 2 * checksum.length if self.digits else checksum.length
