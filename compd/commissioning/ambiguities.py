"""What stands beside a number in a gauge's replies and may belong to it: its sign, its unit, an address, a checksum.

`compd gauge learn` asks instead of guessing: what it took for text that does not matter could turn the number round, or
make it a thousand times too large.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from compd.errors import CompdError, Problem

# Decimals that a display of a length may have; more, and the last ones may be a checksum. In mm: 0.1 um.
USUAL_DECIMALS: Mapping[str, int] = {"mm": 4, "um": 3, "nm": 3, "inch": 6, "mil": 4}
OTHER_DECIMALS = 4
BY_HAND = "or write the description by hand: docs/how-to/describe-a-gauge.md"


class DescriptionError(CompdError):
    """Replies from which no description follows."""


class ReplyPart(NamedTuple):
    """A piece of a reply: a number or the text between two numbers, and its first byte's place in the reply."""

    is_number: bool
    text: bytes
    start: int


def ambiguities(columns: Sequence[Sequence[ReplyPart]], unit: str, ignored: str, decimals: int | None) -> list[Problem]:
    """A question for everything that may belong to a number; none where every number is plain.

    columns : the parts of all replies, text and numbers in turn.
    unit : of the numbers. ignored : letters and signs that may vary. decimals : how many the device shows, if known.
    """
    problems: list[Problem] = []
    for k, column in enumerate(columns):
        if column[0].is_number:
            problems += _of_a_number(column, unit, decimals)
        else:
            problems += _of_a_text(column, ignored, behind_a_number=k > 0)
            problems += _decimal_comma(columns, k)
    return problems


def _of_a_text(column: Sequence[ReplyPart], ignored: str, behind_a_number: bool) -> Iterator[Problem]:
    texts = [part.text.decode("latin-1") for part in column]
    places = [sorted(set(characters)) for characters in zip(*texts, strict=True)]
    varying = {
        character
        for seen in places
        for character in seen
        if len(seen) > 1 and character not in ignored and (character.isalpha() or character in "+-")
    }
    if varying:
        yield _question(
            column[0].start,
            "varies beside a number: is it a sign, a unit, a side or a status?",
            sorted(set(texts)),
            f"if it does not touch the value, --ignore {''.join(sorted(varying))!r}; a unit: set the device to one; "
            f"a status: capture good replies alone; {BY_HAND}",
        )
    sign = texts[0].strip(" ")[:1]
    if behind_a_number and len(set(texts)) == 1 and sign in ("+", "-") and sign not in ignored:
        yield _question(
            column[0].start,
            "stands behind a number: is it the sign?",
            texts[:1],
            f"set the device to send the sign before the number; if it is none, --ignore={sign}",
        )


def _of_a_number(column: Sequence[ReplyPart], unit: str, decimals: int | None) -> Iterator[Problem]:
    texts = [part.text.strip().decode("ascii") for part in column]
    start = column[0].start
    if any("e" in text.lower() for text in texts):
        return
    for text in texts:
        if re.fullmatch(r"[+-]? *9{3,}\.?9*|[+-]? *9+\.99+", text):
            yield _question(
                start,
                "is all nines: does it stand for an error?",
                [text],
                f"if so, --error {text + '=over_range'!r}; if it was measured, capture another place",
            )
            break
    if not all("." in text for text in texts):
        return
    places = max(len(text.partition(".")[2]) for text in texts)
    if decimals is None and places > USUAL_DECIMALS.get(unit, OTHER_DECIMALS):
        yield _question(
            start,
            f"has {places} decimals of {unit}: are the last ones a checksum or a status?",
            texts[:3],
            f"--decimals {places} if the display shows so many; --decimals {places - 2} where two are no part of it",
        )
    whole = [text.partition(".")[0] for text in texts]
    alike = "".join(
        seen[0] for seen in itertools.takewhile(lambda seen: len(set(seen)) == 1, zip(*whole, strict=False))
    )
    if min(map(len, whole)) > 1 and alike.isdigit() and alike.strip("0"):
        yield _question(
            start,
            f"begins with {alike} in every reply: is an address or a status glued to it?",
            texts[:3],
            f"if not, capture again where the first digits differ, also near zero; {BY_HAND}",
        )


def _decimal_comma(columns: Sequence[Sequence[ReplyPart]], k: int) -> Iterator[Problem]:
    """Whole digits, a comma, and digits that always have the same length: one number, or two?"""
    if not 0 < k < len(columns) - 1 or {part.text for part in columns[k]} != {b","}:
        return
    before, behind = ([part.text for part in columns[place]] for place in (k - 1, k + 1))
    whole = all(re.fullmatch(rb" *[+-]? *\d+", text) for text in before) and all(text.isdigit() for text in behind)
    if whole and len({len(text) for text in behind}) == 1:
        yield _question(
            columns[k][0].start,
            "a comma between digits: is it a decimal comma?",
            [f"{before[0].decode()},{behind[0].decode()}"],
            f"set the device to a decimal point; {BY_HAND}",
        )


def _question(place: int, what: str, seen: Sequence[str], next_step: str) -> Problem:
    return Problem(
        where=f"replies, character {place + 1}", what=what, value=", ".join(map(repr, seen)), next_step=next_step
    )
