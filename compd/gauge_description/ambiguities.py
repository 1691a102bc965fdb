"""Ambiguous text beside a number in a gauge's replies: a sign, a unit, an address, a checksum.

`compd gauge learn` asks instead of guessing: what it took for text that does not matter could turn the number round, or
make it a thousand times too large. Each question names the option that answers it.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence

from compd.errors import Problem
from compd.gauge_description.answers import Answers, factor_words
from compd.gauge_description.reply_columns import ReplyColumn, varying_word
from compd.gauge_description.unit_words import is_wire_unit
from compd.lines import CHECKSUMS

# Most decimals of a length display by unit (mm: 0.1 um); beyond them the last ones may be a checksum.
USUAL_DECIMALS: Mapping[str, int] = {"mm": 4, "um": 3, "nm": 3, "inch": 6, "mil": 4}
OTHER_DECIMALS = 4
# Marks of comparators behind a value beyond or within its tolerance (Heidenhain ND 281, Mahr C1202: M).
JUDGEMENTS = "<>= "
_SIGN_LETTERS = {"L": "R", "R": "L", "l": "r", "r": "l"}
STATUS = "a status: capture good replies alone, or name the others by --error"
BY_HAND = "or write the description by hand: docs/how-to/describe-a-gauge.md"


def text_questions(columns: Sequence[ReplyColumn], k: int, answers: Answers) -> Iterator[Problem]:
    """Questions on the text in column `k`: varying characters, and possible signs that never changed."""
    column = columns[k]
    texts = [part.text for part in column]
    varying = varying_word(texts)
    words = set(varying.words)
    if len(words) == 1:
        yield from _constant_sign(columns, k, answers)
        return
    if any(words <= set(factor_words(table)) for table in answers.factors) or all(map(is_wire_unit, words)):
        return
    characters = set("".join(words)) - set(answers.ignored) - set(JUDGEMENTS)
    if not characters and len({len(word) for word in words}) == 1:
        return
    steps = []
    if words <= set("+- ") | {""}:
        steps.append(f"if it is the sign, --factors={_table(words, {'+': 1, '-': -1})!r}")
    elif all(word.isalpha() for word in words):
        steps.append(f"a sign or a unit: what each multiplies the number by, --factors={_table(words, {})!r}")
    if (
        len({len(word) for word in words}) == 1
        and characters
        and all(character.isprintable() for character in characters)
    ):
        steps.append(f"if it does not touch the value, --ignore={''.join(sorted(characters))!r}")
    if k == len(columns) - 1 and not varying.behind:
        length = len(varying.words[0])
        steps.append(f"a checksum: it is none of {', '.join(CHECKSUMS)}; --skip-end {length} skips it unchecked")
    steps.append(f"{STATUS}; {BY_HAND}")
    yield _question(
        column[0].start + len(varying.before),
        "varies beside a number: is it a sign, a unit, a side, a status or a checksum?",
        sorted({text.decode("latin-1") for text in texts}),
        "; ".join(steps),
    )


def _constant_sign(columns: Sequence[ReplyColumn], k: int, answers: Answers) -> Iterator[Problem]:
    text = columns[k][0].text.decode("latin-1")
    known = {word for table in answers.factors for word in factor_words(table)} | set(answers.ignored)
    ends = [text.strip(" ")[:1], *([text.strip(" ")[-1:]] if k == len(columns) - 1 else [])]
    sign = next((end for end in ends if end in ("+", "-")), "")
    if k > 0 and sign and sign not in known:
        yield _question(
            columns[k][0].start,
            "stands behind a number: is it the sign?",
            [text],
            f"if so, --factors={_table({sign, '+', '-'}, {'+': 1, '-': -1})!r}; if not, --ignore={sign}",
        )
    letter = text[-1:]
    if letter == "(" and letter not in known and k < len(columns) - 1:
        yield _question(
            columns[k][0].start,
            "a number in parentheses: does that mean minus?",
            [f"({columns[k + 1][0].text.decode()})"],
            "if so, --factors '(=-1'; if not, --ignore='('",
        )
    if k == len(columns) - 1 or letter not in _SIGN_LETTERS or text[-2:-1].isalpha() or letter in known:
        return
    if any(re.match(rb" *[+-]", part.text) for part in columns[k + 1]):
        return
    other = _SIGN_LETTERS[letter]
    yield _question(
        columns[k][0].start,
        f"the letter {letter} before a number without sign: does {other} stand there on the other side of zero?",
        [text],
        f"if so, --factors={f'{letter}=1|{other}=-1'!r}, with the manual's signs; if not, --ignore={letter}",
    )


def number_questions(
    columns: Sequence[ReplyColumn], k: int, unit: str, mark: str, answers: Answers
) -> Iterator[Problem]:
    """Questions on the number in column `k`, of `unit` on the wire: codes, and digits that may not belong to it."""
    column = columns[k]
    texts = [part.text.strip().decode("ascii") for part in column]
    start = column[0].start
    if any("e" in text.lower() for text in texts):
        mantissas = [re.split("[eE]", text)[0].lstrip("+- ") for text in texts]
        if not answers.plain and any(len(mantissa.partition(mark)[0]) > 1 for mantissa in mantissas):
            yield _question(
                start,
                "has an exponent and several digits before the point: is an address or a status glued to it?",
                texts[:3],
                f"--constant with the digits of an address; if all are measured, --plain; {STATUS}; {BY_HAND}",
            )
        if not answers.plain and any(re.search(r"[eE][+-]?\d{4}", text) for text in texts):
            yield _question(
                start,
                "has four or more digits of its exponent: are the last ones a checksum?",
                texts[:3],
                "if so, --skip-end 2 for two of them; if not, --plain",
            )
        return
    nines = re.compile(rf"[+-]? *9{{3,}}{re.escape(mark)}?9*|[+-]? *9+{re.escape(mark)}99+")
    if code := next((text for text in texts if nines.fullmatch(text)), None):
        reply = f"REPLY=over_range, with the whole reply in place of REPLY, here {code!r} and what stands beside it"
        yield _question(
            start,
            "is all nines: does it stand for an error?",
            [code],
            f"if so, --error {reply}; if it was measured, capture another place",
        )
    yield from _thousands(columns, k, mark, answers)
    if not all(mark in text for text in texts):
        if answers.decimals is None:
            yield _question(
                start,
                "is a whole number: how many of its digits stand behind the point?",
                texts[:3],
                "--decimals 3 where 12345 is 12.345; --decimals 0 where it counts whole units",
            )
    else:
        places = max(len(text.partition(mark)[2]) for text in texts)
        if answers.decimals is None and not answers.plain and places > USUAL_DECIMALS.get(unit, OTHER_DECIMALS):
            yield _question(
                start,
                f"has {places} decimals of {unit or 'its unit'}: are the last ones a checksum or a status?",
                texts[:3],
                f"--decimals {places} if the display shows all; --decimals {places - 2} where it shows two less",
            )
    yield from _glued(texts, start, mark, answers)


def _glued(texts: Sequence[str], start: int, mark: str, answers: Answers) -> Iterator[Problem]:
    """Digits in front that never change, or of which the first alone does: an address, a status, or measured?"""
    if answers.plain:
        return
    whole = [text.partition(mark)[0] for text in texts]
    alike = "".join(
        seen[0] for seen in itertools.takewhile(lambda seen: len(set(seen)) == 1, zip(*whole, strict=False))
    )
    shortest = min(map(len, whole))
    if shortest > 1 and alike.isdigit() and alike.strip("0"):
        yield _question(
            start,
            f"begins with {alike} in every reply: is an address or a status glued to it?",
            texts[:3],
            f"if so, --constant with the digits that are no part of the number, such as {alike[:2]}; if not, --plain, "
            "or capture again where the first digits differ, also near zero",
        )
    elif shortest > 2 and all(map(str.isdigit, whole)) and not alike and len({text[1] for text in whole}) == 1:
        yield _question(
            start,
            "its first digit changes and its second never does: is a status glued to it?",
            texts[:3],
            f"if not, --plain, or capture again where the second digit differs; {STATUS}; {BY_HAND}",
        )


def _thousands(columns: Sequence[ReplyColumn], k: int, mark: str, answers: Answers) -> Iterator[Problem]:
    """One to three digits, a separator, and three digits with decimals: one number, or two?"""
    if k < 2 or answers.names:
        return
    between = {part.text for part in columns[k - 1]}
    before, behind = ([part.text.decode("ascii") for part in columns[place]] for place in (k - 2, k))
    if len(between) > 1 or between - {b"", b"'", b",", b"_", b"."} or set(before) & set(answers.constants):
        return
    blank = " " if between == {b""} else ""
    if all(re.fullmatch(r" *[+-]? *\d{1,3}", text) for text in before) and all(
        re.fullmatch(rf"{blank}\d{{3}}{re.escape(mark)}\d+", text) for text in behind
    ):
        joined = f"{before[0]}{between.pop().decode()}{behind[0]}"
        yield _question(
            columns[k - 2][0].start,
            "may be one number in groups of three digits, which compd does not read, or two numbers",
            [joined],
            "one: set the device to send it without groups; two: --names with a name for each, or "
            f"--constant {before[0]} where the first never changes",
        )


def decimal_mark_of(columns: Sequence[ReplyColumn], answers: Answers) -> tuple[str, list[Problem]]:
    """The decimal mark of replies whose columns were made with a point, and the question where both are possible."""
    if answers.decimal_mark:
        return answers.decimal_mark, []
    pointed = any(b"." in part.text for column in columns[1::2] for part in column)
    for k in range(2, len(columns) - 1, 2):
        if {part.text for part in columns[k]} != {b","}:
            continue
        before, behind = ([part.text for part in columns[place]] for place in (k - 1, k + 1))
        if not all(re.fullmatch(rb"\d+(?:[eE][+-]?\d+)?", text) for text in behind):
            continue
        as_long = len({len(text) for text in behind}) == 1
        shown = f"{before[0].decode()},{behind[0].decode()}"
        whole = all(re.fullmatch(rb" *[+-]? *\d+", text) for text in before)
        grouped = all(re.fullmatch(rb" *[+-]? *\d{1,3}\.\d{3}", text) for text in before)
        signed = any(re.match(rb" *[+-]", text) for text in before)
        if whole and signed and as_long and not pointed:
            return ",", []
        if (whole and not pointed) or grouped:
            one = "set the device to send it without points" if grouped else "--decimal-mark ,"
            step = f"if it is, {one}; two numbers: --decimal-mark ."
            return ".", [
                _question(columns[k][0].start, "a comma between digits: is it a decimal comma?", [shown], step)
            ]
    return ".", []


def _table(words: set[str], factors: Mapping[str, float]) -> str:
    """Words and factors for --factors; FACTOR stands for one to be filled in."""
    return "|".join(f"{word}={factors.get(word, 1 if not word.strip() else 'FACTOR')}" for word in sorted(words))


def _question(index: int, what: str, seen: Sequence[str], next_step: str) -> Problem:
    return Problem(f"replies, character {index + 1}", what, value=", ".join(map(repr, seen)), next_step=next_step)
