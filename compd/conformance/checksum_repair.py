"""The checksum in a device's replies, learned from samples, for forged replies with a right one.

Without it a driver would refuse a forged reply for its checksum, and nothing would be known of all else that it checks.
"""

from __future__ import annotations

import binascii
import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import NamedTuple

from pymodbus.framer.rtu import FramerRTU

Algorithm = Callable[[bytes], bytes]
Encoding = Callable[[bytes], bytes]

ALGORITHMS: Mapping[str, Algorithm] = {
    "sum8": lambda data: bytes([sum(data) % 256]),
    "negative sum8": lambda data: bytes([-sum(data) % 256]),
    "xor8": lambda data: bytes([reduce(lambda a, b: a ^ b, data, 0)]),
    "sum16": lambda data: (sum(data) % 65536).to_bytes(2, "big"),
    "CRC-16/Modbus": lambda data: FramerRTU.compute_CRC(data).to_bytes(2, "big"),
    "CRC-16/XMODEM": lambda data: binascii.crc_hqx(data, 0).to_bytes(2, "big"),
    "CRC-16/CCITT-FALSE": lambda data: binascii.crc_hqx(data, 0xFFFF).to_bytes(2, "big"),
}
ENCODINGS: Mapping[str, Encoding] = {
    "bytes": lambda check: check,
    "bytes, low first": lambda check: check[::-1],
    "hexadecimal": lambda check: check.hex().upper().encode(),
    "hexadecimal in lower case": lambda check: check.hex().encode(),
    "decimal": lambda check: f"{int.from_bytes(check, 'big'):03d}".encode(),
    "decimal, two digits": lambda check: f"{int.from_bytes(check, 'big') % 100:02d}".encode(),
}
MOST_BEFORE = 3  # most bytes of a head outside the checksum
MOST_BETWEEN = 1  # most bytes between the covered part and the checksum: NMEA's *
MOST_BEHIND = 3  # most bytes of a terminator
FEWEST_SAMPLES = 4  # fewest different samples: n of them fit a wrong algorithm by chance once in 256^n


class ReplyChecksum(NamedTuple):
    """Algorithm and position of a reply's checksum."""

    algorithm: str
    encoding: str
    first: int
    between: int
    behind: int

    def place(self, reply: bytes) -> slice:
        """Its position in a reply of this length."""
        end = len(reply) - self.behind
        return slice(end - len(self._of(b"")), end)

    def repaired(self, reply: bytes) -> bytes:
        """The reply with the checksum that belongs to it."""
        place = self.place(reply)
        covered = reply[self.first : place.start - self.between]
        return reply[: place.start] + self._of(covered) + reply[place.stop :]

    def _of(self, covered: bytes) -> bytes:
        return ENCODINGS[self.encoding](ALGORITHMS[self.algorithm](covered))


def checksum_in(samples: Sequence[bytes]) -> ReplyChecksum | None:
    """The checksum of all replies; None if no known one fits."""
    different = list(dict.fromkeys(samples))
    if len(different) < FEWEST_SAMPLES:
        return None
    places = itertools.product(range(MOST_BEFORE + 1), range(MOST_BETWEEN + 1), range(MOST_BEHIND + 1))
    for (first, between, behind), algorithm, encoding in itertools.product(places, ALGORITHMS, ENCODINGS):
        checksum = ReplyChecksum(algorithm, encoding, first, between, behind)
        if all(len(reply) > behind + 4 and checksum.repaired(reply) == reply for reply in different):
            return checksum
    return None
