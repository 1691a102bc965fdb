r"""What a reply must look like: text with converters, in the manner of StreamDevice and printf.

Everything is literal but a backslash and a percent sign:

    \r \n \t \\ \x02      bytes by their code (in YAML write such text in quotes)
    %%                    a percent sign
    %f                    number with a decimal point:   +12.345   -.5   "   1.0"
    %+09.4f               exactly as printf prints it: 9 characters, 4 of them decimals, sign always
    %d   %+06d            whole number, without or with its exact width
    %e                    number with an exponent:  +1.2345E-03
    %x   %4x              hexadecimal number, without sign
    %+4x                  hexadecimal number in two's complement of its width: FFFF is -1
    %(name)f              the number of channel `name`; the name may be left out where there is one channel
    %*5c   %*s            skip five characters; skip what is not blank
    %*[<>=]   %*2[0-9]    skip one or more (or exactly two) characters out of a set
    %*?[<>= ]             skip any number of them, also none
    %<sum8>   %0<xor8>    checksum of all before it, as bytes, or as hexadecimal digits;
    %1<sum8>   %01<xor8>  leaving out the first byte

Give width and decimals wherever the manual shows them: a digit lost on the wire is then found.
A width counts characters, blanks and sign included; leading zeros may come as blanks. Flag + : the sign is always
there; flag blank: a sign or a blank is always there. What is skipped never takes the sign or a digit of a
number beside it; where both have a width, skipped digits may follow a number: `%+08.3f%*2c`.
Sources: StreamDevice (format converters, checksums), C printf.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from random import Random
from typing import Literal, cast

from compd_drivers.checksums import CHECKSUMS, ChecksumKind

OPEN_LENGTH = 32  # bytes of a number or a skipped part without width: more than any instrument sends
_ESCAPE = re.compile(r"\\(?:x([0-9A-Fa-f]{2})|(.))", re.DOTALL)
_ESCAPES = {"r": "\r", "n": "\n", "t": "\t", "\\": "\\"}
_CONVERTER = re.compile(
    r"%(?:(?P<percent>%)"
    r"|(?P<hex>0?)(?P<skip>\d*)<(?P<checksum>\w+)>"
    r"|(?P<star>\*)?(?P<optional>\?)?(?:\((?P<name>\w+)\))?(?P<flags>[+ 0]*)(?P<width>\d+)?(?:\.(?P<decimals>\d+))?"
    r"(?:(?P<kind>[fdexcs])|\[(?P<set>\^?\]?[^\]]*)\]))",
)
_BYTE = struct.Struct("B").pack
_SIGNS = {"+": r" *[+-] *", " ": r"(?: *[+-]| ) *", "": r" *[+-]? *"}
_CHARACTERS = {"f": r"[+\- 0-9.]", "d": r"[+\- 0-9]", "e": r"[+\- 0-9.Ee]", "x": r"[0-9A-Fa-f]"}


def unescape(text: str) -> bytes:
    r"""Bytes for text with \r \n \t \\ \xHH. ValueError for another escape, or a character beyond \xff."""

    def byte(match: re.Match[str]) -> str:
        if match[1]:
            return chr(int(match[1], 16))
        if match[2] not in _ESCAPES:
            raise ValueError(f"unknown escape \\{match[2]}; there are \\r \\n \\t \\\\ and \\xHH")
        return _ESCAPES[match[2]]

    if text.endswith("\\") and not text.endswith("\\\\"):
        raise ValueError("a single backslash at the end; write \\\\")
    try:
        return _ESCAPE.sub(byte, text).encode("latin-1")
    except UnicodeEncodeError as error:
        raise ValueError(f"{text[error.start]!r} is not a single byte; write its code as \\xHH") from error


@dataclass(frozen=True)
class _Number:
    """A number in the reply: its channel ("" if not named), and how its text must read."""

    channel: str
    kind: str
    text: re.Pattern[bytes]
    signed_bits: int  # of a hexadecimal number in two's complement; 0 for every other


@dataclass(frozen=True)
class _ChecksumField:
    """A checksum in the reply: of the bytes from `start` up to its group `group`."""

    group: str
    kind: ChecksumKind
    start: int
    hexadecimal: bool

    def of(self, data: bytes) -> bytes:
        """The checksum of `data` as it stands in the reply."""
        checksum = CHECKSUMS[self.kind].of(data)
        return checksum[::-1].hex().upper().encode() if self.hexadecimal else checksum


class ReplyFormat:
    """A format, ready to match replies.

    channels : names of its numbers, in order; "" for one that is not named.
    length : bytes of the reply where the format fixes it, else None.
    longest : bytes of the longest reply that is waited for.
    beginning : the literal bytes before all else.
    """

    def __init__(self, text: str, instead: Mapping[str, Collection[bytes]] | None = None) -> None:
        """`instead`: by channel, what may stand in place of its number. ValueError says what is wrong."""
        self._instead = instead or {}
        self._numbers: list[_Number] = []
        self._checks: list[_ChecksumField] = []
        self._before: Literal["fixed", "number", "number of open width", "skipped"] = "fixed"  # what stands before
        self._samples: list[Callable[[Random, bytes], bytes]] = []  # each part, behind what stands before it
        self.length: int | None = 0
        self.longest = 0
        self.literal = b""  # all that is literal, for counting terminators
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
                pattern += self._converter(match)
            at = match.end()
        self._pattern = re.compile((pattern + self._literally(source[at:])).encode("latin-1"), re.DOTALL)
        self.beginning = self.literal if beginning is None else beginning

    @property
    def channels(self) -> tuple[str, ...]:
        return tuple(number.channel for number in self._numbers)

    @property
    def has_checksum(self) -> bool:
        """Whether damage is found by more than its shape."""
        return bool(self._checks)

    def match(self, reply: bytes) -> tuple[float | bytes, ...] | None:
        """Per number its value, or the bytes that stand in its place; None if the reply is anything else.

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
            elif number.text.fullmatch(text):
                values.append(_value(number, text))
            else:
                return None
        return tuple(values)

    def samples(self, count: int) -> Iterator[bytes]:
        """`count` replies of this form with numbers, and skipped characters, of every kind; the same in every run."""
        random = Random(0)
        for _ in range(count):
            reply = b""
            for part in self._samples:
                reply += part(random, reply)
            if self.match(reply) is not None:
                yield reply

    def checksum_fails(self, reply: bytes) -> bool:
        """Whether the reply has the right form and a wrong checksum."""
        match = self._pattern.fullmatch(reply)
        return match is not None and not self._fits(match, reply)

    def _fits(self, match: re.Match[bytes], reply: bytes) -> bool:
        for check in self._checks:
            expected = check.of(reply[check.start : match.start(check.group)])
            received = match[check.group]
            if (received.upper() if check.hexadecimal else received) != expected:
                return False
        return True

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

    def _longer(self, by: int | None) -> None:
        self.longest += OPEN_LENGTH if by is None else by
        self.length = None if self.length is None or by is None else self.length + by

    def _converter(self, match: re.Match[str]) -> str:
        if match["checksum"]:
            return self._checksum(match)
        if match["kind"] in tuple("fdex") and not match["star"]:
            return self._number(match)
        if not match["star"]:
            raise ValueError(f"{match[0]}: only numbers are read; write %*... to skip this")
        if match["flags"] or match["decimals"] or match["name"]:
            raise ValueError(f"{match[0]}: only a width belongs to what is skipped")
        return self._skipped(match)

    def _skipped(self, match: re.Match[str]) -> str:
        width = int(match["width"]) if match["width"] else None
        kind = match["kind"]
        if kind == "c":
            width = width or 1
        characters = "." if kind == "c" else _CHARACTERS.get(kind, r"[^ \t\r\n]") if kind else _set(match["set"])
        # what is skipped must not take digits of the number before it, which it cannot where both have a width
        both_fixed = self._before == "number" and width is not None and not match["optional"]
        whole = r"(?![0-9.])" if self._before.startswith("number") and not both_fixed else ""
        of_the_set = re.compile(characters.encode("latin-1"), re.DOTALL)
        allowed = [byte for byte in map(_BYTE, range(256)) if of_the_set.fullmatch(byte)]
        length = 0 if match["optional"] else width or 1
        self._samples.append(lambda random, before: b"".join(random.choices(allowed, k=length)))
        if match["optional"]:
            self._longer(None)
            self._before = "skipped"
            return f"{whole}{characters}*" if width is None else f"{whole}{characters}{{0,{width}}}"
        self._longer(width)
        self._before = "skipped"
        return f"{whole}{characters}+" if width is None else f"{whole}{characters}{{{width}}}"

    def _number(self, match: re.Match[str]) -> str:
        kind, flags = match["kind"], match["flags"] or ""
        width = int(match["width"]) if match["width"] else None
        decimals = int(match["decimals"]) if match["decimals"] else None
        if match["optional"]:
            raise ValueError(f"{match[0]}: a number cannot be optional")
        if decimals is not None and (kind in "dx" or decimals == 0):
            raise ValueError(f"{match[0]}: decimals belong to %f and %e, and there is at least one")
        sign = _SIGNS["+" if "+" in flags else " " if " " in flags else ""]
        places = "+" if decimals is None else f"{{{decimals}}}"
        body = {
            "f": rf"{sign}[0-9]*\.[0-9]{places}",
            "e": rf"{sign}[0-9]+\.[0-9]{places}[Ee][+-]?[0-9]+",
            "d": rf"{sign}[0-9]+",
            "x": "[0-9A-Fa-f]+",
        }[kind]
        name = match["name"] or ""
        if name in self.channels:
            raise ValueError(f"{match[0]}: channel {name!r} stands twice in the reply")
        signed = kind == "x" and "+" in flags
        if signed and width is None:
            raise ValueError(f"{match[0]}: two's complement needs the number's width: %+4x")
        group = f"n{len(self._numbers)}"
        self._numbers.append(_Number(name, kind, re.compile(body.encode()), 4 * width if signed and width else 0))
        self._samples.append(lambda random, before: _sample(random, kind, flags, width, decimals))
        words = [re.escape(word.decode("latin-1")) for word in sorted(self._instead.get(name, ()), key=len)]
        lengths = {len(word) for word in self._instead.get(name, ())} | {width}
        self._longer(width if len(lengths) == 1 else None)
        exact = body if width is None else f"{_CHARACTERS[kind]}{{{width}}}"
        # nor may it take the sign or a digit of this one; and a number of open width ends with its last digit
        begins = r"(?:(?<![0-9.+\-])|(?<![.+\-])(?=[+\- ]))" if self._before == "skipped" else ""
        ends = "" if width or decimals else r"(?![0-9A-Fa-f])" if kind == "x" else r"(?![0-9.])"
        self._before = "number" if len(lengths) == 1 and width else "number of open width"
        return f"{begins}(?P<{group}>{'|'.join([*words, exact])}){ends}"

    def _checksum(self, match: re.Match[str]) -> str:
        if match["checksum"] not in CHECKSUMS:
            raise ValueError(f"{match[0]}: no such checksum; there are {', '.join(CHECKSUMS)}")
        length = CHECKSUMS[cast(ChecksumKind, match["checksum"])].length
        self._before = "fixed"
        group = f"c{len(self._checks)}"
        self._checks.append(
            _ChecksumField(group, cast(ChecksumKind, match["checksum"]), int(match["skip"] or 0), bool(match["hex"]))
        )
        self._longer(2 * length if match["hex"] else length)
        check = self._checks[-1]
        self._samples.append(lambda random, before: check.of(before[check.start :]))
        return f"(?P<{group}>[0-9A-Fa-f]{{{2 * length}}})" if match["hex"] else f"(?P<{group}>.{{{length}}})"


