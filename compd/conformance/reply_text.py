"""Constant parts of a device's replies (letters, an address, an end), and forgeries that change them.

A forged reply has a right checksum, which is learned from samples: a driver that refuses it for another reason shows
what else it checks.
"""

from __future__ import annotations

import binascii
import itertools
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import NamedTuple

from pymodbus.framer.rtu import FramerRTU

from compd.conformance.device_replies import CONTROL, is_text

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
MAX_BEFORE = 3  # most bytes of a head outside the checksum
MAX_BETWEEN = 1  # most bytes between the covered part and the checksum: NMEA's *
MAX_BEHIND = 3  # most bytes of a terminator
MIN_SAMPLES = 4  # fewest different samples: n of them fit a wrong algorithm by chance once in 256^n


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
    if len(different) < MIN_SAMPLES:
        return None
    places = itertools.product(range(MAX_BEFORE + 1), range(MAX_BETWEEN + 1), range(MAX_BEHIND + 1))
    for (first, between, behind), algorithm, encoding in itertools.product(places, ALGORITHMS, ENCODINGS):
        checksum = ReplyChecksum(algorithm, encoding, first, between, behind)
        if all(len(reply) > behind + 4 and checksum.repaired(reply) == reply for reply in different):
            return checksum
    return None


MIN_ALIKE = 6  # fewest replies of the same length for learning the constant parts
SUBSTITUTES = b"XQZ"  # letters without a meaning as unit or judgement
# mm in one of them
UNIT_WORDS = {b"mm": 1.0, b"um": 1e-3, b"nm": 1e-6, b"cm": 10.0, b"in": 25.4, b"inch": 25.4, b"mil": 0.0254, b"m": 1e3}
INCH_MARK = b'"'
NO_ADDRESS = frozenset({0x00, 0xFF})  # fill bytes of a binary frame
# Texts of instruments for a missing number.
ERROR_TEXTS = (
    b"", b"ERR", b"ERROR", b"Err 5", b"ERR9", b"E01", b"E 42", b"ER99", b"ER,99", b"NG", b"NAK", b"?", b"OVER",
    b"UNDER", b"OL", b"-OL", b"OVERFLOW", b"NO DATA", b"nan", b"inf", b"-inf", b"NONE", b"-----", b"+-----",
    b"*****", b"+++++", b".", b"-", b"+", b"--.---",
)  # fmt: skip
FIELD_FILLINGS = b"-*+ #?EF."


@dataclass(frozen=True)
class Forgery:
    """A forged reply, and the change in it. factor : of all numbers, by another unit."""

    what: str
    reply: bytes
    factor: float | None = None


