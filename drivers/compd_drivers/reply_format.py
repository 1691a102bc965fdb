r"""Form of a reply: text with converters, in the manner of StreamDevice and printf.

Everything is literal but a backslash and a percent sign:

    \r \n \t \\ \x02      bytes by their code (in YAML write such text in quotes)
    %%                    a percent sign
    %f                    number with a decimal point:   +12.345   -.5   "   1.0"
    %+09.4f               exactly as printf prints it: 9 characters, 4 of them decimals, sign always
    %d   %+06d            whole number, without or with its exact width
    %e   %.0e             number with an exponent:  +1.2345E-03  1E-3;  with no decimals: only the latter
    %x   %4x              hexadecimal number, without sign
    %+4x                  hexadecimal number in two's complement of its width: FFFF is -1
    %(name)f              the number of channel `name`; the name may be left out where there is one channel
    %(name){mm=1|um=0.001}  one of these words, before or behind the number, which it multiplies: its unit
    %(name){+=1|-=-1}     its sign, which then does not stand in the number
    %*5c   %*s            skip five characters; skip what is not blank
    %*[<>=]   %*2[0-9]    skip one or more (or exactly two) characters out of a set
    %*?[<>= ]             skip any number of them, also none
    %<sum8>   %0<xor8>    checksum of all before it, as bytes, or as hexadecimal digits;
    %#<sum100>            as decimal digits;
    %1<sum8>   %01<xor8>  leaving out the first byte; %01.1<xor8>: the first and the last one (NMEA's $ and *)

Give width and decimals wherever the manual shows them: a digit lost on the wire is then found.
A width counts characters, blanks and sign included; leading zeros may come as blanks. Flag + : the sign is always
there; flag blank: a sign or a blank is always there. What is skipped never takes the sign or a digit of a
number beside it; where both have a width, skipped digits may follow a number: `%+08.3f%*2c`. A decimal comma is the
option `decimal_mark: ","`.
Sources: StreamDevice (format converters, enumerations, checksums), C printf.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Collection, Iterator, Mapping
from random import Random
from typing import Literal, Self, cast

from compd.lines import CHECKSUMS, ChecksumField, ChecksumKind
from compd.text import unescape
from compd_drivers.no_number import full_scale
from compd_drivers.number_form import DecimalMark, FactorWords, NumberForm, characters

OPEN_LENGTH = 32  # most bytes of a number without width: above those of any instrument
OPEN_SKIPPED = 256  # most bytes of a skipped part without width, such as the rest of a protocol's line
_CONVERTER = re.compile(
    r"%(?:(?P<percent>%)"
    r"|(?P<digits>[0#]?)(?P<skip>\d*)(?:\.(?P<behind>\d+))?<(?P<checksum>\w+)>"
    r"|(?P<star>\*)?(?P<optional>\?)?(?:\((?P<name>\w+)\))?(?P<flags>[+ 0]*)(?P<width>\d+)?(?:\.(?P<decimals>\d+))?"
    r"(?:(?P<kind>[fdexcs])|\[(?P<set>\^?\]?[^\]]*)\]|\{(?P<words>[^}]*)\}))",
)
_BYTE = struct.Struct("B").pack


class MultipliedNumber(float):
    """A number that a unit beside it has multiplied. raw : the number as it was sent, with its sign."""

    def __new__(cls, value: float, raw: float) -> Self:
        number = super().__new__(cls, value)
        number.raw = raw
        return number

    raw: float


class ReplyFormat:
    """A format, ready to match replies.

    channels : names of its numbers, in order; "" for one that is not named.
    length : bytes of the reply where the format fixes it, else None.
    longest : bytes of the longest reply that is waited for.
    beginning : the literal bytes before all else.
    """

    def __init__(
        self, text: str, instead: Mapping[str, Collection[bytes]] | None = None, mark: DecimalMark = "."
    ) -> None:
        """`instead`: alternatives to the number, by channel. ValueError names the fault."""
        self._instead = instead or {}
        self._mark = mark
        self._numbers: list[NumberForm] = []
        self._words: list[FactorWords] = []
        self._checks: list[ChecksumField] = []
        self._before: Literal["fixed", "number", "number of open width", "skipped"] = "fixed"  # the parts before
        self._samples: list[Callable[[Random, bytes], bytes]] = []  # each part, behind the parts before it
        self.length: int | None = 0
        self.longest = 0
        self.literal = b""  # all literal text, for counting terminators
        source = unescape(text).decode("latin-1")
        pattern = ""
        at = 0
        beginning = None
        for match in _CONVERTER.finditer(source):
            pattern += self._literally(source[at : match.start()])
            if match["percent"]:
                pattern += self._fixed("%")
            else:
                beginning = self.literal if beginning is None else beginning
                try:
                    pattern += self._converter(match)
                except ValueError as error:
                    raise ValueError(f"{match[0]}: {error}") from error
            at = match.end()
        self._pattern = re.compile((pattern + self._literally(source[at:])).encode("latin-1"), re.DOTALL)
        self.beginning = self.literal if beginning is None else beginning
        for words in self._words:
            if words.channel not in self.channels:
                raise ValueError(f"words for {words.channel or 'a number'}, which is not in the reply")

    @property
    def channels(self) -> tuple[str, ...]:
        return tuple(number.channel for number in self._numbers)

    def full_scale(self, number: int) -> frozenset[float]:
        """The full-scale words of a hexadecimal number of known width, by its index among the numbers."""
        form = self._numbers[number]
        return full_scale(4 * (form.width or 0), "+" in form.flags) if form.kind == "x" else frozenset()

    @property
    def has_checksum(self) -> bool:
        """Whether damage is detected by more than the reply's shape."""
        return bool(self._checks)

    def match(self, reply: bytes) -> tuple[float | bytes, ...] | None:
        """Value of each number, or the bytes in its place; None for any other reply.

        A reply whose checksum does not fit is no match either: see `checksum_fits`.
        """
        match = self._pattern.fullmatch(reply)
        if match is None or not self._fits(match, reply):
            return None
        values: list[float | bytes] = []
        for k, number in enumerate(self._numbers):
            text = match[f"n{k}"]
            if text in self._instead.get(number.channel, ()):
                values.append(text)
                continue
            value = number.value(text, self._sign_is_elsewhere(number.channel))
            if value is None:
                return None
            raw = value
            for index, words in enumerate(self._words):
                if words.channel == number.channel:
                    factor = words.factors[match[f"w{index}"].decode("latin-1")]
                    value *= factor
                    raw *= math.copysign(1.0, factor)
            values.append(value if raw == value else MultipliedNumber(value, raw))
        return tuple(values)

    def samples(self, count: int) -> Iterator[bytes]:
        """`count` replies of this form with numbers, and skipped characters, of every kind; the same in every run."""
        random = Random(0)
        for _ in range(count):
            reply = b""
            try:
                for part in self._samples:
                    reply += part(random, reply)
            except ValueError:  # skipped text has no checksum
                continue
            if self.match(reply) is not None:
                yield reply

    def checksum_fails(self, reply: bytes) -> bool:
        """Whether the reply has the right form and a wrong checksum."""
        match = self._pattern.fullmatch(reply)
        return match is not None and not self._fits(match, reply)

    def _fits(self, match: re.Match[bytes], reply: bytes) -> bool:
        for check in self._checks:
            try:
                expected = check.of(reply[: match.start(check.group)])
            except ValueError:
                return False
            received = match[check.group]
            if (received.upper() if check.digits else received) != expected:
                return False
        return True

    def _sign_is_elsewhere(self, channel: str) -> bool:
        """Whether a word beside the channel's number gives its sign."""
        return any(words.turns_sign for words in self._words if words.channel == channel)

    def _literally(self, text: str) -> str:
        if "%" in text:
            raise ValueError(f"not a converter: {text[text.index('%') :]!r}; a percent sign is %%")
        return self._fixed(text)

    def _fixed(self, text: str) -> str:
        if text:
            self._before = "fixed"
        self._longer(len(text))
        data = text.encode("latin-1")
        self.literal += data
        self._samples.append(lambda random, before: data)
        return re.escape(text)

    def _longer(self, by: int | None, at_most: int = OPEN_LENGTH) -> None:
        self.longest += at_most if by is None else by
        self.length = None if self.length is None or by is None else self.length + by

    def _converter(self, match: re.Match[str]) -> str:
        if match["checksum"]:
            return self._checksum(match)
        if match["words"] is not None:
            return self._factor_words(match)
        if match["kind"] in tuple("fdex") and not match["star"]:
            return self._number(match)
        if not match["star"]:
            raise ValueError("only numbers are read; write %*... to skip this")
        if match["flags"] or match["decimals"] or match["name"]:
            raise ValueError("only a width belongs to what is skipped")
        return self._skipped(match)

    def _factor_words(self, match: re.Match[str]) -> str:
        if match["star"] or match["optional"] or match["flags"] or match["width"] or match["decimals"]:
            raise ValueError("only a name belongs to words")
        words = FactorWords.of(match["name"] or "", match["words"])
        group = f"w{len(self._words)}"
        self._words.append(words)
        lengths = {len(word) for word in words.factors}
        self._longer(lengths.pop() if len(lengths) == 1 else None)
        self._samples.append(lambda random, before: random.choice(list(words.factors)).encode("latin-1"))
        self._before = "fixed"
        return f"(?P<{group}>{words.pattern})"

    def _skipped(self, match: re.Match[str]) -> str:
        width = int(match["width"]) if match["width"] else None
        kind = match["kind"]
        if kind == "c":
            width = width or 1
        of_kind = "." if kind == "c" else r"[^ \t\r\n]" if kind == "s" else characters(kind, self._mark) if kind else ""
        skipped = of_kind or _set(match["set"])
        # skipped text must not take digits of the preceding number; widths of both prevent it
        both_fixed = self._before == "number" and width is not None and not match["optional"]
        whole = self._digits_end if self._before.startswith("number") and not both_fixed else ""
        of_the_set = re.compile(skipped.encode("latin-1"), re.DOTALL)
        allowed = [byte for byte in map(_BYTE, range(256)) if of_the_set.fullmatch(byte)]
        length = 0 if match["optional"] else width or 1
        self._samples.append(lambda random, before: b"".join(random.choices(allowed, k=length)))
        self._longer(None if match["optional"] else width, width or OPEN_SKIPPED)
        self._before = "skipped"
        if match["optional"]:
            return f"{whole}{skipped}*" if width is None else f"{whole}{skipped}{{0,{width}}}"
        return f"{whole}{skipped}+" if width is None else f"{whole}{skipped}{{{width}}}"

    @property
    def _digits_end(self) -> str:
        """Parts that must not follow a number of open width."""
        return rf"(?![0-9{self._mark}])"

    def _number(self, match: re.Match[str]) -> str:
        width = int(match["width"]) if match["width"] else None
        decimals = int(match["decimals"]) if match["decimals"] else None
        if match["optional"]:
            raise ValueError("a number cannot be optional")
        name = match["name"] or ""
        if name in self.channels:
            raise ValueError(f"channel {name!r} is twice in the reply")
        number = NumberForm(name, match["kind"], match["flags"] or "", width, decimals, self._mark)
        group = f"n{len(self._numbers)}"
        self._numbers.append(number)
        self._samples.append(lambda random, before: number.sample(random, self._sign_is_elsewhere(name)))
        words = [re.escape(word.decode("latin-1")) for word in sorted(self._instead.get(name, ()), key=len)]
        lengths = {len(word) for word in self._instead.get(name, ())} | {width}
        self._longer(width if len(lengths) == 1 else None)
        # nor the sign or a digit of this one; and a number of open width ends with its last digit
        mark = re.escape(self._mark)
        begins = rf"(?:(?<![0-9{mark}+\-])|(?<![{mark}+\-])(?=[+\- ]))" if self._before == "skipped" else ""
        ends = "" if width or decimals else r"(?![0-9A-Fa-f])" if number.kind == "x" else self._digits_end
        self._before = "number" if len(lengths) == 1 and width else "number of open width"
        return f"{begins}(?P<{group}>{'|'.join([*words, number.place])}){ends}"

    def _checksum(self, match: re.Match[str]) -> str:
        if match["checksum"] not in CHECKSUMS:
            raise ValueError(f"no such checksum; there are {', '.join(CHECKSUMS)}")
        kind, digits = cast(ChecksumKind, match["checksum"]), cast(Literal["", "0", "#"], match["digits"])
        group = f"c{len(self._checks)}"
        check = ChecksumField(group, kind, int(match["skip"] or 0), int(match["behind"] or 0), digits)
        self._checks.append(check)
        self._before = "fixed"
        self._longer(check.length)
        self._samples.append(lambda random, before: check.of(before))
        characters_of_it = {"": ".", "0": "[0-9A-Fa-f]", "#": "[0-9]"}[digits]
        return f"(?P<{group}>{characters_of_it}{{{check.length}}})"


def _set(text: str) -> str:
    """A StreamDevice set as a regular expression: a leading ^ negates it, a-z is a range."""
    turned, members = ("^", text[1:]) if text.startswith("^") else ("", text)
    if not members:
        raise ValueError("%*[]: a set without members")
    members = re.sub(r"([\[\]\\^&~|])", r"\\\1", members)
    return f"[{turned}{members}]"
