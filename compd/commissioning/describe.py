"""From observed replies of an unknown gauge to a `serial_ascii` description, or to why there is none.

What never changed is taken for constant text, numbers with a decimal point (and whole numbers that changed) for
channels. The description is as narrow as the replies: a width that never changed must not change.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml
from pydantic import ValidationError

from compd.commissioning.ambiguities import DescriptionError, ReplyPart, ambiguities
from compd.errors import Problem
from compd.gauge import Gauge, LineFault, Quality
from compd.plugins import GAUGES, load

FEWEST_REPLIES = 3
_NUMBER = re.compile(rb" *[+-]? *\d+\.\d+[eE][+-]?\d+| *[+-]? *\d*\.\d+| *[+-] *\d+|\d+")


@dataclass(frozen=True)
class GaugeDescription:
    """Options for the driver `serial_ascii` (without `line`), and notes on what to look up in the manual."""

    options: Mapping[str, Any]
    notes: tuple[str, ...]

    def as_yaml(self) -> str:
        """An entry for `gauges:` in a configuration, with names to be replaced for the gauge and its line."""
        return yaml.safe_dump({"learned_gauge": {**self.options, "line": "name_of_its_line"}}, sort_keys=False)


def learn_gauge(
    request: bytes,
    replies: Sequence[bytes],
    unit: str,
    names: Sequence[str] = (),
    errors: Mapping[bytes, str] = {},
    ignored: str = "",
    decimals: int | None = None,
) -> tuple[GaugeDescription, list[str]]:
    """The description of a gauge, and the values that it gives of every reply. Parameters as for `describe_replies`.

    Raises DescriptionError where no description follows, or where a reply does not fit the one that does.
    """
    description = describe_replies(request, replies, unit, names, errors, ignored, decimals)
    return description, read_replies(description, load(GAUGES, "serial_ascii", "driver serial_ascii"), replies)


def describe_replies(
    request: bytes,
    replies: Sequence[bytes],
    unit: str,
    names: Sequence[str] = (),
    errors: Mapping[bytes, str] = {},
    ignored: str = "",
    decimals: int | None = None,
) -> GaugeDescription:
    """The description of a gauge that answered `request` (b"": it speaks unasked) by `replies`.

    unit : of every number on the wire.
    names : of the channels; "value", or 1, 2 ... if empty.
    errors : whole error replies without their terminator, and their quality.
    ignored : letters and signs that may vary beside a number and do not touch its value.
    decimals : how many the device shows; digits behind them are skipped. As many as came if None.
    Raises DescriptionError for too few replies that differ, for the first reply of another form, with its place, and
    for whatever beside a number may be its sign, its unit, an address or a checksum.
    """
    terminator = _terminator(replies)
    bodies = [reply[: len(reply) - len(terminator)] for reply in replies]
    bodies = [body for body in bodies if body not in errors]
    if len(set(bodies)) < FEWEST_REPLIES:
        raise DescriptionError(
            Problem(
                where="replies",
                what="too few that differ",
                value=str(len(set(bodies))),
                allowed=f"{FEWEST_REPLIES} or more",
                next_step="move the gauge between two captures: near zero, far out, and to the other side",
            )
        )
    columns = _columns(bodies)
    numbers = [k for k, column in enumerate(columns) if _is_channel(column)]
    if not numbers:
        raise DescriptionError(Problem(where="replies", what="no number in them", value=repr(bodies[0])))
    if questions := ambiguities(columns, unit, ignored, decimals):
        raise DescriptionError(questions)
    chosen = list(names) or (["value"] if len(numbers) == 1 else [str(k + 1) for k in range(len(numbers))])
    if len(chosen) != len(numbers):
        raise DescriptionError(
            Problem(
                where="--names",
                what=f"{len(chosen)} names for {len(numbers)} numbers",
                value=", ".join(chosen),
                next_step=f"the numbers of the first reply are {[columns[k][0].text for k in numbers]}",
            )
        )
    form, notes = "", []
    for k, column in enumerate(columns):
        if k in numbers:
            name = chosen[numbers.index(k)]
            text, note = _converter([part.text for part in column], name if len(numbers) > 1 else "", decimals)
        else:
            text, note = _constant(column)
        form += text
        notes += [note] if note else []
    options: dict[str, Any] = {
        "driver": "serial_ascii",
        **({"out": escaped(request)} if request else {}),
        "in": form,
        "in_terminator": escaped(terminator),
        "channels": [{"name": name, "unit": unit} for name in chosen],
    }
    if errors:
        options["errors"] = [{"in": escaped(text, "%"), "quality": quality} for text, quality in errors.items()]
    return GaugeDescription(
        options, (*notes, "add each channel's `range` from the manual: what is beyond it is no measurement")
    )


def read_replies(description: GaugeDescription, driver: type[Gauge[Any]], replies: Sequence[bytes]) -> list[str]:
    """The values of every observed reply, read by the description with `driver` (serial_ascii), as text.

    Raises DescriptionError for options that the driver refuses, and for a reply that does not fit.
    """
    try:
        options = driver.Options.model_validate({**description.options, "line": "learned"})
    except ValidationError as error:
        raise DescriptionError(
            [Problem(where="description", what=detail["msg"], value=str(detail["input"])) for detail in error.errors()]
        ) from error
    texts = []
    for k, reply in enumerate(replies):
        line = _RepeatedReply(reply)
        try:
            readings = driver(options).read(line)
        except LineFault as fault:
            raise DescriptionError(
                Problem(
                    where=f"reply {k + 1}",
                    what=f"does not fit the description: {fault}",
                    value=repr(reply),
                    allowed=str(description.options["in"]),
                )
            ) from fault
        texts.append(", ".join(f"{r.value:.6g}" if r.ok else str(r.quality) for r in readings))
    return texts


def escaped(text: bytes, double: str = "") -> str:
    r"""As a description writes it: \r \n \t \\ \xHH; characters of `double` twice."""
    named = {0x0D: r"\r", 0x0A: r"\n", 0x09: r"\t", 0x5C: r"\\"}
    shown = (named.get(b) or (chr(b) if 0x20 <= b < 0x7F else f"\\x{b:02x}") for b in text)
    return "".join(2 * character if character in double else character for character in shown)


def _terminator(replies: Sequence[bytes]) -> bytes:
    """Control characters that end every reply; b"" if all are equally long without any."""
    if not replies or not all(replies):
        raise DescriptionError(
            Problem(where="replies", what="there is none, or an empty one", next_step="check port, baud and format")
        )
    ending = re.search(rb"[\x00-\x1f]*$", replies[0])
    terminator = ending[0] if ending else b""
    while not all(reply.endswith(terminator) for reply in replies):
        terminator = terminator[1:]
    if not terminator and len({len(reply) for reply in replies}) > 1:
        k = next(k for k, reply in enumerate(replies) if len(reply) != len(replies[0]))
        raise DescriptionError(
            Problem(
                where=f"reply {k + 1}",
                what="has no terminator in common with reply 1, and another length",
                value=repr(replies[k]),
                next_step="capture whole replies, each with its end",
            )
        )
    return terminator


def _parts(body: bytes) -> list[ReplyPart]:
    """Text and numbers in turn; the first and the last part are text, perhaps empty."""
    parts, start = [], 0
    for match in _NUMBER.finditer(body):
        parts += [ReplyPart(False, body[start : match.start()], start), ReplyPart(True, match[0], match.start())]
        start = match.end()
    return [*parts, ReplyPart(False, body[start:], start)]


def _columns(bodies: Sequence[bytes]) -> list[list[ReplyPart]]:
    """Column by column the parts of all replies. DescriptionError where one reply is built differently."""
    split = [_parts(body) for body in bodies]
    for k, parts in enumerate(split):
        for part, first in zip(parts, split[0], strict=False):
            if not part.is_number and len(part.text) != len(first.text):
                raise _difference(k, part.start, bodies[k], bodies[0])
            if part.is_number and (b"." in part.text) != (b"." in first.text):
                raise _difference(k, part.start, bodies[k], bodies[0])
        if len(parts) != len(split[0]):
            raise _difference(k, min(parts[-1].start, split[0][-1].start), bodies[k], bodies[0])
    return [list(column) for column in zip(*split, strict=True)]


def _difference(k: int, place: int, body: bytes, first: bytes) -> DescriptionError:
    """The error for reply `k`, which differs in form from the first one from byte `place` on."""
    return DescriptionError(
        Problem(
            where=f"reply {k + 1}, character {place + 1}",
            what="is built differently from reply 1",
            value=repr(body),
            allowed=repr(first),
            next_step="if it is an error reply, name it: --error 'TEXT=quality'; if it is damaged, capture it again",
        )
    )


def _is_channel(column: Sequence[ReplyPart]) -> bool:
    """A number with a point or a sign always counts; a bare whole number (an address, a name) if it changed."""
    if not column[0].is_number:
        return False
    bare = all(part.text.isdigit() for part in column)
    return not bare or len({part.text for part in column}) > 1


def _constant(column: Sequence[ReplyPart]) -> tuple[str, str]:
    """Text that never changed, literally; a character that did, as the set of all that came; and a note as above."""
    form, note = "", ""
    for place in range(len(column[0].text)):
        characters = sorted({part.text[place : place + 1] for part in column})
        if len(characters) == 1:
            form += escaped(characters[0], "%")
            continue
        # - ^ and ] have a meaning inside a set: they stand last
        members = sorted(characters, key=lambda character: character in b"-^]")
        form += "%*1[" + "".join(map(escaped, members)) + "]"
        note += f"{', ' if note else 'look up what else can stand where only '}{b''.join(characters)!r} were seen"
    return form, note


def _converter(texts: Sequence[bytes], name: str, shown_decimals: int | None) -> tuple[str, str]:
    """A number's converter, as narrow as the replies, and a note on what to look up in the manual ("" if nothing).

    shown_decimals : how many decimals belong to the number; the digits behind them are skipped.
    """
    exponent = any(b"e" in text.lower() for text in texts)
    decimals = {len(re.split(rb"[eE]", text)[0].partition(b".")[2]) if b"." in text else None for text in texts}
    signed = all(re.match(rb" *[+-]", text) for text in texts)
    blank = all(text[:1] in b"+- " for text in texts) and not signed
    fixed = len({len(text) for text in texts}) == 1
    zeros = fixed and all(re.match(rb"[+-]?0\d", text) for text in texts)
    note = ""
    head = tail = ""
    if not fixed:
        blanks = min(len(text) - len(text.lstrip(b" ")) for text in texts)
        head, blank = " " * blanks, False
        note = f"{name or 'the number'} has no fixed width: a digit lost on the wire cannot be found"
    (places,) = decimals if len(decimals) == 1 else (None,)
    width = len(texts[0]) if fixed else None
    point = any(b"." in text for text in texts)
    if point and places is None:
        note = f"{name or 'the number'} has no fixed count of decimals: a digit lost on the wire cannot be found"
    elif width and places and shown_decimals is not None and 0 < shown_decimals < places:
        skipped = places - shown_decimals
        width, places, tail = width - skipped, shown_decimals, f"%*{skipped}[0-9]"
        note = f"the {skipped} digits behind {name or 'the number'} are skipped: a checksum in them is not checked"
    if not point:
        note = f"{name or 'the number'} is a whole number: give its channel `decimals` or `scale`"
    return (
        head
        + "%"
        + (f"({name})" if name else "")
        + ("+" if signed else " " if blank else "")
        + ("0" if zeros else "")
        + (str(width) if width else "")
        + (f".{places}" if point and places else "")
        + ("e" if exponent else "f" if point else "d")
        + tail,
        note,
    )


class _RepeatedReply:
    """A line on which the same reply comes to every request."""

    def __init__(self, reply: bytes) -> None:
        self._reply = reply
        self._waiting = b""

    def send(self, request: bytes) -> float:
        self._waiting = self._reply
        return 0.0

    def next_line(
        self, terminator: bytes, limit: int, timeout_s: float | None = None, gap_timeout_s: float | None = None
    ) -> tuple[bytes, float]:
        """A device that speaks unasked says it again and again."""
        if not self._waiting:
            self._waiting = self._reply
        return self.receive_until(terminator, limit)[: -len(terminator)], 0.0

    def receive(self, count: int, timeout_s: float | None = None) -> bytes:
        if len(self._waiting) < count:
            raise LineFault(Quality.INCOMPLETE if self._waiting else Quality.TIMEOUT, repr(self._waiting))
        taken, self._waiting = self._waiting[:count], self._waiting[count:]
        return taken

    def receive_until(self, terminator: bytes, limit: int, timeout_s: float | None = None) -> bytes:
        end = self._waiting.find(terminator)
        if not 0 <= end <= limit - len(terminator):
            raise LineFault(Quality.MISMATCH, repr(self._waiting))
        return self.receive(end + len(terminator))

    def drain(self, quiet_s: float | None = None) -> bytes:
        return self.receive(len(self._waiting))
