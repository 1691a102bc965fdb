"""An effect that a person writes into a file, with no code: a port, a formula, parameters with plausible ranges."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from compd.arrays import FloatArray
from compd.errors import ConfigurationError, Problem
from compd.model.effect import Constant, ConstantValues, Effect, Memory, Parameter, Port
from compd.model.formula.evaluator import Formula
from compd.model.formula.parser import LARGEST_EXPONENT, parse
from compd.model.observations import Observations

PER_LINK: tuple[Port, ...] = ("scale", "link", "base_joint", "platform_joint")
VECTORS: tuple[Port, ...] = ("base_joint", "platform_joint", "plate", "tool", "reference")
# A parameter of which nothing but its range is known is searched at so many places.
GRID = 9
UM = 1e-3  # mm
TO_MM: Mapping[str, float] = {"um": UM, "mm": 1.0}

# Columns that the machine itself gives: at ports that have a link, and everywhere.
OF_LINK = ("scale_mm", "link_mm", "direction", "velocity_mm_per_s", "axial_force_N", "temperature_link")
ANYWHERE = ("time_s", "tip_x_mm", "tip_y_mm", "tip_z_mm")
_PER_LINK_COLUMN = re.compile(r"^[a-z][a-z0-9_]*_link_[A-Za-z]\w*$")
_QUANTITY = re.compile(r"^[a-z][a-z0-9_]*_[A-Za-z0-9]+$")

Finite = Annotated[float, Field(allow_inf_nan=False)]


class FormulaParameter(BaseModel):
    """A parameter of a formula."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    unit: str
    plausible: tuple[Finite, Finite]
    source: str
    per: Literal["machine", "link"] = "machine"