class ReplyText:
    """The common parts of the replies to one request, for all values of the sensors.

    base : the reply that forgeries are made of, one of those of the most frequent length.
    """

    def __init__(self, request: bytes, replies: Sequence[bytes], base: bytes) -> None:
        self.base = base
        self._request = request
        self._alike = [reply for reply in replies if len(reply) == len(base)]
        self._constant = [
            len(self._alike) >= MIN_ALIKE and all(reply[index] == byte for reply in self._alike)
            for index, byte in enumerate(base)
        ]
        self._checksum: ReplyChecksum | None = checksum_in([base, *self._alike])
        self._check_place = self._checksum.place(base) if self._checksum else slice(0, 0)

    @property
    def is_text(self) -> bool:
        return is_text(self.base)

    def without(self, identity: bytes) -> bytes:
        """A reply that does not begin with `identity`; b"" if all do."""
        return next((reply for reply in self._alike if not reply.startswith(identity)), b"")

    @property
    def terminator(self) -> bytes:
        """The control characters at the end."""
        kept = self.base.rstrip(bytes(CONTROL))
        return self.base[len(kept) :]

    def letters(self) -> Iterator[Sequence[Forgery]]:
        """For each constant letter, replies with another in its place."""
        for place in self._constant_places():
            letter = chr(self.base[place])
            if not letter.isalpha():
                continue
            others = [chr(code) if letter.isupper() else chr(code).lower() for code in SUBSTITUTES]
            yield [
                self._with(slice(place, place + 1), other.encode(), f"{letter!r} at byte {place} is {other!r}")
                for other in others
                if other != letter
            ]

    def units(self) -> Iterator[Forgery]:
        """Replies with another unit of length."""
        for match in re.finditer(rb"(?<![A-Za-z])[a-z]+(?![A-Za-z])", self.base):
            if match[0] in UNIT_WORDS and all(self._constant[match.start() : match.end()]):
                for word, in_mm in UNIT_WORDS.items():
                    if word != match[0]:
                        what = f"{match[0].decode()!r} is {word.decode()!r}"
                        factor = in_mm / UNIT_WORDS[match[0]]
                        yield replace(self._with(slice(*match.span()), word, what), factor=factor)
        for place in self._constant_places():
            if self.base[place : place + 1] == b" " and any(48 <= byte < 58 for byte in self.base[:place]):
                what = f"the blank at byte {place} is an inch mark"
                yield replace(self._with(slice(place, place + 1), INCH_MARK, what), factor=UNIT_WORDS[b"inch"])

    def signs(self) -> Iterator[Forgery]:
        """Replies with the other sign before one of their numbers."""
        for index, byte in enumerate(self.base):
            other = {"+": "-", "-": "+", " ": "-"}.get(chr(byte))
            if other is not None and any(reply[index : index + 1] == other.encode() for reply in self._alike):
                what = f"the sign at byte {index} is {other!r}"
                yield self._with(slice(index, index + 1), other.encode(), what)

    def addresses(self) -> Iterator[Forgery]:
        """Replies of other units: with another number in place of one from the request."""
        for token in self._tokens():
            start = self.base.find(token)
            while start >= 0:
                place = slice(start, start + len(token))
                if set(range(start, start + len(token))) <= set(self._constant_places()):
                    other = self._another(token)
                    yield self._with(place, other, f"{token!r} at byte {start}, as in the request, is {other!r}")
                start = self.base.find(token, start + 1)

    def _tokens(self) -> set[bytes]:
        """Numbers of the request, if it is text; else its bytes."""
        if self.is_text:
            return set(re.findall(rb"\d+", self._request))
        return {bytes([byte]) for byte in self._request if byte not in NO_ADDRESS}

    def _another(self, token: bytes) -> bytes:
        if self.is_text:
            return f"{(int(token) + 1) % 10 ** len(token):0{len(token)}d}".encode()
        return bytes([token[0] % 0xFE + 1])

    def checksums(self) -> Iterator[Forgery]:
        """Replies with one changed byte of the checksum."""
        for index in range(self._check_place.start, self._check_place.stop):
            byte = self.base[index : index + 1]
            other = bytes([byte[0] ^ 0x40]) if not self.is_text else (b"0" if byte != b"0" else b"1")
            reply = self.base[:index] + other + self.base[index + 1 :]
            yield Forgery(f"byte {index}, of the checksum, is {other!r} in place of {byte!r}", reply)

    def identities(self, identity: bytes) -> Iterator[Forgery]:
        """Replies with one changed byte of their identity."""
        for index in range(len(identity)):
            other = bytes([self.base[index] + 1 & 0x7F])
            yield self._with(slice(index, index + 1), other, f"byte {index}, of `reply_identity`, is {other!r}")

    def errors(self) -> Iterator[Forgery]:
        """Error texts in place of the reply, short ones and ones padded to the reply's length."""
        end = self.terminator
        length = len(self.base) - len(end)
        for text in ERROR_TEXTS:
            for reply in dict.fromkeys((text, text.ljust(length), text.rjust(length))):
                if len(reply) <= length:
                    yield Forgery(f"{reply + end!r} in its place", reply + end)

    def fields(self, others: Sequence[bytes]) -> Iterator[Forgery]:
        """Replies without a number at the place where `others` differ from this one."""
        differing = [
            index
            for index in range(len(self.base))
            if not self._check_place.start <= index < self._check_place.stop
            and any(len(other) == len(self.base) and other[index] != self.base[index] for other in others)
        ]
        if not differing:
            return
        field = slice(differing[0], differing[-1] + 1)
        for filling in FIELD_FILLINGS:
            text = bytes([filling]) * (field.stop - field.start)
            yield self._with(field, text, f"{self.base[field].decode()!r} is {text.decode()!r}")

    def _constant_places(self) -> Iterator[int]:
        for index, constant in enumerate(self._constant):
            if constant and not self._check_place.start <= index < self._check_place.stop:
                yield index

    def _with(self, place: slice, text: bytes, what: str) -> Forgery:
        reply = self.base[: place.start] + text + self.base[place.stop :]
        if self._checksum is not None:
            reply = self._checksum.repaired(reply)
        return Forgery(what, reply)


def most_frequent_length(replies: Sequence[bytes]) -> int:
    """The most common length of the replies."""
    return Counter(map(len, replies)).most_common(1)[0][0]
