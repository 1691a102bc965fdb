"""Units of a formula's parameters against the columns that they multiply.

A formula computes with numbers, and a unit is what a person reads of a parameter: `k * temperature_ram_degC` in um
means um per degC, whatever stands behind k. Where numbers in a formula may have a unit of their own, as a length of
400, nothing can be said; a power of ten turns one unit into another of its kind.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping, Sequence
from functools import cache
from typing import NamedTuple

from compd.columns import is_sensitivity
from compd.model.formula.functions import FUNCTIONS, NUMBERS
from compd.units import REFERENCE_UNITS, UNIT_KINDS, unit_of

# Base of each kind of unit, in the order of UNIT_KINDS.
_BASES = ("mm", "s", "rad", "N", "hPa")
_PLAIN: Mapping[str, tuple[dict[str, float], float]] = {
    "1": ({}, 1.0),
    "ppm": ({}, 1e-6),
    "um_per_m": ({}, 1e-6),
    "mm_per_s": ({"mm": 1, "s": -1}, 1.0),
    "m_per_s": ({"mm": 1, "s": -1}, 1e3),
    "K": ({"K": 1}, 1.0),
    "degC": ({"K": 1}, 1.0),
    "K_per_h": ({"K": 1, "s": -1}, 1 / 3600),
    "pct": ({"pct": 1}, 1.0),
    "%": ({"pct": 1}, 1.0),
    "Nm": ({"N": 1, "mm": 1}, 1e3),
    "V": ({"V": 1}, 1.0),
    "mV": ({"V": 1}, 1e-3),
    "A": ({"A": 1}, 1.0),
    "mA": ({"A": 1}, 1e-3),
    "W": ({"W": 1}, 1.0),
    "g": ({"kg": 1}, 1e-3),
    "kg": ({"kg": 1}, 1.0),
    "Hz": ({"s": -1}, 1.0),
}
_TOKEN = re.compile(r"([A-Za-z%\u00b5][A-Za-z_%\u00b5]*|1)(?:(?:\^|\*\*)?(-?\d))?")
_ANGLES = UNIT_KINDS[_BASES.index("rad")]
# Difference of two factors of one unit, of numbers as people write them.
_SAME_UNIT = 1e-4
# Factors that halve or double: play on either side, a diameter.
_NEAR_ONE = (0.5, 1.0, 2.0)


class Quantity(NamedTuple):
    """A part of a formula: its dimensions in base units, the size of its unit in these, and the numbers in it.

    unit : exponent by base unit, without zeros.  scale : one of it in base units.  factor : product of its numbers.
    names : the parameters and the units of columns of which it is a product.
    """

    unit: Mapping[str, float]
    scale: float
    factor: float
    names: tuple[str, ...] = ()

    def times(self, other: Quantity, sign: int = 1) -> Quantity:
        """The product; with -1 the quotient."""
        unit = {base: self.unit.get(base, 0) + sign * other.unit.get(base, 0) for base in {**self.unit, **other.unit}}
        return Quantity(
            {base: power for base, power in unit.items() if power},
            self.scale * _power(other.scale, sign),
            self.factor * _power(other.factor, sign),
            self.names + other.names,
        )

    def to_the(self, power: float) -> Quantity:
        """A power of it."""
        unit = {base: exponent * power for base, exponent in self.unit.items() if exponent * power}
        return Quantity(unit, _power(self.scale, power), _power(self.factor, power), self.names)


def _power(value: float, power: float) -> float:
    """nan where it is no real number."""
    try:
        result = value**power
    except (ZeroDivisionError, OverflowError):
        return math.nan
    return result if isinstance(result, float) else math.nan


_NUMBER = Quantity({}, 1.0, 1.0)
# What numbers alone add up to: its factor is not followed.
_UNKNOWN_NUMBER = Quantity({}, 1.0, math.nan)


@cache
def read_unit(text: str) -> Quantity | None:
    """A unit as people write it: "um/K", "um/mm^2", "ppm/K", "um/(m K)"; None for one that is not known."""
    above, _, below = text.replace("\u00b7", " ").replace("\u03bc", "u").replace("\u00b5", "u").partition("/")
    result = _NUMBER
    for part, sign in ((above, 1), (below.replace("/", " ").strip().strip("()"), -1)):
        for word in part.split() if "**" in part else part.replace("*", " ").split():
            match = _TOKEN.fullmatch(word.strip("()"))
            single = None if match is None else _single(match[1])
            if match is None or single is None:
                return None
            result = result.times(single.to_the(float(match[2] or 1)), sign)
    return result


def _single(name: str) -> Quantity | None:
    if name in _PLAIN:
        unit, scale = _PLAIN[name]
        return Quantity(unit, scale, 1.0)
    for kind, base in zip(UNIT_KINDS, _BASES, strict=True):
        if name in kind:
            # an angle is a number: a radian times a millimetre is a millimetre
            return Quantity({} if base == "rad" else {base: 1}, kind[name], 1.0)
    return None


def unit_of_value(trees: Sequence[ast.expr], units: Mapping[str, str], gives: str) -> str:
    """Unit of what formulas give: an angle's, `gives` for a length, "" where nobody knows or the summands differ.

    units : of each parameter, as a person wrote it.  gives : unit of a length.
    """
    found = {
        _unit_of_term(term, units, gives)
        for tree in trees
        for term in _terms(tree)
        if {node.id for node in ast.walk(term) if isinstance(node, ast.Name)} & set(units)
    }
    return found.pop() if len(found) == 1 else ""


def _unit_of_term(term: ast.expr, units: Mapping[str, str], gives: str) -> str:
    quantity = _quantity(term, units)
    if quantity is None or not quantity.scale > 0:
        return ""
    if dict(quantity.unit) == {"mm": 1}:
        return gives
    own = [units[name] for name in quantity.names if name in units]
    if quantity.unit or not any(re.search(rf"\b({'|'.join(_ANGLES)})\b", unit) for unit in own):
        return ""
    # a factor may turn one unit into another, as 3600 does with degrees
    number = 1.0 if math.isnan(quantity.factor) or abs(quantity.factor) in _NEAR_ONE else abs(quantity.factor)
    scales = {name: quantity.scale / number / size for name, size in _ANGLES.items()}
    return next((name for name, ratio in scales.items() if abs(ratio - 1) < _SAME_UNIT), "")


def unit_remarks(tree: ast.expr, units: Mapping[str, str], gives: str) -> list[str]:
    """What is wrong with the units of parameters in a formula, in words; empty where nothing is, or nothing is known.

    units : of each parameter, as a person wrote it.  gives : unit of the formula's value.
    """
    remarks: list[str] = []
    for term in _terms(tree):
        parameters = sorted({node.id for node in ast.walk(term) if isinstance(node, ast.Name)} & set(units))
        quantity = _quantity(term, units)
        if quantity is None or not parameters:
            continue
        linear = parameters[0]
        own = read_unit(units[linear])
        if own is None:
            continue
        wanted = [read_unit(unit) for unit in dict.fromkeys((gives, *REFERENCE_UNITS))]
        fits = [unit for unit in wanted if unit is not None and dict(unit.unit) == dict(quantity.unit)]
        number = abs(quantity.factor)
        if not (math.isfinite(number) and number and math.isfinite(quantity.scale) and quantity.scale):
            continue
        others = " ".join(name for name in quantity.names if name not in units)
        if not fits:
            if number in _NEAR_ONE:
                per = f" per {others}" if others else ""
                remarks.append(f"{linear} is declared in {units[linear]}; by the formula it is in {gives}{per}")
            continue
        power = math.log10(number)
        if abs(power - round(power)) > 1e-9 and number not in _NEAR_ONE:
            continue
        ratios = [number * unit.scale / quantity.scale for unit in fits]
        if all(ratio > 9 or ratio < 1 / 9 for ratio in ratios):
            first = read_unit(gives)
            size = quantity.scale / first.scale if first is not None else math.nan
            remarks.append(
                f"{linear} is declared in {units[linear]}; the formula needs a factor of {size:.3g} then, not "
                f"{number:.3g}, to give {gives}"
            )
    return remarks


def _terms(tree: ast.expr) -> list[ast.expr]:
    """The summands of a formula."""
    match tree:
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            return [*_terms(left), *_terms(right)]
        case ast.UnaryOp(operand=operand):
            return _terms(operand)
    return [tree]


def _quantity(node: ast.expr, units: Mapping[str, str]) -> Quantity | None:
    """A part of a formula; None where its unit cannot be known."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return Quantity({}, 1.0, float(value))
        case ast.Name(id=name) if name in NUMBERS:
            return Quantity({}, 1.0, NUMBERS[name])
        case ast.Name(id=name):
            unit = units.get(name) or _column_unit(name)
            quantity = read_unit(unit) if unit else None
            return None if quantity is None else quantity._replace(names=(name if name in units else unit,))
        case ast.UnaryOp(operand=operand):
            return _quantity(operand, units)
        case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as operator, right=right):
            first, second = _quantity(left, units), _quantity(right, units)
            if first is None or second is None:
                return None
            return first.times(second, 1 if isinstance(operator, ast.Mult) else -1)
        case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int() | float() as power)):
            base = _quantity(left, units)
            return None if base is None else base.to_the(float(power))
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            return _sum(_quantity(left, units), _quantity(right, units))
        case ast.Call(func=ast.Name(id=name), args=[first, *_]):
            return _of_call(name, _quantity(first, units))
    return None


def _sum(left: Quantity | None, right: Quantity | None) -> Quantity | None:
    """Of two summands: that of the one with a unit, where the other is a number; none where they differ."""
    if left is None or right is None:
        return None
    if not right.names or not left.names:
        with_unit = left if left.names else right
        return with_unit if with_unit.names else _UNKNOWN_NUMBER
    same = dict(left.unit) == dict(right.unit) and left.scale == right.scale and left.factor == right.factor
    return left if same else None


def _of_call(name: str, first: Quantity | None) -> Quantity | None:
    if name in ("abs", "minimum", "maximum", "lag"):
        return first
    if name == "sqrt":
        return None if first is None else first.to_the(0.5)
    # the others give numbers
    return _NUMBER if name in FUNCTIONS else None


def _column_unit(name: str) -> str:
    if is_sensitivity(name):
        return ""  # a derivative by a number of any unit
    if name == "direction":
        return "1"
    return "degC" if name == "temperature_link" else unit_of(name)
