"""The form of a gauge's replies in the notation of descriptions."""

from __future__ import annotations

import re
from collections.abc import Sequence

from compd.gauge_description.answers import SKIPPED, Answers, factor_words
from compd.gauge_description.observed_channels import ObservedChannels
from compd.gauge_description.observed_exchange import ObservedExchange
from compd.gauge_description.reply_columns import ReplyColumn, VaryingWord, varying_word
from compd.gauge_description.unit_words import is_wire_unit, wire_unit
from compd.units import unit_factor

# Signs in front of a number, blanks among them.
_SIGNED = re.compile(rb" *[+-]")


def number_converter(texts: Sequence[bytes], mark: str, name: str, shown_decimals: int | None) -> tuple[str, str]:
    """The converter of a number, and a note for looking up in the manual ("" for none).

    texts : the number in every reply. mark : its decimal mark. name : its channel, "" if there is one.
    shown_decimals : how many decimals belong to the number; the digits behind them are skipped.
    """
    exponent = any(b"e" in text.lower() for text in texts)
    decimals = {len(re.split(rb"[eE]", text)[0].partition(mark.encode())[2]) for text in texts}
    signed = all(_SIGNED.match(text) for text in texts)
    blank = all(text[:1] in b"+- " for text in texts) and not signed
    fixed = len({len(text) for text in texts}) == 1
    zeros = fixed and all(re.match(rb"[+-]?0\d", text) for text in texts)
    note = head = tail = ""
    if not fixed:
        blanks = min(len(text) - len(text.lstrip(b" ")) for text in texts)
        head, blank = " " * blanks, False
        note = f"{name or 'the number'} has no fixed width: a digit lost on the wire cannot be found"
    (places,) = decimals if len(decimals) == 1 else (None,)
    width = len(texts[0]) if fixed else None
    point = any(mark.encode() in text for text in texts)
    if point and places is None:
        note = f"{name or 'the number'} has no fixed count of decimals: a digit lost on the wire cannot be found"
    elif width and places and shown_decimals is not None and 0 < shown_decimals < places:
        skipped = places - shown_decimals
        width, places, tail = width - skipped, shown_decimals, f"%*{skipped}[0-9]"
        note = f"the {skipped} digits behind {name or 'the number'} are skipped: a checksum in them is not checked"
    kind = "e" if exponent else "f" if point else "d"
    flag = "+" if signed else " " if blank else ""
    precision = f".{places}" if places is not None and (places or exponent) else ""
    channel = f"({name})" if name else ""
    return f"{head}%{channel}{flag}{'0' if zeros else ''}{width or ''}{precision}{kind}{tail}", note


def skipped_converter(texts: Sequence[bytes], mark: str) -> str:
    """The converter that skips a column of numbers."""
    whole = all(text.isdigit() for text in texts)
    characters = (
        "0-9" if whole else f" +0-9{mark}" + ("Ee" if any(b"e" in text.lower() for text in texts) else "") + "-"
    )
    lengths = {len(text) for text in texts}
    return f"%*{lengths.pop() if len(lengths) == 1 else ''}[{characters}]"


def reply_form(exchange: ObservedExchange, channels: ObservedChannels, answers: Answers) -> tuple[str, list[str]]:
    """The `in` of a description, as narrow as the replies, and notes for looking up in the manual."""
    form, notes = "", list(exchange.notes)
    for k, column in enumerate(exchange.columns):
        texts = [part.text for part in column]
        if not column[0].is_number:
            text, note = _text(exchange, k, channels, answers)
        elif channels.is_read(exchange, k):
            name = "" if channels.single else channels.name(exchange, k)
            text, note = number_converter(texts, exchange.mark, name, answers.decimals)
        elif channels.name(exchange, k) == SKIPPED or exchange.in_a_clock(k):
            text, note = skipped_converter(texts, exchange.mark), ""
        else:
            text, note = escaped(texts[0], "%"), ""
        form += text
        notes += [note] if note else []
    return form + exchange.end, notes


def escaped(text: bytes, double: str = "") -> str:
    r"""Text in the notation of descriptions: \r \n \t \\ \xHH; characters of `double` twice."""
    named = {0x0D: r"\r", 0x0A: r"\n", 0x09: r"\t", 0x5C: r"\\"}
    shown = (named.get(b) or (chr(b) if 0x20 <= b < 0x7F else f"\\x{b:02x}") for b in text)
    return "".join(2 * character if character in double else character for character in shown)


def _text(exchange: ObservedExchange, k: int, channels: ObservedChannels, answers: Answers) -> tuple[str, str]:
    """The form of text: literal if constant, factors for words, a set for varying characters; and a note."""
    column = exchange.columns[k]
    varying = _word(exchange, k, answers)
    words = set(varying.words)
    owner = _owner(exchange, k, varying, channels)
    if owner is not None and words != {""}:
        table = next((table for table in answers.factors if words <= set(factor_words(table))), "")
        if not table and len(words) > 1 and all(map(is_wire_unit, words)):
            unit = channels.unit(exchange, owner)
            table = "|".join(f"{word}={unit_factor(wire_unit(word), unit):.12g}" for word in sorted(words))
        if table:
            name = "" if channels.single else f"({channels.name(exchange, owner)})"
            factors = f"%{name}{{{escaped(table.encode('latin-1'))}}}"
            return _literal(varying.before) + factors + _literal(varying.behind), ""
    if len({len(part.text) for part in column}) > 1:
        return _literal(varying.before) + "%*?[ ]" + _literal(varying.behind), ""
    return _characters(column)


def _word(exchange: ObservedExchange, k: int, answers: Answers) -> VaryingWord:
    """The varying word in column `k`, or one beside a number that a table of factors has."""
    column = exchange.columns[k]
    varying = varying_word([part.text for part in column])
    if len(set(varying.words)) > 1:
        return varying
    text = exchange.texts(k)[0]
    for word in {word for table in answers.factors for word in factor_words(table)} - {"", " "}:
        if k > 0 and text.lstrip(" ").startswith(word):
            at = text.index(word)
        elif k < len(exchange.columns) - 1 and text.rstrip(" ").endswith(word):
            at = text.rindex(word)
        else:
            continue
        return VaryingWord(text[:at], (word,), text[at + len(word) :])
    return VaryingWord(text, ("",), "")


def _owner(exchange: ObservedExchange, k: int, varying: VaryingWord, channels: ObservedChannels) -> int | None:
    """The channel's column of a word in column `k`: the one directly before it, if any."""
    before, behind = (channels.is_read(exchange, place) for place in (k - 1, k + 1))
    if before and (not behind or not varying.before.strip(" ")):
        return k - 1
    return k + 1 if behind else None


def _characters(column: ReplyColumn) -> tuple[str, str]:
    form, seen = "", []
    for index in range(len(column[0].text)):
        characters = sorted({part.text[index : index + 1] for part in column})
        if len(characters) == 1:
            form += escaped(characters[0], "%")
            continue
        # - ^ and ] have a meaning inside a set: they stand last
        members = sorted(characters, key=lambda character: character in b"-^]")
        form += "%*1[" + "".join(map(escaped, members)) + "]"
        seen.append(repr(b"".join(characters)))
    return form, f"look up what else can stand where only {', '.join(seen)} were seen" if seen else ""


def _literal(text: str) -> str:
    return escaped(text.encode("latin-1"), "%")
