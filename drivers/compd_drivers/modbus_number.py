"""Form of a number in Modbus registers: its type, the order of words and bytes, and its bits."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from compd_drivers.measured import DescriptionSection
from compd_drivers.no_number import MIN_BITS, full_scale

# fmt: off
NumberType = Literal[
    "int8", "uint8", "int16", "uint16", "int24", "uint24", "int32", "uint32", "int64", "uint64", "float32", "float64",
    "bcd8", "bcd16", "bcd24", "bcd32", "bit",
]
# fmt: on
Mask = Annotated[int, Field(ge=1, lt=1 << 64)]
FLOATS = {"float32": ">f", "float64": ">d"}
READ_BITS = (1, 2)


class RegisterNumber(DescriptionSection):
    """Position of a number's bits in the registers."""

    type: NumberType = Field(
        description="how the number is stored: int or uint with 8, 16, 24, 32 or 64 bits; float32, float64; bcd8, "
        "bcd16, bcd24, bcd32: decimal digits of four bits each; bit: 0 or 1, by function 1 or 2"
    )
    word_order: Literal["high_first", "low_first"] = Field(
        default="high_first", description="of a number in several registers"
    )
    byte_order: Literal["big", "little"] = Field(default="big", description="inside a register; big is Modbus's own")
    at_byte: int = Field(default=0, ge=0, le=7, description="bytes before the number, in its registers in those orders")
    mask: Mask | None = Field(default=None, description="the bits that belong to the number; all if left out")
    shift: int = Field(default=0, ge=0, le=63, description="bits by which what the mask leaves is moved down")
    minus: Mask | None = Field(default=None, description="the bit that is 1 for a negative number beside its size")

    @cached_property
    def bytes(self) -> int:
        """Length of the number in bytes, without those before it; 0 for a bit."""
        return int(re.sub(r"\D", "", self.type) or 0) // 8

    @cached_property
    def length(self) -> int:
        """Registers, or bits by function 1 and 2, that are read for the number."""
        return 1 if self.type == "bit" else -(-(self.at_byte + self.bytes) // 2)

    @cached_property
    def full_scale(self) -> frozenset[float]:
        """Its full-scale words as numbers; of decimal digits all nines."""
        if self.type in FLOATS or self.type == "bit":
            return frozenset()
        bits = (8 * self.bytes if self.mask is None else (self.mask >> self.shift).bit_length()) - (
            self.minus is not None and self.mask is None
        )
        if self.type.startswith("bcd"):
            words = frozenset({10.0 ** (bits // 4) - 1}) if bits >= MIN_BITS else frozenset()
        else:
            words = full_scale(bits, self.type.startswith("int"))
        return words | {-word for word in words} if self.minus is not None else words

    @model_validator(mode="after")
    def _bits_fit(self) -> Self:
        signed, whole = self.type.startswith("int"), self.type not in (*FLOATS, "bit")
        if self.type == "bit" and self.at_byte:
            raise ValueError("a bit has no `at_byte`")
        if not whole and (self.mask is not None or self.minus is not None or self.shift):
            raise ValueError(f"`mask`, `shift` and `minus` belong to whole numbers, not to {self.type}")
        if signed and self.minus is not None:
            raise ValueError(f"`minus` belongs to a number without a sign of its own, not to {self.type}")
        every_bit = (1 << 8 * self.bytes) - 1
        for name, bits in (("mask", self.mask), ("minus", self.minus)):
            if bits is not None and bits > every_bit:
                raise ValueError(f"`{name}` {bits:#x} has bits beyond {self.type}")
        if self.minus is not None and self.minus.bit_count() != 1:
            raise ValueError(f"`minus` {self.minus:#x} must be one bit")
        if self.minus is not None and self.mask is not None and self.minus & self.mask:
            raise ValueError("the bit `minus` must not stand in `mask`")
        if self.shift and self.mask is None:
            raise ValueError("`shift` needs a `mask`")
        field = 0 if self.mask is None else self.mask >> self.shift
        if self.mask is not None and (field << self.shift != self.mask or field & (field + 1)):
            raise ValueError(
                f"`mask` {self.mask:#x} must be bits side by side, of which `shift` leaves the lowest at 0"
            )
        return self


def decode(number: RegisterNumber, registers: Sequence[int]) -> float | None:
    """The raw number in its registers (unsigned, as on the wire), or of its bit; None for digits that are no BCD."""
    if number.type == "bit":
        return float(registers[0])
    words = registers if number.word_order == "high_first" else registers[::-1]
    data = b"".join(word.to_bytes(2, number.byte_order) for word in words)
    data = data[number.at_byte : number.at_byte + number.bytes]
    if form := FLOATS.get(number.type):
        return float(struct.unpack(form, data)[0])
    bits = int.from_bytes(data, "big")
    negative = number.minus is not None and bool(bits & number.minus)
    if number.minus is not None:
        bits &= ~number.minus
    width = 8 * number.bytes
    if number.mask is not None:
        bits = (bits & number.mask) >> number.shift
        width = (number.mask >> number.shift).bit_length()
    if number.type.startswith("bcd"):
        digits = f"{bits:x}"
        return (-1.0 if negative else 1.0) * int(digits) if digits.isdecimal() else None
    if number.type.startswith("int") and bits >> width - 1:
        bits -= 1 << width
    return float(-bits if negative else bits)
