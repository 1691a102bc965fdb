"""An effect declared in a file without code: a port, a formula, parameters with plausible ranges."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from compd.arrays import FloatArray
from compd.errors import ConfigurationError, Problem
from compd.model.effect import Constant, ConstantValues, Effect, Memory, Parameter, Port
from compd.model.formula.evaluator import Formula
from compd.model.formula.parser import LARGEST_EXPONENT, LONGEST, parse
from compd.model.observations import Observations

PER_LINK: tuple[Port, ...] = ("scale", "link", "base_joint", "platform_joint")
VECTORS: tuple[Port, ...] = ("base_joint", "platform_joint", "plate", "tool", "reference")
# How many values of a nonlinear parameter are tried within its plausible range.
GRID = 9
UM = 1e-3  # mm
TO_MM: Mapping[str, float] = {"um": UM, "mm": 1.0}

# Columns that every machine has: at ports with one value per link, at ports of readings, and at all ports.
OF_LINK: Mapping[str, str] = {
    "scale_mm": "reading of the link's scale since machine zero, mm",
    "link_mm": "length of the link, mm",
    "direction": "1 or -1 as the link last moved, 0 where that is not known",
    "velocity_mm_per_s": "speed of the link, mm/s",
    "axial_force_N": "axial force in the link, N, tension positive; needs the force on the tip",
    "temperature_link": "temperature of the link, degC; any other quantity `NAME_link_<i>_UNIT` likewise as "
    "`NAME_link_UNIT`",
}
OF_READING: Mapping[str, str] = {"reading_mm": "the comparator's or the scale's own reading since machine zero, mm"}
ANYWHERE: Mapping[str, str] = {
    "time_s": "time, s",
    "tip_x_mm": "x of the tip in {M}, mm",
    "tip_y_mm": "y of the tip in {M}, mm",
    "tip_z_mm": "z of the tip in {M}, mm",
}
READING_PORTS: tuple[Port, ...] = ("scale", "joint", "frame")
_PER_LINK_COLUMN = re.compile(r"^[a-z][a-z0-9_]*_link_[A-Za-z]\w*$")
_QUANTITY = re.compile(r"^[a-z][a-z0-9_]*_[A-Za-z0-9]+$")

Finite = Annotated[float, Field(allow_inf_nan=False)]


class FormulaParameter(BaseModel):
    """A parameter of a formula."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    unit: str = Field(description="its unit, for people; the formula's numbers are not converted")
    plausible: tuple[Finite, Finite] = Field(description="lowest and highest value that is plausible")
    source: str = Field(description="where that range comes from")
    per: Literal["machine", "link"] = Field(
        default="machine", description="one value for the machine, or one for each link"
    )


