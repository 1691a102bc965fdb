"""One request of a capture with its replies: their columns, their decimal mark, their checksum."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

from compd.gauge_description.ambiguities import decimal_mark_of
from compd.gauge_description.answers import Answers, factor_words
from compd.gauge_description.reply_columns import DescriptionError, ReplyColumn, columns_of
from compd.gauge_description.unit_words import unit_before, unit_behind
from compd.lines import CHECKSUMS, ChecksumField

# Most bytes left out in front (STX, $) and behind (ETX, *); manuals leave out none to three.
MAX_LEFT_OUT = 3
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
    left_out = sorted(itertools.product(range(MAX_LEFT_OUT + 1), repeat=2), key=sum)
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


MIN_REPLIES = 3


class ObservedExchange:
    """A request, and the columns of its replies.

    request : as bytes; b"" for unsolicited data. columns : text and numbers in turn. numbers : the columns
    that may be channels. mark : the decimal mark. end : the converter of what ends every reply, a checksum, or "".
    problems : what is to be asked of the replies as a whole. notes : on what was taken for granted.
    """

    def __init__(self, request: bytes, bodies: Sequence[bytes], answers: Answers) -> None:
        """`bodies`: the replies without terminator, without those that are errors.

        Raises DescriptionError for too few that differ, and for one that is built differently.
        """
        if len(set(bodies)) < MIN_REPLIES:
            raise DescriptionError.of(
                f"replies to {request!r}" if request else "replies",
                "too few that differ",
                value=str(len(set(bodies))),
                allowed=f"{MIN_REPLIES} or more",
                next_step="move the gauge between two captures: near zero, far out, and to the other side",
            )
        self.request = request
        self.end = ""
        self.notes: list[str] = []
        self._answers = answers
        if answers.skipped_end:
            self.end = f"%*{answers.skipped_end}c"
            bodies = [body[: -answers.skipped_end] for body in bodies]
        elif not answers.plain and (checksum := checksum_end(bodies)):
            self.end = checksum.converter
            bodies = [body[: -checksum.length] for body in bodies]
            self.notes.append(f"every reply ends in the checksum {checksum.converter}; --plain if that is measured")
        words = [factor_words(table) for table in answers.factors]
        columns = columns_of(bodies, ".", words, answers.constants)
        self.mark, self.problems = decimal_mark_of(columns, answers)
        self.columns = columns if self.mark == "." else columns_of(bodies, self.mark, words, answers.constants)
        self.numbers = [k for k, column in enumerate(self.columns) if _may_be_channel(column)]
        if not self.numbers:
            raise DescriptionError.of("replies", "no number in them", value=repr(bodies[0]))

    def texts(self, k: int) -> list[str]:
        """Column `k` of every reply."""
        return [part.text.decode("latin-1") for part in self.columns[k]]

    def is_whole(self, k: int) -> bool:
        """Whether the numbers in column `k` have neither a point nor an exponent."""
        return not any(self.mark in text or "e" in text.lower() for text in self.texts(k))

    def units(self, k: int) -> list[str]:
        """The units of the number in column `k` in the replies, including "" for a reply without one."""
        behind = {self._unit(unit_behind(text)) for text in self.texts(k + 1)}
        if behind != {("", "")}:
            return sorted({unit for unit, _ in behind})
        if k > 1 and any(unit_behind(text)[0] for text in self.texts(k - 1)):
            return [""]  # it belongs to the previous number
        return sorted({self._unit(unit_before(text))[0] for text in self.texts(k - 1)})

    def in_a_clock(self, k: int) -> bool:
        """Whether the two constant digits in column `k` are hours or minutes, which will change."""
        return all(len(text) == 2 for text in self.texts(k)) and any(
            0 < other < len(self.columns)
            and set(self.texts((k + other) // 2)) == {":"}
            and all(len(text) == 2 and text.isdigit() for text in self.texts(other))
            for other in (k - 2, k + 2)
        )

    def _unit(self, unit_and_word: tuple[str, str]) -> tuple[str, str]:
        """None if the person has given the word's meaning."""
        unit, word = unit_and_word
        explained = any(word in factor_words(table) for table in self._answers.factors)
        return ("", "") if explained or set(word) <= set(self._answers.ignored) else (unit, word)


def _may_be_channel(column: ReplyColumn) -> bool:
    """A number with a point or a sign always counts; a bare whole number (an address, a name) if it changed."""
    if not column[0].is_number:
        return False
    bare = all(part.text.isdigit() for part in column)
    return not bare or len({part.text for part in column}) > 1
