"""A checked formula as a program: the operations that `compd.model.kernels.formula` runs, and its columns."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeAlias

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.model.formula.functions import FUNCTIONS, NUMBERS, OPERATORS, to_float
from compd.model.kernels import formula as machine_code

# A number of the text, a name, or an operation with its operands.
Expression: TypeAlias = "float | str | tuple[int, tuple[Expression, ...]] | LaggedValue"
# What each parameter is multiplied by; None for what holds none.
Terms: TypeAlias = dict[str | None, Expression]


@dataclass(frozen=True, eq=False)
class LaggedValue:
    """A value after a first-order lag: one object for each lag(x, tau) of the text."""

    value: Expression
    tau_s: Expression


class ColumnCodes(NamedTuple):
    """What the columns of formulas are.

    codes : (kind, argument) by name; see `compd.model.kernels.formula`.
    own : names of those that have a value for each place of the port.
    since_zero : names of those that count from machine zero: measured quantities; empty where none does.
    """

    codes: Mapping[str, tuple[int, int]]
    own: frozenset[str]
    since_zero: frozenset[str] = frozenset()


class Program(NamedTuple):
    """A formula, or one for each axis, to be run.

    code (L, 2), numbers : see `compd.model.kernels.formula`; the numbers do not contain the nonlinear constants, which
    stand before them, nor what 1 is in mm, which stands behind.
    states : length of each array of its memory, three for each lag.
    """

    code: IntArray
    numbers: FloatArray
    states: tuple[int, ...]


def write_program(
    trees: Mapping[int, ast.expr],
    linear: Sequence[str],
    constants: Sequence[str],
    columns: ColumnCodes,
    along: int,
    places: int,
    own: Sequence[bool],
) -> Program:
    """The program of formulas, by their axes.

    linear : the fitted parameters; own : whether each of them has one value for every place.  constants : the nonlinear
    ones, whose values stand before the numbers.  along, places : numbers at each place of the port, places.
    """
    writer = _Writer(tuple(linear), tuple(constants), columns, places)
    formulas = [(axis, writer.operations(terms_of(tree, linear))) for axis, tree in trees.items()]
    begins = np.cumsum([0, *(places if each else 1 for each in own)]).tolist()
    states = [width for width in writer.lag_widths for _ in range(3)]
    lag_begins = np.cumsum([0, *states])[::3].tolist()
    lanes = 2 if columns.since_zero else 1
    table = [(along, places), (lanes, 0), (len(writer.lag_widths), len(columns.codes)), (len(formulas), len(linear))]
    table += list(zip(lag_begins, writer.lag_widths, strict=False))
    table += list(columns.codes.values())
    table += [(begin, int(each)) for begin, each in zip(begins, own, strict=False)]
    for axis, operations in formulas:
        table += [(axis, len(operations)), *operations]
    return Program(np.array(table, dtype=np.int64), np.array(writer.numbers), tuple(states))


def terms_of(tree: ast.expr, linear: Sequence[str]) -> Terms:
    """What each parameter of `linear` is multiplied by in a formula that is linear in them."""
    match tree:
        case ast.Constant(value=value):
            return {None: to_float(value)}
        case ast.Name(id=name):
            return {name: 1.0} if name in linear else {None: name}
        case ast.UnaryOp(op=op, operand=operand):
            terms = terms_of(operand, linear)
            if isinstance(op, ast.USub):
                terms = {name: (machine_code.NEGATE, (value,)) for name, value in terms.items()}
            return terms
        case ast.BinOp(left=left, op=op, right=right):
            return _combine(terms_of(left, linear), OPERATORS[type(op)], terms_of(right, linear))
        case ast.Call(func=ast.Name(id="lag"), args=[value, tau]):
            return {None: LaggedValue(terms_of(value, linear)[None], terms_of(tau, linear)[None])}
        case ast.Call(func=ast.Name(id=name), args=arguments):
            operands = tuple(terms_of(argument, linear)[None] for argument in arguments)
            return {None: (FUNCTIONS[name].operation, operands)}
    raise AssertionError("`parse` refuses every other node")


def _combine(left: Terms, operation: int, right: Terms) -> Terms:
    if operation in (machine_code.ADD, machine_code.SUBTRACT):
        total = dict(left)
        for name, value in right.items():
            if name in total:
                total[name] = (operation, (total[name], value))
            else:
                total[name] = value if operation == machine_code.ADD else (machine_code.NEGATE, (value,))
        return total
    if set(right) == {None}:
        return {name: (operation, (value, right[None])) for name, value in left.items()}
    return {name: (machine_code.MULTIPLY, (left[None], value)) for name, value in right.items()}


@dataclass
class _Writer:
    """Writes operations; collects the numbers and the lags of all formulas."""

    linear: tuple[str, ...]
    constants: tuple[str, ...]
    columns: ColumnCodes
    places: int
    numbers: list[float] = field(default_factory=list)
    lag_widths: list[int] = field(default_factory=list)
    _registers: dict[int, int] = field(default_factory=dict)

    def operations(self, terms: Terms) -> list[tuple[int, int]]:
        """Of one formula: its lags, each after those inside it, then its factors."""
        code: list[tuple[int, int]] = []
        for value in terms.values():
            self._write_lags(value, code)
        for name, value in terms.items():
            assert name is not None, "`parse` refuses a term without a parameter"
            code += self._value(value)
            factor = machine_code.FACTOR_SINCE_ZERO if self._is_since_zero(value) else machine_code.FACTOR
            code.append((factor, self.linear.index(name)))
        return code

    def _write_lags(self, value: Expression, code: list[tuple[int, int]]) -> None:
        if isinstance(value, tuple):
            for operand in value[1]:
                self._write_lags(operand, code)
        elif isinstance(value, LaggedValue) and id(value) not in self._registers:
            self._write_lags(value.value, code)
            code += [*self._value(value.value), *self._value(value.tau_s)]
            lag = machine_code.LAG_SINCE_ZERO if self._is_since_zero(value.value) else machine_code.LAG
            code.append((lag, len(self.lag_widths)))
            self._registers[id(value)] = len(self.lag_widths)
            self.lag_widths.append(self.places if _holds(value.value, self.columns.own) else 1)

    def _is_since_zero(self, value: Expression) -> bool:
        return _holds(value, self.columns.since_zero)

    def _value(self, value: Expression) -> list[tuple[int, int]]:
        if isinstance(value, LaggedValue):
            return [(machine_code.REGISTER, self._registers[id(value)])]
        if isinstance(value, tuple):
            operation, operands = value
            return [step for operand in operands for step in self._value(operand)] + [(operation, 0)]
        if isinstance(value, str) and value in self.columns.codes:
            return [(machine_code.COLUMN, list(self.columns.codes).index(value))]
        if isinstance(value, str) and value in self.constants:
            return [(machine_code.NUMBER, self.constants.index(value))]
        self.numbers.append(NUMBERS[value] if isinstance(value, str) else value)
        return [(machine_code.NUMBER, len(self.constants) + len(self.numbers) - 1)]


def _holds(value: Expression, columns: frozenset[str]) -> bool:
    """Whether one of these columns is in a value."""
    if isinstance(value, tuple):
        return any(_holds(operand, columns) for operand in value[1])
    if isinstance(value, LaggedValue):
        return _holds(value.value, columns)
    return value in columns
