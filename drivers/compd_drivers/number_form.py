"""Form of a number in a reply: the output of printf as a pattern, and the words that multiply it."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property
from random import Random
from typing import Literal, Self

DecimalMark = Literal[".", ","]
_SIGNS = {"+": r" *[+-] *", " ": r"(?: *[+-]| ) *", "": r" *[+-]? *"}


@dataclass(frozen=True)
class NumberForm:
    """One number: its channel ("" if not named), printf's kind, flags, width and decimals, and the decimal mark."""

    channel: str
    kind: str
    flags: str
    width: int | None
    decimals: int | None
    mark: DecimalMark

    def __post_init__(self) -> None:
        """ValueError for an impossible form."""
        if self.decimals is not None and (self.kind in "dx" or (self.decimals == 0 and self.kind == "f")):
            raise ValueError("decimals belong to %f and %e, and %f has at least one")
        if self.kind == "x" and "+" in self.flags and self.width is None:
            raise ValueError("two's complement needs the number's width: %+4x")

    @cached_property
    def text(self) -> str:
        """The pattern of the number alone."""
        sign = _SIGNS["+" if "+" in self.flags else " " if " " in self.flags else ""]
        mark = re.escape(self.mark)
        places = "+" if self.decimals is None else f"{{{self.decimals}}}"
        fraction = rf"(?:{mark}[0-9]+)?" if self.decimals is None else rf"{mark}[0-9]{places}" if self.decimals else ""
        return {
            "f": rf"{sign}[0-9]*{mark}[0-9]{places}",
            "e": rf"{sign}[0-9]+{fraction}[Ee][+-]?[0-9]+",
            "d": rf"{sign}[0-9]+",
            "x": "[0-9A-Fa-f]+",
        }[self.kind]

    @property
    def place(self) -> str:
        """The pattern of its place: as wide as the number, if that is known."""
        return self.text if self.width is None else f"{characters(self.kind, self.mark)}{{{self.width}}}"

    @cached_property
    def _matches(self) -> re.Pattern[bytes]:
        return re.compile(self.text.encode("latin-1"))

    def value(self, text: bytes, unsigned: bool) -> float | None:
        """The number in a text; None if it is none. unsigned : the sign stands outside the number."""
        if not self._matches.fullmatch(text) or (unsigned and re.match(rb" *[+-]", text)):
            return None
        digits = text.replace(b" ", b"")
        if self.kind != "x":
            return float(digits.replace(self.mark.encode(), b"."))
        value, bits = int(digits, 16), 4 * (self.width or 0)
        return float(value - (1 << bits) if "+" in self.flags and value >> bits - 1 else value)

    def sample(self, random: Random, unsigned: bool) -> bytes:
        """A number as printf prints it."""
        if self.kind == "x":
            length = self.width or 4
            return f"{random.getrandbits(4 * length):0{length}X}".encode()
        places = 3 if self.decimals is None and self.kind in "fe" else self.decimals or 0
        whole = 2 if self.width is None else max(0, self.width - 1 - (places + 1 if self.kind == "f" else 0))
        value = random.uniform(0 if unsigned else -1, 1) * 10.0**whole
        form = f"%{self.flags}{self.width or ''}" + (f".{places}{self.kind}" if self.kind in "fe" else self.kind)
        text: str = form % (int(value) if self.kind == "d" else value)
        return text.replace(".", self.mark).encode()


def characters(kind: str, mark: DecimalMark) -> str:
    """The characters of a number of this kind, as a set."""
    return {
        "f": rf"[+\- 0-9{mark}]",
        "d": r"[+\- 0-9]",
        "e": rf"[+\- 0-9{mark}Ee]",
        "x": r"[0-9A-Fa-f]",
    }[kind]


@dataclass(frozen=True)
class FactorWords:
    """Words beside a number, each of which multiplies it: {mm=1|um=0.001} for the unit, {+=1|-=-1} for the sign."""

    channel: str
    factors: dict[str, float]

    @classmethod
    def of(cls, channel: str, text: str) -> Self:
        """ValueError unless it is WORD=FACTOR, separated by |."""
        factors: dict[str, float] = {}
        for part in text.split("|"):
            word, equals, factor = part.rpartition("=")
            try:
                value = float(factor) if equals else 0.0
            except ValueError:
                value = 0.0
            if not value or not math.isfinite(value):
                raise ValueError(f"{part!r} is not WORD=FACTOR, such as mm=1")
            if re.search(r"[0-9.,]", word):
                raise ValueError(f"{word!r} could be digits of the number: a word has none")
            if word in factors:
                raise ValueError(f"{word!r} stands twice")
            factors[word] = value
        return cls(channel, factors)

    @property
    def turns_sign(self) -> bool:
        """Whether the number's sign is here, so that it has none of its own."""
        return any(factor < 0 for factor in self.factors.values())

    @property
    def pattern(self) -> str:
        """The longest word first, so that `mm` does not match `m`."""
        return "|".join(re.escape(word) for word in sorted(self.factors, key=len, reverse=True))