class FormulaDeclaration(BaseModel):
    """The keys of a declaration. The formula gives what is added at the port, in the unit `gives`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")] = Field(description="name of the effect")
    port: Literal["scale", "joint", "frame", "link", "base_joint", "platform_joint", "plate", "tool", "reference"] = (
        Field(description="where it acts")
    )
    formula: str = Field(description=f"what it adds there, in columns and parameters; at most {LONGEST} characters")
    gives: Literal["um", "mm"] = Field(default="um", description="unit of the formula's value")
    axis: Literal["x", "y", "z"] | None = Field(
        default=None, description=f"along which axis; needed at the ports {', '.join(VECTORS)}, and only there"
    )
    parameters: Annotated[
        dict[Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")], FormulaParameter], Field(min_length=1)
    ] = Field(description="the parameters that the formula names; each term holds one that is fitted")
    physics: str = Field(default="Written as a formula.", description="what happens, in a sentence")
    mistaken_for: tuple[str, ...] = Field(default=(), description="ids of effects that look alike")
    separated_by: str = Field(
        default="rows in which the formula's columns change on their own",
        description="measurements that tell it from others",
    )


def formula_effect(source: Mapping[str, Any], where: str) -> Effect:
    """An effect from its declaration, a mapping as YAML gives it.

    The formula's value is in um, or in mm with `gives: mm`; at the ports of vectors `axis` says along which axis.
    Raises ConfigurationError with every problem found, at `where`.
    """
    try:
        declaration = FormulaDeclaration.model_validate(dict(source))
    except ValidationError as error:
        raise ConfigurationError([_problem(detail, where) for detail in error.errors(include_url=False)]) from error
    formula = parse(declaration.formula, tuple(declaration.parameters), f"{where}, formula of {declaration.id}")
    problems = [*_port_problems(declaration, where), *_parameter_problems(declaration, formula, where)]
    needs: list[str] = ["time", "order"] if formula.lags else []
    for name in formula.columns:
        needed = _needs_of_column(name, declaration.port)
        if isinstance(needed, Problem):
            problems.append(replace(needed, where=f"{where}, formula of {declaration.id}", value=name))
        else:
            needs += needed
    if problems:
        raise ConfigurationError(problems)
    return Effect(
        id=declaration.id,
        ports=(declaration.port,),
        physics=declaration.physics,
        equation=f"delta = {declaration.formula}" + (f", along {declaration.axis}" if declaration.axis else ""),
        symbols={
            **{name: f"parameter, {parameter.unit}" for name, parameter in declaration.parameters.items()},
            **dict.fromkeys(formula.columns, "as measured or modelled"),
        },
        source="; ".join(dict.fromkeys(parameter.source for parameter in declaration.parameters.values())),
        needs=tuple(dict.fromkeys(needs)),
        parameters=tuple(
            Parameter(name, parameter.unit, *parameter.plausible, parameter.source, parameter.per)
            for name, parameter in ((name, declaration.parameters[name]) for name in formula.linear)
        ),
        mistaken_for=declaration.mistaken_for,
        separated_by=declaration.separated_by,
        basis=_basis(declaration, formula),
        constants=tuple(_constant(name, declaration.parameters[name]) for name in formula.constants),
        remembers=formula.lags > 0,
    )


def _problem(detail: ErrorDetails, where: str) -> Problem:
    keys = ", ".join(FormulaDeclaration.model_fields) if detail["type"] == "extra_forbidden" else ""
    place = ".".join(str(part) for part in detail["loc"])
    return Problem(where=f"{where}, {place}", what=detail["msg"], value=str(detail["input"])[:80], allowed=keys)


def _port_problems(declaration: FormulaDeclaration, where: str) -> list[Problem]:
    if (declaration.axis is not None) == (declaration.port in VECTORS):
        return []
    allowed = "x, y or z" if declaration.port in VECTORS else "none: this port has no direction"
    return [
        Problem(
            where=f"{where}, axis",
            what=f"does not fit the port {declaration.port}",
            value=str(declaration.axis),
            allowed=allowed,
        )
    ]


def _parameter_problems(declaration: FormulaDeclaration, formula: Formula, where: str) -> list[Problem]:
    problems = []
    for name, parameter in declaration.parameters.items():
        place = f"{where}, parameters.{name}"
        low, high = parameter.plausible
        if not low < high:
            problems.append(
                Problem(
                    where=place,
                    what="the plausible range is empty",
                    value=f"[{low:g}, {high:g}]",
                    allowed="[low, high], low < high",
                )
            )
        if name in (*OF_LINK, *OF_READING, *ANYWHERE, "pi"):
            problems.append(
                Problem(
                    where=place, what="this name is a column's", value=name, next_step="call the parameter otherwise"
                )
            )
        if parameter.per == "link" and (name in formula.constants or declaration.port not in PER_LINK):
            allowed = f"a parameter that the formula is proportional to, at {', '.join(PER_LINK)}"
            problems.append(Problem(where=place, what="cannot be one per link", value=name, allowed=allowed))
        is_exponent = re.search(rf"\*\*\s*{name}\b", declaration.formula)
        if is_exponent and max(abs(low), abs(high)) > LARGEST_EXPONENT:
            problems.append(
                Problem(
                    where=place,
                    what="is an exponent",
                    value=f"[{low:g}, {high:g}]",
                    allowed=f"within +-{LARGEST_EXPONENT:g}",
                )
            )
        is_time_constant = formula.lags and re.search(rf",\s*{name}\s*\)", declaration.formula)
        if is_time_constant and low <= 0 and name in formula.constants:
            problems.append(
                Problem(
                    where=place, what="is a time constant", value=f"[{low:g}, {high:g}]", allowed="a range above 0 s"
                )
            )
    return problems


def _needs_of_column(name: str, port: Port) -> list[str] | Problem:
    """What has to be measured for a column of a formula."""
    if name in ANYWHERE:
        return ["time"] if name == "time_s" else []
    if name in OF_READING and port in READING_PORTS:
        return []
    per_link = name in OF_LINK or _PER_LINK_COLUMN.match(name) is not None
    if per_link and port not in PER_LINK:
        return Problem(where="", what=f"is one per link, and the port {port} has no links", allowed=", ".join(ANYWHERE))
    if per_link:
        words = {
            "direction": ["direction"],
            "velocity_mm_per_s": ["motion"],
            "axial_force_N": ["force"],
            "temperature_link": ["temperature_link_{link}_degC"],
            "scale_mm": [],
            "link_mm": [],
        }
        return words.get(name, [name.replace("_link_", "_link_{link}_", 1)])
    if not _QUANTITY.match(name):
        columns = ", ".join((*ANYWHERE, *(OF_LINK if port in PER_LINK else ())))
        return Problem(
            where="", what="is no column", allowed=f"a measured quantity with its unit (humidity_pct), {columns}"
        )
    return [name]


def _constant(name: str, parameter: FormulaParameter) -> Constant:
    """A nonlinear parameter as a constant that is searched: evenly, or in equal ratios over more than a decade and a
    half."""
    low, high = parameter.plausible
    wide = low > 0 and high / low >= 30
    grid = np.geomspace(low, high, GRID) if wide else np.linspace(low, high, GRID)
    return Constant(name, parameter.unit, low, high, parameter.source, tuple(float(value) for value in grid))


def _basis(declaration: FormulaDeclaration, formula: Formula) -> Any:
    axis = "xyz".index(declaration.axis) if declaration.axis else None
    to_mm = TO_MM[declaration.gives]

    def basis(rows: Observations, constants: ConstantValues, memory: Memory) -> tuple[FloatArray, Memory]:
        places = {"joint": rows.joint_mm.shape[1], "frame": 9, "plate": 3, "tool": 1, "reference": 1}.get(
            declaration.port, rows.links
        )
        states = _lag_states(memory, formula.lags)
        columns = {name: _column(rows, name, declaration.port) for name in formula.columns}
        factors, after = formula.evaluate(columns, constants, rows.time_s, rows.session_start, states)
        parts = []
        for name, factor in factors.items():
            column = to_mm * np.broadcast_to(factor, (len(rows), places))
            single = declaration.parameters[name].per == "machine"
            parts.append(column[:, :, None] if single else column[:, :, None] * np.eye(places))
        values = np.concatenate(parts, axis=2)
        if axis is not None:
            directed = np.zeros((len(rows), places, 6 if declaration.port == "reference" else 3, values.shape[2]))
            directed[:, :, axis] = values
            values = directed.reshape(len(rows), -1, values.shape[2])
        return values, tuple(array for state in after if state is not None for array in state) or None

    return basis


def _lag_states(memory: Memory, lags: int) -> tuple[tuple[FloatArray, ...] | None, ...]:
    """The states of so many lags, three arrays each, from an effect's memory."""
    return tuple(None if memory is None else memory[3 * i : 3 * i + 3] for i in range(lags))


def _column(rows: Observations, name: str, port: Port) -> FloatArray:
    """A column of the formula: (N, places) or (N, 1)."""
    if name == "reading_mm":
        return {"scale": rows.scale_mm, "joint": rows.joint_mm, "frame": rows.frame_mm}[port]
    if name in ("scale_mm", "link_mm", "direction", "velocity_mm_per_s", "axial_force_N"):
        return np.asarray(getattr(rows, name))
    if name == "time_s":
        return rows.time_s[:, None]
    if name.startswith("tip_"):
        return rows.tip_M_mm[:, ["xyz".index(name[4])]]
    if name == "temperature_link":
        name = "temperature_link_degC"
    if _PER_LINK_COLUMN.match(name):
        names = [name.replace("_link_", f"_link_{i + 1}_", 1) for i in range(rows.links)]
        return np.stack([rows.quantity(link_name) for link_name in names], axis=1)
    return rows.quantity(name)[:, None]
