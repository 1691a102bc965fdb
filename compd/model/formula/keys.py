"""The keys of an effect that is declared without code, as people write them in YAML."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError
from pydantic_core import ErrorDetails

from compd.documents import Finite
from compd.errors import ConfigurationError, Problem
from compd.model.formula.basis import VECTORS
from compd.model.formula.parser import LONGEST

# Tags of the two kinds of formula, which pydantic puts into the place of an error.
_ONE, _BY_AXIS = "text", "by axis"

AxisFormulas = Annotated[dict[Literal["x", "y", "z"], str], Field(min_length=1)]


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
    formula: (
        Annotated[
            Annotated[str, Tag(_ONE)] | Annotated[AxisFormulas, Tag(_BY_AXIS)],
            Discriminator(lambda value: _BY_AXIS if isinstance(value, dict) else _ONE),
        ]
        | None
    ) = Field(
        default=None,
        description=f"what it adds there, in columns and parameters; at most {LONGEST} characters. At the ports "
        f"{', '.join(VECTORS)} one for each axis on which it acts, `{{x: ..., y: ...}}`, which share the parameters",
    )
    sensitivity: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")] | None = Field(
        default=None,
        description="in place of a formula, the NAME of a parameter of a model of your own: the recording's columns "
        "`d_NAME_x_mm`, `d_NAME_y_mm`, `d_NAME_z_mm` (port reference) or `d_NAME_link_1_mm` ... (port link) are the "
        "prediction's derivatives by it, in mm per unit of the effect's one parameter (`d_NAME_x_arcsec` where the "
        "reference is in arcsec)",
    )
    gives: Literal["um", "mm"] = Field(default="um", description="unit of the formula's value")
    axis: Literal["x", "y", "z"] | None = Field(
        default=None,
        description=f"along which axis a single formula acts; needed at the ports {', '.join(VECTORS)}, and only there",
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

    @property
    def formulas(self) -> Mapping[str, str]:
        """Axis -> formula; the axis is "" at a port without direction. Empty where there is a sensitivity instead."""
        if isinstance(self.formula, str):
            return {self.axis or "": self.formula}
        return {str(axis): formula for axis, formula in (self.formula or {}).items()}


def read_declaration(source: Mapping[str, Any], where: str) -> FormulaDeclaration:
    """The declaration, a mapping as YAML gives it.

    Raises ConfigurationError with every key that is missing, unknown or wrong, at `where`.
    """
    try:
        return FormulaDeclaration.model_validate(dict(source))
    except ValidationError as error:
        raise ConfigurationError([_problem(detail, where) for detail in error.errors(include_url=False)]) from error


def _problem(detail: ErrorDetails, where: str) -> Problem:
    """One of pydantic's errors in the words of the person who wrote the declaration."""
    location = [part for part in detail["loc"] if part not in (_ONE, _BY_AXIS)]
    in_parameter = location[:1] == ["parameters"] and len(location) > 2
    keys = list((FormulaParameter if in_parameter else FormulaDeclaration).model_fields)
    place = ".".join(str(part) for part in location if part != "[key]")
    value = "" if detail["type"] == "missing" else str(detail["input"])[:80]
    what, allowed, next_step = detail["msg"], "", ""
    if detail["type"] == "missing":
        what, next_step = "is missing", f"add `{location[-1]}:`"
    elif detail["type"] == "extra_forbidden":
        what, allowed = "unknown key", ", ".join(keys)
        close = difflib.get_close_matches(str(location[-1]), keys, n=1, cutoff=0.6)
        next_step = f"did you mean `{close[0]}`?" if close else "remove it"
    elif detail["type"] == "literal_error":
        what, allowed = "is none of the choices", str(detail.get("ctx", {}).get("expected", ""))
    elif detail["type"] == "string_pattern_mismatch":
        what, allowed = "is no name", f"the pattern {detail.get('ctx', {}).get('pattern')}"
    return Problem(f"{where}, {place}", what, value=value, allowed=allowed, next_step=next_step)
