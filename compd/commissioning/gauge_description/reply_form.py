"""What a gauge's replies look like, in the language of a description."""

from __future__ import annotations

from compd.commissioning.gauge_description.answers import SKIPPED, Answers, factor_words
from compd.commissioning.gauge_description.number_converter import number_converter, skipped_converter
from compd.commissioning.gauge_description.observed_channels import ObservedChannels
from compd.commissioning.gauge_description.observed_exchange import ObservedExchange
from compd.commissioning.gauge_description.reply_columns import ReplyColumn, VaryingWord, varying_word
from compd.commissioning.gauge_description.unit_words import is_wire_unit, wire_unit
from compd.units import unit_factor


def reply_form(exchange: ObservedExchange, channels: ObservedChannels, answers: Answers) -> tuple[str, list[str]]:
    """The `in` of a description, as narrow as the replies, and notes on what to look up in the manual."""
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
    r"""As a description writes it: \r \n \t \\ \xHH; characters of `double` twice."""
    named = {0x0D: r"\r", 0x0A: r"\n", 0x09: r"\t", 0x5C: r"\\"}
    shown = (named.get(b) or (chr(b) if 0x20 <= b < 0x7F else f"\\x{b:02x}") for b in text)
    return "".join(2 * character if character in double else character for character in shown)


def _text(exchange: ObservedExchange, k: int, channels: ObservedChannels, answers: Answers) -> tuple[str, str]:
    """Text that never changed, literally; words that multiply a number; characters that varied, as a set; a note."""
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
    """The word in column `k` in which the replies differ, or one beside a number that a table of factors has."""
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
    """The column of the channel that a word in column `k` belongs to: before it, where nothing stands between."""
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
