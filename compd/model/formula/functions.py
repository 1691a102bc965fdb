"""What a formula may contain beside columns and parameters: functions, named numbers and operators."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from typing import NamedTuple

from compd.model.kernels import formula as machine_code


class Function(NamedTuple):
    """A function of a formula. operation : its code in `compd.model.kernels.formula`; call : as people write it;
    meaning : for the reference."""

    arguments: int
    operation: int
    call: str
    meaning: str


FUNCTIONS: Mapping[str, Function] = {
    "sin": Function(
        1, machine_code.SIN, "sin(x)", "sine of x in radians; of an angle in degrees: sin(azimuth_deg * deg)"
    ),
    "cos": Function(1, machine_code.COS, "cos(x)", "cosine of x in radians"),
    "tan": Function(1, machine_code.TAN, "tan(x)", "tangent of x in radians"),
    "atan2": Function(2, machine_code.ATAN2, "atan2(y, x)", "angle of the point (x, y), -pi to pi radians"),
    "exp": Function(1, machine_code.EXP, "exp(x)", "e to the power of x"),
    "log": Function(1, machine_code.LOG, "log(x)", "natural logarithm"),
    "sqrt": Function(1, machine_code.SQRT, "sqrt(x)", "square root"),
    "abs": Function(1, machine_code.ABS, "abs(x)", "absolute value"),
    "sign": Function(1, machine_code.SIGN, "sign(x)", "-1, 0 or 1"),
    "minimum": Function(2, machine_code.MINIMUM, "minimum(x, y)", "the smaller of two values"),
    "maximum": Function(2, machine_code.MAXIMUM, "maximum(x, y)", "the larger of two values"),
}
# Names that are numbers; deg turns degrees into radians.
NUMBERS: Mapping[str, float] = {"pi": math.pi, "deg": math.pi / 180.0}
# Not one of FUNCTIONS, because it remembers: its call and meaning, for the reference.
LAG = ("lag(x, tau)", "x as it arrives after a first-order lag with the time constant tau, s; x itself at the start")
OPERATORS: Mapping[type[ast.operator], int] = {
    ast.Add: machine_code.ADD,
    ast.Sub: machine_code.SUBTRACT,
    ast.Mult: machine_code.MULTIPLY,
    ast.Div: machine_code.DIVIDE,
    ast.Pow: machine_code.POWER,
}


def to_float(value: object) -> float:
    """The number as a float; infinite where it is too large for one."""
    try:
        return float(value)  # type: ignore[arg-type]
    except (OverflowError, TypeError, ValueError):
        return math.inf
