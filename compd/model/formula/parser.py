"""Formulas as people write them, checked: a few arithmetic nodes of Python's syntax tree, nothing else.

Nothing is ever compiled or executed: a formula is text until `parse` has checked every node of its tree against a
list, and then numbers (`compd.model.formula.formula`). An effect must be linear in its fitted parameters; a
parameter in which the formula is not linear becomes a nonlinear constant, which is searched.
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence

from compd.errors import ConfigurationError, Problem
from compd.model.formula.formula import Formula
from compd.model.formula.functions import FUNCTIONS, NUMBERS, OPERATORS, to_float

# A formula that a person reads at a glance; the bounds keep any text from taking time or stack.
LONGEST = 300
DEEPEST = 20
MAX_EXPONENT = 10.0

CHARACTERS = re.compile(r"[A-Za-z0-9_ .,+\-*/()]*")
ALLOWED = f"numbers, columns, parameters, {', '.join(NUMBERS)}, + - * / **, {' '.join(FUNCTIONS)} lag(x, tau)"


def parse(text: str, parameters: tuple[str, ...], where: str) -> Formula:
    """Check a formula. Raises ConfigurationError that names the place in it and what is allowed."""
    return parse_together({where: text}, parameters, where)[0]


def parse_together(texts: Mapping[str, str], parameters: tuple[str, ...], where: str) -> tuple[Formula, ...]:
    """Check formulas that share parameters, one for each axis.

    A parameter in which one of them is not linear is a nonlinear constant of all.

    texts : each formula by its place, for messages.  where : the place of all of them.
    Raises ConfigurationError that names the place in each faulty one and what is allowed.
    """
    checkers: dict[str, _Checker] = {}
    problems: list[Problem] = []
    for place, text in texts.items():
        try:
            checkers[place] = _check(text, parameters, place)
        except ConfigurationError as error:
            problems += error.problems
    if problems:
        raise ConfigurationError(problems)
    unused = [name for name in parameters if not any(name in checker.names for checker in checkers.values())]
    if unused:
        raise ConfigurationError.of(
            where, "a parameter is not in the formula", value=", ".join(unused), next_step="use it, or remove it"
        )
    nonlinear = _nonlinear_parameters([checker.tree for checker in checkers.values()], set(parameters))
    linear = tuple(name for name in parameters if name not in nonlinear)
    problems = [
        Problem(
            place,
            "a term of the formula holds no parameter that could be fitted",
            value=texts[place],
            allowed="every term is a parameter times something",
            next_step="multiply it by a parameter with a plausible range",
        )
        for place, checker in checkers.items()
        if None in _linear_factors(checker.tree, set(linear))
    ]
    if problems:
        raise ConfigurationError(problems)
    return tuple(checker.formula(linear) for checker in checkers.values())


def _check(text: str, parameters: tuple[str, ...], where: str) -> _Checker:
    """The checked syntax tree of a formula, with the names in it."""
    _check_text(text, where)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the parser's advice on style: "1if"
            tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        column = getattr(error, "offset", None) or 1
        raise _formula_error(where, text, column, "is not a formula", ALLOWED) from error
    checker = _Checker(text.strip(), tree, parameters, where)
    checker.node(tree, 1)
    return checker


def _formula_error(where: str, text: str, column: int, what: str, allowed: str) -> ConfigurationError:
    return ConfigurationError.of(f"{where}, character {column}", what, value=text[:LONGEST], allowed=allowed)


def _check_text(text: str, where: str) -> None:
    if len(text) > LONGEST:
        raise _formula_error(where, text, LONGEST + 1, "is too long", f"{LONGEST} characters")
    good = CHARACTERS.match(text)
    end = good.end() if good else 0
    if end < len(text):
        raise _formula_error(where, text, end + 1, f"the character {text[end]!r} is not part of a formula", ALLOWED)


class _Checker:
    """Walks the tree once and raises ConfigurationError for whatever is not allowed; collects the names in it."""

    def __init__(self, text: str, tree: ast.expr, parameters: tuple[str, ...], where: str) -> None:
        self._text, self._parameters, self._where = text, parameters, where
        self.tree = tree
        self.names: dict[str, None] = {}
        self.lags = 0

    def formula(self, linear: tuple[str, ...]) -> Formula:
        """The formula whose fitted parameters are those of `linear` that it names."""
        named = tuple(name for name in self._parameters if name in self.names)
        columns = tuple(name for name in self.names if name not in self._parameters and name not in NUMBERS)
        return Formula(
            self._text,
            self.tree,
            tuple(name for name in named if name in linear),
            tuple(name for name in named if name not in linear),
            columns,
            self.lags,
        )

    def node(self, node: ast.AST, depth: int) -> None:
        if depth > DEEPEST:
            raise self._error(node, "is nested too deeply", f"{DEEPEST} levels")
        match node:
            case ast.Constant():
                self._number(node)
            case ast.Name(id=name):
                self._name(node, name)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
                self.node(operand, depth + 1)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
                self.node(left, depth + 1)
                self.node(right, depth + 1)
                if isinstance(op, ast.Pow):
                    self._exponent(right)
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                self._call(node, name, arguments, depth)
            case _:
                raise self._error(node, "is not allowed in a formula", ALLOWED)

    def _number(self, node: ast.Constant) -> None:
        # bool is an int, and no number that a person would write here
        if type(node.value) not in (int, float) or not math.isfinite(to_float(node.value)):
            raise self._error(node, "is not a finite real number", "numbers such as 12, 0.5 or 1e-6")

    def _name(self, node: ast.AST, name: str) -> None:
        if name in FUNCTIONS or name == "lag":
            raise self._error(node, "is a function and needs its arguments", f"{name}(...)")
        if name.startswith(("reference_", "model_")):
            raise self._error(node, "would show the effect the answer", "measured columns other than the reference's")
        self.names[name] = None

    def _call(self, node: ast.AST, name: str, arguments: list[ast.expr], depth: int) -> None:
        if name == "lag":
            if len(arguments) != 2:
                raise self._error(node, "needs two arguments", "lag(x, tau), tau in s")
            self.node(arguments[0], depth + 1)
            self._time_constant(arguments[1])
            self.lags += 1
            return
        if name not in FUNCTIONS:
            raise self._error(node, f"there is no function {name!r}", ALLOWED)
        count = FUNCTIONS[name].arguments
        if len(arguments) != count:
            raise self._error(node, f"{name} has {len(arguments)} arguments", f"{count}")
        for argument in arguments:
            self.node(argument, depth + 1)

    def _time_constant(self, node: ast.expr) -> None:
        match node:
            case ast.Constant(value=value) if type(value) in (int, float) and 0 < to_float(value) < math.inf:
                return
            case ast.Name(id=name) if name in self._parameters:
                self.names[name] = None
            case _:
                raise self._error(node, "is no time constant", "a positive number of seconds, or a parameter")

    def _exponent(self, node: ast.expr) -> None:
        match node:
            case ast.Constant(value=value) | ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=value)):
                if abs(to_float(value)) <= MAX_EXPONENT:
                    return
            case ast.Name(id=name) if name in self._parameters:
                return
        raise self._error(node, "is no exponent", f"a number up to {MAX_EXPONENT:g}, or a parameter")

    def _error(self, node: ast.AST, what: str, allowed: str) -> ConfigurationError:
        column = getattr(node, "col_offset", 0)
        piece = ast.get_source_segment(self._text, node) if hasattr(node, "lineno") else ""
        error = f"{piece[:40]!r} {what}" if piece else what
        return _formula_error(self._where, self._text, column + 1, error, allowed)


def _nonlinear_parameters(trees: Sequence[ast.expr], parameters: set[str]) -> set[str]:
    """The parameters in which a formula is not linear; of two that are multiplied, those in the second factor."""
    nonlinear: set[str] = set()
    while True:
        more = next((found for tree in trees for found in _find_nonlinear(tree, parameters - nonlinear)), None)
        if more is None:
            return nonlinear
        nonlinear |= more


def _find_nonlinear(node: ast.AST, parameters: set[str]) -> Iterator[set[str]]:
    """Sets of parameters that stand where the formula is not linear in them, inner nodes first."""
    match node:
        case ast.BinOp(left=left, op=op, right=right):
            yield from _find_nonlinear(left, parameters)
            yield from _find_nonlinear(right, parameters)
            in_left, in_right = _names_in(left, parameters), _names_in(right, parameters)
            if isinstance(op, ast.Mult) and in_left and in_right:
                yield in_right - in_left or in_right
            if isinstance(op, ast.Div) and in_right:
                yield in_right
            if isinstance(op, ast.Pow) and in_left | in_right:
                yield in_left | in_right
        case ast.Call(args=arguments):
            inside = set().union(*(_names_in(argument, parameters) for argument in arguments))
            if inside:
                yield inside
        case ast.UnaryOp(operand=operand):
            yield from _find_nonlinear(operand, parameters)


def _names_in(node: ast.AST, names: set[str]) -> set[str]:
    """Those of these names that stand anywhere in the node."""
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)} & names


def _linear_factors(node: ast.AST, linear: set[str]) -> set[str | None]:
    """Which linear parameters the terms hold, None for a term without."""
    match node:
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right):
            return _linear_factors(left, linear) | _linear_factors(right, linear)
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            return _linear_factors(right if _names_in(right, linear) else left, linear)
        case ast.BinOp(left=left):
            return _linear_factors(left, linear)
        case ast.UnaryOp(operand=operand):
            return _linear_factors(operand, linear)
        case ast.Name(id=name) if name in linear:
            return {name}
    return {None}
