"""Identifies the checksum at the end of a gauge's replies among those that compd knows."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

from compd.lines import CHECKSUMS, ChecksumField

# Most bytes left out in front (STX, $) and behind (ETX, *); manuals leave out none to three.
MOST_LEFT_OUT = 3
# Least evidence (bits) for a checksum: a chance fit to all replies below 2^-18, as some 300 are tried.
ENOUGH_BITS = 18.0


class ChecksumEnd(NamedTuple):
    """Checksum at the end of every reply: `converter` in the notation of descriptions, of `length` bytes."""

    converter: str
    length: int


def checksum_end(bodies: Sequence[bytes]) -> ChecksumEnd | None:
    """The checksum at the end of all `bodies` (replies without terminator); None without a significant fit."""
    different = sorted(set(bodies))
    if len(different) < 2:
        return None
    for field in _fields():
        if all(_fits(field, body) for body in different):
            ends = {body[-field.length :] for body in different}
            if len(ends) > 1 and len(different) * _bits(field, ends) >= ENOUGH_BITS:
                return ChecksumEnd(_converter(field), field.length)
    return None


def _fields() -> Iterator[ChecksumField]:
    """Every checksum in every form; the longest ones with the fewest omitted bytes first."""
    digits: tuple[Literal["", "0", "#"], ...] = ("0", "#", "")
    left_out = sorted(itertools.product(range(MOST_LEFT_OUT + 1), repeat=2), key=sum)
    fields = [
        ChecksumField("", kind, start, behind, form)
        for start, behind in left_out
        for form in digits
        for kind in CHECKSUMS
    ]
    return iter(sorted(fields, key=lambda field: -field.length))


def _fits(field: ChecksumField, body: bytes) -> bool:
    before = body[: -field.length]
    if len(before) <= field.start + field.behind:
        return False
    try:
        expected = field.of(before)
    except ValueError:
        return False
    received = body[-field.length :]
    return (received.upper() if field.digits == "0" else received) == expected


def _bits(field: ChecksumField, ends: set[bytes]) -> float:
    """Evidence (bits) of one reply for a checksum: digits fit by chance more often than bytes."""
    if field.digits == "#":
        return field.length * math.log2(10)
    if field.digits == "0":
        return 4.0 * field.length
    # the exclusive or of digits is a digit, or nearly
    return (4.0 if all(end.isalnum() for end in ends) else 8.0) * field.length


def _converter(field: ChecksumField) -> str:
    behind = f".{field.behind}" if field.behind else ""
    return f"%{field.digits}{field.start or ''}{behind}<{field.kind}>"
