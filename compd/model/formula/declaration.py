"""An effect declared in a file without code: a port, formulas or a sensitivity, parameters with plausible ranges."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.errors import ConfigurationError, Problem
from compd.model.effects import Constant, Effect, Parameter
from compd.model.formula.basis import (
    SENSITIVITY_PORTS,
    VECTORS,
    FormulaBasis,
    lagged_states,
    sensitivity_basis,
    sensitivity_columns,
)
from compd.model.formula.columns import ANYWHERE, OF_LINK, OF_READING, PER_LINK, column_needs
from compd.model.formula.formula import Formula
from compd.model.formula.functions import NUMBERS
from compd.model.formula.keys import FormulaDeclaration, FormulaParameter, read_declaration
from compd.model.formula.parser import MAX_EXPONENT, parse_together
from compd.model.formula.unit_check import unit_of_value, unit_remarks

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


# How many values of a nonlinear parameter are tried within its plausible range.
GRID = 9
UM = 1e-3  # mm
TO_MM: Mapping[str, float] = {"um": UM, "mm": 1.0}


def formula_effect(source: Mapping[str, Any], where: str) -> Effect:
    """An effect from its declaration, a mapping as YAML gives it.

    A formula's value is in um, or in mm with `gives: mm`; at the ports of vectors `axis` says along which axis, or
    there is one formula for each axis.
    Raises ConfigurationError with every problem found, at `where`.
    """
    declaration = read_declaration(source, where)
    problems = _form_problems(declaration, where)
    if not (declaration.formulas or declaration.sensitivity):
        raise ConfigurationError(problems)
    try:
        effect = (_with_sensitivity if declaration.sensitivity else _with_formulas)(declaration, where)
    except ConfigurationError as error:
        raise ConfigurationError([*problems, *error.problems]) from error
    if problems:
        raise ConfigurationError(problems)
    return replace(effect, declared=dict(source))


def _with_formulas(declaration: FormulaDeclaration, where: str) -> Effect:
    """Raises ConfigurationError with every problem of the formulas and their parameters."""
    place = f"{where}, formula of {declaration.id}"
    texts = declaration.formulas
    places = [f"{place}, {axis}" if len(texts) > 1 else place for axis in texts]
    parsed = parse_together(dict(zip(places, texts.values(), strict=True)), tuple(declaration.parameters), place)
    constants = tuple(dict.fromkeys(name for formula in parsed for name in formula.constants))
    problems = _parameter_problems(declaration, parsed, where)
    needs: list[str] = ["time", "order"] if any(formula.lags for formula in parsed) else []
    for text_place, formula in zip(places, parsed, strict=True):
        for name in formula.columns:
            needed = column_needs(name, declaration.port)
            if isinstance(needed, Problem):
                problems.append(replace(needed, where=text_place, value=name))
            else:
                needs += needed
    if problems:
        raise ConfigurationError(problems)
    linear = [name for name in declaration.parameters if name not in constants]
    columns = dict.fromkeys(name for formula in parsed for name in formula.columns)
    periods = {name: column for formula in parsed for name, column in find_periods(formula).items()}
    return _effect(
        declaration,
        equation=_equation(declaration),
        columns=dict.fromkeys(columns, "as measured or modelled"),
        needs=tuple(dict.fromkeys(needs)),
        linear=linear,
        basis=FormulaBasis(dict(zip(texts, parsed, strict=True)), TO_MM[declaration.gives]),
        constants=tuple(_constant(name, declaration.parameters[name], periods.get(name, "")) for name in constants),
        remembers=any(formula.lags for formula in parsed),
        unknown_states=lagged_states(sum(formula.lags for formula in parsed)),
        remarks=_unit_remarks(declaration, parsed),
        gives=_gives(declaration, parsed),
    )


def _gives(declaration: FormulaDeclaration, formulas: tuple[Formula, ...]) -> str:
    """Unit of what is added to a place that an instrument shows; "" at other ports, and for turns."""
    if declaration.port != "reference" or not set(declaration.formulas) | {declaration.axis or "x"} <= {"", *"xyz"}:
        return ""
    units = {name: parameter.unit for name, parameter in declaration.parameters.items()}
    return unit_of_value([formula.tree for formula in formulas], units, declaration.gives)


def _unit_remarks(declaration: FormulaDeclaration, formulas: tuple[Formula, ...]) -> tuple[str, ...]:
    """What is wrong with the units of the parameters, each once."""
    units = {name: parameter.unit for name, parameter in declaration.parameters.items()}
    return tuple(
        dict.fromkeys(remark for formula in formulas for remark in unit_remarks(formula.tree, units, declaration.gives))
    )


def _with_sensitivity(declaration: FormulaDeclaration, where: str) -> Effect:
    """Raises ConfigurationError with every key that does not belong to a sensitivity."""
    assert declaration.sensitivity is not None
    if problems := _sensitivity_problems(declaration, where):
        raise ConfigurationError(problems)
    (parameter,) = declaration.parameters
    derivative = f"d_{declaration.sensitivity}"
    return _effect(
        declaration,
        equation=f"delta = {parameter} {derivative}",
        columns={derivative: f"recorded derivative of the prediction, mm per {declaration.parameters[parameter].unit}"},
        needs=(sensitivity_columns(declaration.sensitivity, declaration.port),),
        linear=[parameter],
        basis=sensitivity_basis(declaration.sensitivity, declaration.port),
        counts_from="its own",
    )


def _effect(
    declaration: FormulaDeclaration, *, equation: str, columns: Mapping[str, str], linear: list[str], **parts: Any
) -> Effect:
    """What all declared effects have in common. parts : further attributes of `Effect`."""
    declared = declaration.parameters
    return Effect(
        id=declaration.id,
        ports=(declaration.port,),
        physics=declaration.physics,
        equation=equation,
        symbols={**{name: f"parameter, {parameter.unit}" for name, parameter in declared.items()}, **columns},
        source="; ".join(dict.fromkeys(parameter.source for parameter in declared.values())),
        parameters=tuple(
            Parameter(
                name,
                declared[name].unit,
                *declared[name].plausible,
                declared[name].source,
                "scale" if declaration.port == "scale" and declared[name].per == "link" else declared[name].per,
            )
            for name in linear
        ),
        mistaken_for=declaration.mistaken_for,
        separated_by=declaration.separated_by,
        **parts,
    )


def _equation(declaration: FormulaDeclaration) -> str:
    if isinstance(declaration.formula, str):
        return f"delta = {declaration.formula}" + (f", along {declaration.axis}" if declaration.axis else "")
    return "; ".join(f"delta_{axis} = {formula}" for axis, formula in declaration.formulas.items())


def _form_problems(declaration: FormulaDeclaration, where: str) -> list[Problem]:
    """Of the keys that depend on one another: formula or sensitivity, port and axis."""
    if (declaration.formula is None) == (declaration.sensitivity is None):
        what = "is missing" if declaration.formula is None else "has a formula and a sensitivity"
        return [Problem(f"{where}, formula", what, allowed="`formula:` or `sensitivity:`, one of them")]
    if declaration.sensitivity is not None:
        return []
    if isinstance(declaration.formula, str):
        if (declaration.axis is not None) == (declaration.port in VECTORS):
            return []
        allowed = "none: this port has no direction"
        if declaration.port in VECTORS:
            allowed = "x, y or z; or a formula for each axis, `formula: {x: ..., y: ...}`"
        what, value = f"does not fit the port {declaration.port}", str(declaration.axis or "")
        return [Problem(f"{where}, axis", what, value=value, allowed=allowed)]
    problems = []
    if declaration.axis is not None:
        what, step = "is said twice: the formulas name their axes", "remove `axis:`"
        problems.append(Problem(f"{where}, axis", what, value=declaration.axis, next_step=step))
    if declaration.port not in VECTORS:
        what, allowed = f"the port {declaration.port} has no axes", "one formula, or the ports " + ", ".join(VECTORS)
        problems.append(Problem(f"{where}, formula", what, allowed=allowed))
    return problems


def _sensitivity_problems(declaration: FormulaDeclaration, where: str) -> list[Problem]:
    problems = []
    if declaration.port not in SENSITIVITY_PORTS:
        what, allowed = "has no sensitivity", ", ".join(SENSITIVITY_PORTS)
        problems.append(Problem(f"{where}, port", what, value=declaration.port, allowed=allowed))
    for key in ("axis", "gives"):
        if key in declaration.model_fields_set:
            what, step = "does not belong to a sensitivity, whose columns are in mm along their axes", "remove it"
            problems.append(Problem(f"{where}, {key}", what, next_step=step))
    parameters = declaration.parameters
    if len(parameters) != 1:
        what, allowed = "a sensitivity has one parameter", "one; write an effect for each"
        problems.append(Problem(f"{where}, parameters", what, value=", ".join(parameters), allowed=allowed))
    problems += [problem for name in parameters if (problem := _range_problem(declaration, name, where))]
    for name, parameter in parameters.items():
        if parameter.per == "link":
            place = f"{where}, parameters.{name}.per"
            problems.append(Problem(place, "a sensitivity has one value", value="link", allowed="machine"))
    return problems


def _range_problem(declaration: FormulaDeclaration, name: str, where: str) -> Problem | None:
    low, high = declaration.parameters[name].plausible
    if low < high:
        return None
    return Problem(
        f"{where}, parameters.{name}",
        "the plausible range is empty",
        value=f"[{low:g}, {high:g}]",
        allowed="[low, high], low < high",
    )


def _parameter_problems(declaration: FormulaDeclaration, formulas: tuple[Formula, ...], where: str) -> list[Problem]:
    problems = []
    texts = [formula.text for formula in formulas]
    constants = {name for formula in formulas for name in formula.constants}
    for name, parameter in declaration.parameters.items():
        place = f"{where}, parameters.{name}"
        low, high = parameter.plausible
        if problem := _range_problem(declaration, name, where):
            problems.append(problem)
        if name in (*OF_LINK, *OF_READING, *ANYWHERE, *NUMBERS):
            what = "this name is a number's" if name in NUMBERS else "this name is a column's"
            problems.append(Problem(place, what, value=name, next_step="call the parameter otherwise"))
        if parameter.per == "link" and (name in constants or declaration.port not in PER_LINK):
            allowed = f"a parameter that the formula is proportional to, at {', '.join(PER_LINK)}"
            problems.append(Problem(place, "cannot be one per link", value=name, allowed=allowed))
        is_exponent = any(re.search(rf"\*\*\s*{name}\b", text) for text in texts)
        if is_exponent and max(abs(low), abs(high)) > MAX_EXPONENT:
            allowed = f"within +-{MAX_EXPONENT:g}"
            problems.append(Problem(place, "is an exponent", value=f"[{low:g}, {high:g}]", allowed=allowed))
        is_time_constant = name in constants and any(
            formula.lags and re.search(rf",\s*{name}\s*\)", formula.text) for formula in formulas
        )
        if is_time_constant and low <= 0:
            value, allowed = f"[{low:g}, {high:g}]", "a range above 0 s"
            problems.append(Problem(place, "is a time constant", value=value, allowed=allowed))
    return problems


def _constant(name: str, parameter: FormulaParameter, period_of: str) -> Constant:
    """A nonlinear parameter as a constant that is searched: evenly, or in equal ratios over more than a decade and a
    half."""
    low, high = parameter.plausible
    wide = low > 0 and high / low >= 30
    grid = np.geomspace(low, high, GRID) if wide else np.linspace(low, high, GRID)
    values = tuple(float(value) for value in grid)
    return Constant(name, parameter.unit, low, high, parameter.source, values, period_of=period_of)
