"""A checked formula and its value, by walking its syntax tree; nothing is compiled or executed."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.model.memory import State, lag


class Function(NamedTuple):
    """A function of a formula. call : as people write it; meaning : for the reference."""

    arguments: int
    apply: Callable[..., FloatArray]
    call: str
    meaning: str


FUNCTIONS: Mapping[str, Function] = {
    "sin": Function(1, np.sin, "sin(x)", "sine of x in radians; of an angle in degrees: sin(azimuth_deg * deg)"),
    "cos": Function(1, np.cos, "cos(x)", "cosine of x in radians"),
    "tan": Function(1, np.tan, "tan(x)", "tangent of x in radians"),
    "atan2": Function(2, np.arctan2, "atan2(y, x)", "angle of the point (x, y), -pi to pi radians"),
    "exp": Function(1, np.exp, "exp(x)", "e to the power of x"),
    "log": Function(1, np.log, "log(x)", "natural logarithm"),
    "sqrt": Function(1, np.sqrt, "sqrt(x)", "square root"),
    "abs": Function(1, np.abs, "abs(x)", "absolute value"),
    "sign": Function(1, np.sign, "sign(x)", "-1, 0 or 1"),
    "minimum": Function(2, np.minimum, "minimum(x, y)", "the smaller of two values"),
    "maximum": Function(2, np.maximum, "maximum(x, y)", "the larger of two values"),
}
# Names that are numbers; deg turns degrees into radians.
NUMBERS: Mapping[str, float] = {"pi": math.pi, "deg": math.pi / 180.0}
# Not one of FUNCTIONS, because it remembers: its call and meaning, for the reference.
LAG = ("lag(x, tau)", "x as it arrives after a first-order lag with the time constant tau, s; x itself at the start")
OPERATORS: Mapping[type[ast.operator], Callable[[FloatArray, FloatArray], FloatArray]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}

# One value per fitted parameter that a term is proportional to; None for what holds none.
Terms = dict[str | None, FloatArray]


@dataclass(frozen=True)
class Formula:
    """A checked formula.

    linear : parameters to which it is proportional, in the order declared.  constants : the other parameters.
    columns : names of everything else in it.  lags : how many lag(x, tau) it holds.
    """

    text: str
    tree: ast.expr
    linear: tuple[str, ...]
    constants: tuple[str, ...]
    columns: tuple[str, ...]
    lags: int

    def evaluate(
        self,
        columns: Mapping[str, FloatArray],
        constants: Mapping[str, float],
        time_s: FloatArray,
        session_start: BoolArray,
        states: tuple[State | None, ...],
    ) -> tuple[dict[str, FloatArray], tuple[State | None, ...]]:
        """What each linear parameter is multiplied by: (N, m) or what broadcasts to it; and the lags' states after.

        columns : (N, m) or (N, 1) by name, all of one m or 1.  constants : values of the other parameters.
        states : one per lag, None at the start.  Where the arithmetic fails (log of a negative, exp of a large one) the
        value is nan.
        """
        evaluation = _Evaluation(self, columns, constants, time_s, session_start, list(states))
        with np.errstate(all="ignore"):
            terms = evaluation.terms(self.tree)
        known = {name: np.where(np.isfinite(terms[name]), terms[name], np.nan) for name in self.linear}
        return known, tuple(evaluation.after)


def to_float(value: object) -> float:
    """The number as a float; infinite where it is too large for one."""
    try:
        return float(value)  # type: ignore[arg-type]
    except (OverflowError, TypeError, ValueError):
        return math.inf


class _Evaluation:
    """One evaluation: walks the tree; the value of each node is a sum of terms, by parameter."""

    def __init__(
        self,
        formula: Formula,
        columns: Mapping[str, FloatArray],
        constants: Mapping[str, float],
        time_s: FloatArray,
        session_start: BoolArray,
        states: list[State | None],
    ) -> None:
        self._linear = formula.linear
        self._columns, self._constants = columns, constants
        self._time_s, self._session_start = time_s, session_start
        self._before = states
        self.after: list[State | None] = []

    def terms(self, node: ast.AST) -> Terms:
        match node:
            case ast.Constant(value=value):
                return {None: np.full((1, 1), to_float(value))}
            case ast.Name(id=name):
                return self._value_of_name(name)
            case ast.UnaryOp(op=op, operand=operand):
                sign = -1.0 if isinstance(op, ast.USub) else 1.0
                return {name: sign * value for name, value in self.terms(operand).items()}
            case ast.BinOp(left=left, op=op, right=right):
                return self._combine(self.terms(left), op, self.terms(right))
            case ast.Call(func=ast.Name(id="lag"), args=[value, tau]):
                return {None: self._apply_lag(self.terms(value)[None], float(self.terms(tau)[None][0, 0]))}
            case ast.Call(func=ast.Name(id=name), args=arguments):
                return {None: FUNCTIONS[name].apply(*(self.terms(argument)[None] for argument in arguments))}
        raise AssertionError("`parse` refuses every other node")

    def _value_of_name(self, name: str) -> Terms:
        if name in self._linear:
            return {name: np.ones((1, 1))}
        if name in self._constants:
            return {None: np.full((1, 1), self._constants[name])}
        return {None: np.full((1, 1), NUMBERS[name]) if name in NUMBERS else self._columns[name]}

    def _combine(self, left: Terms, op: ast.operator, right: Terms) -> Terms:
        function = OPERATORS[type(op)]
        if isinstance(op, ast.Add | ast.Sub):
            sign = -1.0 if isinstance(op, ast.Sub) else 1.0
            total = dict(left)
            for name, value in right.items():
                total[name] = total[name] + sign * value if name in total else sign * value
            return total
        if set(right) == {None}:
            return {name: function(value, right[None]) for name, value in left.items()}
        return {name: left[None] * value for name, value in right.items()}

    def _apply_lag(self, value: FloatArray, tau_s: float) -> FloatArray:
        values = np.broadcast_to(value, (len(self._time_s), value.shape[1]))
        lagged, state = lag(self._time_s, values, self._session_start, tau_s, self._before[len(self.after)])
        self.after.append(state)
        return lagged