def _set(text: str) -> str:
    """A StreamDevice set as a regular expression: a leading ^ turns it round, a-z is a range."""
    turned, members = ("^", text[1:]) if text.startswith("^") else ("", text)
    if not members:
        raise ValueError("%*[]: a set without members")
    members = re.sub(r"([\[\]\\^&~|])", r"\\\1", members)
    return f"[{turned}{members}]"


def _value(number: _Number, text: bytes) -> float:
    digits = text.replace(b" ", b"")
    if number.kind != "x":
        return float(digits)
    value = int(digits, 16)
    return float(value - (1 << number.signed_bits) if number.signed_bits and value >> number.signed_bits - 1 else value)


def _sample(random: Random, kind: str, flags: str, width: int | None, decimals: int | None) -> bytes:
    """A number as printf prints it."""
    if kind == "x":
        length = width or 4
        return f"{random.getrandbits(4 * length):0{length}X}".encode()
    places = 3 if decimals is None and kind in "fe" else decimals or 0
    whole = 2 if width is None else max(0, width - 1 - (places + 1 if kind == "f" else 0))
    value = random.uniform(-1, 1) * 10.0**whole
    text = f"%{flags}{width or ''}" + (f".{places}{kind}" if kind in "fe" else kind)
    return (text % (int(value) if kind == "d" else value)).encode()
