"""A gauge's replies split into columns: text and numbers in turn, the same in every reply."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from compd.errors import CompdError
from compd.gauge_description.unit_words import is_wire_unit

_SIGNS = ("", "+", "-", " ")


class DescriptionError(CompdError):
    """Replies that yield no description."""


class ReplyPart(NamedTuple):
    """A piece of a reply: a number or the text between two numbers, and its position in the reply."""

    is_number: bool
    text: bytes
    start: int


ReplyColumn = list[ReplyPart]


class VaryingWord(NamedTuple):
    """A difference of texts: the common text before it, the word of each, and the common text behind it."""

    before: str
    words: tuple[str, ...]
    behind: str


def terminator_of(replies: Sequence[bytes]) -> bytes:
    """Control characters that end every reply; b"" if all are equally long without any. Raises DescriptionError."""
    if not replies or not all(replies):
        raise DescriptionError.of("replies", "there is none, or an empty one", next_step="check port, baud and format")
    ending = re.search(rb"[\x00-\x1f]*$", replies[0])
    terminator = ending[0] if ending else b""
    while not all(reply.endswith(terminator) for reply in replies):
        terminator = terminator[1:]
    if not terminator and len({len(reply) for reply in replies}) > 1:
        k = next(k for k, reply in enumerate(replies) if len(reply) != len(replies[0]))
        raise DescriptionError.of(
            f"reply {k + 1}",
            "has no terminator in common with reply 1, and another length",
            value=repr(replies[k]),
            next_step="capture whole replies, each with its end",
        )
    return terminator


def columns_of(
    bodies: Sequence[bytes], mark: str, words: Sequence[Sequence[str]] = (), constants: Sequence[str] = ()
) -> list[ReplyColumn]:
    """Column by column the parts of all replies; the first and the last are text, perhaps empty.

    mark : the decimal mark. words : tables of words that may stand for each other, whatever their lengths, as units
    and signs may. constants : digits in front of a number that are no part of it.
    Raises DescriptionError if one reply is built differently.
    """
    split = [_parts(body, mark) for body in bodies]
    for k, parts in enumerate(split):
        for index, (part, first) in enumerate(zip(parts, split[0], strict=False)):
            if part.is_number:
                differs = (mark.encode() in part.text) != (mark.encode() in first.text) and not _exponents(part, first)
            else:
                texts = [first.text, part.text]
                there = all(len(other) > index for other in split)
                if there and len(part.text) != len(first.text):
                    texts = [other[index].text for other in split]
                differs = len(part.text) != len(first.text) and not exchangeable(varying_word(texts), words)
            if differs:
                raise _difference(k, part.start, bodies[k], bodies[0])
        if len(parts) != len(split[0]):
            raise _difference(k, min(parts[-1].start, split[0][-1].start), bodies[k], bodies[0])
    columns = [list(column) for column in zip(*split, strict=True)]
    for constant in constants:
        columns = _cut_off(columns, constant.encode("latin-1"))
    return columns


def varying_word(texts: Sequence[bytes]) -> VaryingWord:
    """The word in which texts differ, with all its letters."""
    shown = [text.decode("latin-1") for text in texts]
    before = _common(shown)
    rests = [text[len(before) :] for text in shown]
    behind = _common([rest[::-1] for rest in rests])[::-1]
    words = [rest[: len(rest) - len(behind)] for rest in rests]
    # common letters belong to the words: mm and um
    if any(word[:1].isalpha() for word in words):
        letters = len(before) - len(before.rstrip("".join(filter(str.isalpha, set(before)))))
        words = [before[len(before) - letters :] + word for word in words]
        before = before[: len(before) - letters]
    if any(word[-1:].isalpha() for word in words):
        letters = len(behind) - len(behind.lstrip("".join(filter(str.isalpha, set(behind)))))
        words = [word + behind[:letters] for word in words]
        behind = behind[letters:]
    return VaryingWord(before, tuple(words), behind)


def exchangeable(varying: VaryingWord, tables: Sequence[Sequence[str]] = ()) -> bool:
    """Whether the words are alternatives: signs, units, or words of one of the tables."""
    words = set(varying.words)
    return words <= set(_SIGNS) or all(map(is_wire_unit, words)) or any(words <= set(table) for table in tables)


def _exponents(*parts: ReplyPart) -> bool:
    return all(b"e" in part.text.lower() for part in parts)


def _common(texts: Sequence[str]) -> str:
    """The longest common prefix."""
    length = 0
    while all(len(text) > length and text[length] == texts[0][length] for text in texts):
        length += 1
    return texts[0][:length]


def _number_pattern(mark: str) -> re.Pattern[bytes]:
    point = re.escape(mark)
    before = r"\d*" if mark == "." else r"\d+"  # .5 is a number, and ,5 the next one of a list
    return re.compile(
        rf" *[+-]? *\d+(?:{point}\d+)?[eE][+-]\d+| *[+-]? *\d+{point}\d+[eE]\d+"
        rf"| *[+-]? *{before}{point}\d+| *[+-] *\d+|\d+".encode()
    )


def _parts(body: bytes, mark: str) -> list[ReplyPart]:
    parts, start = [], 0
    for match in _number_pattern(mark).finditer(body):
        parts += [ReplyPart(False, body[start : match.start()], start), ReplyPart(True, match[0], match.start())]
        start = match.end()
    return [*parts, ReplyPart(False, body[start:], start)]


def _cut_off(columns: Sequence[ReplyColumn], constant: bytes) -> list[ReplyColumn]:
    """The columns with `constant` as text if every reply has it in front of more digits of a number."""
    pattern = re.compile(rb" *" + re.escape(constant) + rb"(?=[ +-]*[0-9.,])")
    result = [list(column) for column in columns]
    for k in range(1, len(result), 2):
        matches = [pattern.match(part.text) for part in result[k]]
        for index, match in enumerate(matches):
            if match is None or not all(matches):
                break
            text, number = result[k - 1][index], result[k][index]
            result[k - 1][index] = text._replace(text=text.text + match[0])
            result[k][index] = ReplyPart(True, number.text[match.end() :], number.start + match.end())
    return result


def _difference(k: int, index: int, body: bytes, first: bytes) -> DescriptionError:
    """The error for reply `k`, whose form differs from the first one's from byte `index` on."""
    return DescriptionError.of(
        f"reply {k + 1}, character {index + 1}",
        "is built differently from reply 1",
        value=repr(body),
        allowed=repr(first),
        next_step="if it is an error reply, name it: --error 'TEXT=quality'; if it is damaged, capture it again",
    )
