"""Probable slips in a described Modbus gauge: registers shared by two numbers, an odd factor."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

from compd.gauge import OptionDoubt
from compd_drivers.modbus_description import ModbusChannel
from compd_drivers.modbus_number import FLOATS
from compd_drivers.no_number import range_doubts

# First digits of Modbus's "reference numbers": in a manual 10001 is the first discrete input, 30001 the first input
# register, 40001 the first holding register.
_REFERENCES = {10001: 2, 30001: 4, 40001: 3}
_MAX_REFERENCE = 9999
# Numbers above those of any sensor of a machine, by unit; a wrong factor is off by ten or more.
_LARGEST = {"degC": 5e3, "hPa": 1e5, "pct": 1e4}
# Coarsest digit of a machine's sensors by unit; a float's digit is fine, and its factor at most converts kelvin or
# fahrenheit to degC.
_COARSEST = {"mm": 0.1, "degC": 2.0}
_FLOATS_FACTOR = {"degC": 1.0}


RANGE = "`lowest` and `highest`"


def doubts(channels: Sequence[ModbusChannel], range_key: str = RANGE) -> Iterator[OptionDoubt]:
    """Doubts about a register map. range_key : what states a channel's range; "" where there is no such key."""
    without = [channel.name for channel in channels if not channel.states_range and channel.type != "bit"]
    yield from range_doubts(without, range_key, ("channels",))
    for (_, one), (k, other) in combinations(enumerate(channels), 2):
        if _share(one, other):
            yield OptionDoubt(
                ("channels", k, "address"),
                f"channels {one.name} and {other.name} share registers",
                f"{one.name} {_span(one)}, {other.name} {_span(other)}",
                "look the addresses up in the manual: a float32 takes two registers, a float64 four",
            )
    for k, channel in enumerate(channels):
        for first, function in _REFERENCES.items():
            if first <= channel.address < first + _MAX_REFERENCE:
                yield OptionDoubt(
                    ("channels", k, "address"),
                    "is more likely the manual's number of a register than its address, which counts from 0",
                    f"{channel.address}, by function {channel.function}",
                    f"write {channel.address - first} and function {function}, as the manual counts from {first}",
                )
        if why := _why_no_factor(channel):
            yield OptionDoubt(
                ("channels", k, "scale"),
                f"is not plausible: {why}",
                f"{channel.scale:g}",
                f"write {channel.unit} per count: 0.1 where the register has tenths",
            )


def _why_no_factor(channel: ModbusChannel) -> str:
    """The fault of a channel's `scale`; "" for a good or undecidable one."""
    if channel.scale == 0:
        return "the value would never change"
    if channel.linearisation is not None or channel.type == "bit":
        return ""
    if channel.scale < 0 and channel.unit == "degC":
        return "it would fall where it becomes warmer"
    digit = abs(channel.scale)
    if channel.type in FLOATS:
        return "a float is in the unit itself" if digit > _FLOATS_FACTOR.get(channel.unit, digit) else ""
    if digit >= _COARSEST.get(channel.unit, math.inf):
        return f"one count would be {digit:g} {channel.unit}"
    largest = _largest(channel)
    if largest > _LARGEST.get(channel.unit, largest):
        return f"the register's largest number would be {largest:g} {channel.unit}"
    return ""


def _span(channel: ModbusChannel) -> str:
    last = channel.address + channel.length - 1
    return f"{channel.address}" if last == channel.address else f"{channel.address} to {last}"


def _share(one: ModbusChannel, other: ModbusChannel) -> bool:
    """Whether two numbers both take the whole of a common register."""
    if one.function != other.function or "bit" in (one.type, other.type):
        return False
    apart = one.address + one.length <= other.address or other.address + other.length <= one.address
    return not apart and _takes_all(one) and _takes_all(other)


def _takes_all(channel: ModbusChannel) -> bool:
    return channel.mask is None and not channel.at_byte and channel.bytes == 2 * channel.length


def _largest(channel: ModbusChannel) -> float:
    """The largest number in a whole number's registers, in the channel's unit; 0 if unknown."""
    if channel.highest is not None:
        return 0.0
    bits = 8 * channel.bytes
    # more than 16 bits are seldom used fully
    return abs(channel.scale) * (2 ** (bits - 1) - 1) if 8 < bits <= 16 else 0.0
