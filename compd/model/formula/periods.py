"""Which constants of a formula are periods of a column, as p is in ``a * sin(2 * pi * position_mm / p)``."""

from __future__ import annotations

import ast
import math

import numpy as np

from compd.arrays import FloatArray
from compd.model.formula.formula import Formula

# Rounding of the numbers in a formula, 2 * 3.141593 for instance, in turns.
ROUNDING = 1e-6
# Shares of a period at which the argument of a sine is looked at: it must grow in proportion.
SHARES = np.array([0.0, 0.3, 1.0])


def find_periods(formula: Formula) -> dict[str, str]:
    """The constants that are periods, each with its column: {"p": "position_mm"}.

    A constant is a period if the argument of a sine or cosine grows with one column in proportion, and by the same
    number of whole turns when that column grows by the constant, whatever its value.
    """
    periods: dict[str, str] = {}
    for node in ast.walk(formula.tree):
        match node:
            case ast.Call(func=ast.Name(id="sin" | "cos"), args=[argument]):
                names = {part.id for part in ast.walk(argument) if isinstance(part, ast.Name)}
                columns = names & set(formula.columns)
                if len(columns) == 1 and "lag" not in names:
                    (column,) = columns
                    periods |= {
                        name: column
                        for name in formula.constants
                        if name in names and _is_period(formula, argument, name, column)
                    }
    return periods


def _is_period(formula: Formula, argument: ast.expr, constant: str, column: str) -> bool:
    first, second = (_turns(formula, argument, constant, column, value) for value in (1.0, 2.0))
    whole = np.rint(first[-1])
    return bool(whole and np.isfinite(whole) and np.allclose([first, second], whole * SHARES, rtol=0.0, atol=ROUNDING))


def _turns(formula: Formula, argument: ast.expr, constant: str, column: str, value: float) -> FloatArray:
    """The argument of a sine, in turns, when the column is SHARES of the constant's value; other constants are 1."""
    scaled = ast.BinOp(ast.Name("factor"), ast.Mult(), argument)
    phase = Formula(formula.text, scaled, ("factor",), formula.constants, (column,), 0)
    columns, constants = {column: value * SHARES[:, None]}, dict.fromkeys(formula.constants, 1.0) | {constant: value}
    factors = phase.evaluate(columns, constants, np.zeros(len(SHARES)), np.zeros(len(SHARES), dtype=bool))
    phase_rad = factors["factor"][:, 0]
    with np.errstate(invalid="ignore"):
        return np.asarray((phase_rad - phase_rad[0]) / (2 * math.pi))