class FormulaDeclaration(BaseModel):
    """What a person writes. The formula gives what is added at the port, in the unit `gives`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    port: Literal["scale", "joint", "frame", "link", "base_joint", "platform_joint", "plate", "tool", "reference"]
    formula: str
    gives: Literal["um", "mm"] = "um"
    axis: Literal["x", "y", "z"] | None = None
    parameters: Annotated[
        dict[Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")], FormulaParameter], Field(min_length=1)
    ]
    physics: str = "Written as a formula."
    mistaken_for: tuple[str, ...] = ()
    separated_by: str = "rows in which the formula's columns change on their own"


def formula_effect(declaration: Mapping[str, Any], where: str) -> Effect:
    """An effect from its declaration (a mapping, as YAML gives it).

    The formula's value is in um, or in mm with `gives: mm`; at the ports of vectors `axis` says along which axis.
    Raises ConfigurationError with every problem found, at `where`.
    """
    try:
        written = FormulaDeclaration.model_validate(dict(declaration))
    except ValidationError as error:
        raise ConfigurationError([_invalid(detail, where) for detail in error.errors(include_url=False)]) from error
    formula = parse(written.formula, tuple(written.parameters), f"{where}, formula of {written.id}")
    problems = [*_about_port(written, where), *_about_parameters(written, formula, where)]
    needs: list[str] = ["time", "order"] if formula.lags else []
    for name in formula.columns:
        found = _need(name, written.port)
        if isinstance(found, Problem):
            problems.append(
                Problem(where=f"{where}, formula of {written.id}", what=found.what, value=name, allowed=found.allowed)
            )
        else:
            needs += found
    if problems:
        raise ConfigurationError(problems)
    return Effect(
        id=written.id,
        ports=(written.port,),
        physics=written.physics,
        equation=f"delta = {written.formula}" + (f", along {written.axis}" if written.axis else ""),
        symbols={
            **{name: f"parameter, {parameter.unit}" for name, parameter in written.parameters.items()},
            **dict.fromkeys(formula.columns, "as measured or modelled"),
        },
        source="; ".join(dict.fromkeys(parameter.source for parameter in written.parameters.values())),
        needs=tuple(dict.fromkeys(needs)),
        parameters=tuple(
            Parameter(name, one.unit, *one.plausible, one.source, one.per)
            for name, one in ((name, written.parameters[name]) for name in formula.linear)
        ),
        mistaken_for=written.mistaken_for,
        separated_by=written.separated_by,
        basis=_basis(written, formula),
        constants=tuple(_constant(name, written.parameters[name]) for name in formula.shape),
        remembers=formula.lags > 0,
    )


def _invalid(detail: ErrorDetails, where: str) -> Problem:
    keys = ", ".join(FormulaDeclaration.model_fields) if detail["type"] == "extra_forbidden" else ""
    place = ".".join(str(part) for part in detail["loc"])
    return Problem(where=f"{where}, {place}", what=detail["msg"], value=str(detail["input"])[:80], allowed=keys)


def _about_port(written: FormulaDeclaration, where: str) -> list[Problem]:
    if (written.axis is not None) == (written.port in VECTORS):
        return []
    allowed = "x, y or z" if written.port in VECTORS else "none: this port has no direction"
    return [
        Problem(
            where=f"{where}, axis",
            what=f"does not fit the port {written.port}",
            value=str(written.axis),
            allowed=allowed,
        )
    ]


def _about_parameters(written: FormulaDeclaration, formula: Formula, where: str) -> list[Problem]:
    found = []
    for name, one in written.parameters.items():
        place = f"{where}, parameters.{name}"
        low, high = one.plausible
        if not low < high:
            found.append(
                Problem(
                    where=place,
                    what="the plausible range is empty",
                    value=f"[{low:g}, {high:g}]",
                    allowed="[low, high], low < high",
                )
            )
        if name in (*OF_LINK, *ANYWHERE, "pi", "reading_mm"):
            found.append(
                Problem(
                    where=place, what="this name is a column's", value=name, next_step="call the parameter otherwise"
                )
            )
        if one.per == "link" and (name in formula.shape or written.port not in PER_LINK):
            allowed = f"a parameter that the formula is proportional to, at {', '.join(PER_LINK)}"
            found.append(Problem(where=place, what="cannot be one per link", value=name, allowed=allowed))
        exponents = re.search(rf"\*\*\s*{name}\b", written.formula)
        if exponents and max(abs(low), abs(high)) > LARGEST_EXPONENT:
            found.append(
                Problem(
                    where=place,
                    what="is an exponent",
                    value=f"[{low:g}, {high:g}]",
                    allowed=f"within +-{LARGEST_EXPONENT:g}",
                )
            )
        if re.search(rf",\s*{name}\s*\)", written.formula) and formula.lags and low <= 0 and name in formula.shape:
            found.append(
                Problem(
                    where=place, what="is a time constant", value=f"[{low:g}, {high:g}]", allowed="a range above 0 s"
                )
            )
    return found


def _need(name: str, port: Port) -> list[str] | Problem:
    """What has to be measured for a column of a formula."""
    if name in ANYWHERE:
        return ["time"] if name == "time_s" else []
    if name == "reading_mm" and port in ("scale", "joint", "frame"):
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


def _constant(name: str, one: FormulaParameter) -> Constant:
    low, high = one.plausible
    wide = low > 0 and high / low >= 30
    grid = np.geomspace(low, high, GRID) if wide else np.linspace(low, high, GRID)
    return Constant(name, one.unit, low, high, one.source, tuple(float(value) for value in grid))


def _basis(written: FormulaDeclaration, formula: Formula) -> Any:
    axis = "xyz".index(written.axis) if written.axis else None
    to_mm = TO_MM[written.gives]

    def basis(rows: Observations, shape: ConstantValues, memory: Memory) -> tuple[FloatArray, Memory]:
        places = {"joint": rows.joint_mm.shape[1], "frame": 9, "plate": 3, "tool": 1, "reference": 1}.get(
            written.port, rows.links
        )
        states = _unpacked(memory, formula.lags)
        columns = {name: _column(rows, name, written.port) for name in formula.columns}
        factors, after = formula.evaluate(columns, shape, rows.time_s, rows.session_start, states)
        parts = []
        for name, factor in factors.items():
            values = to_mm * np.broadcast_to(factor, (len(rows), places))
            single = written.parameters[name].per == "machine"
            parts.append(values[:, :, None] if single else values[:, :, None] * np.eye(places))
        together = np.concatenate(parts, axis=2)
        if axis is not None:
            directed = np.zeros((len(rows), places, 6 if written.port == "reference" else 3, together.shape[2]))
            directed[:, :, axis] = together
            together = directed.reshape(len(rows), -1, together.shape[2])
        return together, tuple(array for state in after if state is not None for array in state) or None

    return basis


def _unpacked(memory: Memory, lags: int) -> tuple[tuple[FloatArray, ...] | None, ...]:
    """A lag's state is three arrays."""
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
        named = [name.replace("_link_", f"_link_{i + 1}_", 1) for i in range(rows.links)]
        return np.stack([rows.quantity(one) for one in named], axis=1)
    return rows.quantity(name)[:, None]
