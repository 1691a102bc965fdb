"""Thresholds: the numbers of a verdict. Each is a field of a frozen class, with "unit | meaning | reason" under it."""

from __future__ import annotations

import ast
import inspect
from dataclasses import fields, is_dataclass, replace
from functools import cache
from itertools import pairwise
from textwrap import dedent
from typing import Any, NamedTuple, TypeVar

T = TypeVar("T")


class Threshold(NamedTuple):
    """One number of a verdict. Unit "1" is no unit."""

    default: Any
    unit: str
    meaning: str
    reason: str


def thresholds(kind: type[Any]) -> dict[str, Threshold]:
    """Every threshold of a class of criteria by its name, of a section with the section's: "search.max_members"."""
    found: dict[str, Threshold] = {}
    texts = _texts(kind)  # type: ignore[arg-type]  # classes are hashable
    for field in fields(kind):
        if is_dataclass(section := field.default):
            found |= {f"{field.name}.{name}": each for name, each in thresholds(type(section)).items()}
        else:
            found[field.name] = Threshold(field.default, *texts[field.name].split(" | "))
    return found


@cache
def _texts(kind: type[Any]) -> dict[str, str]:
    """The string under each field, in the source of the class."""
    declared = ast.parse(dedent(inspect.getsource(kind))).body[0]
    texts: dict[str, str] = {}
    for pair in pairwise(declared.body if isinstance(declared, ast.ClassDef) else ()):
        match pair:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                texts[name] = " ".join(text.split())
    return texts


def with_value(criteria: T, name: str, value: object) -> T:
    """The criteria with another value of one threshold, by its name in `thresholds`.

    Example: with_value(Criteria(), "search.max_members", 3).
    """
    section, _, own = name.rpartition(".")
    if section:
        return replace(criteria, **{section: replace(getattr(criteria, section), **{own: value})})  # type: ignore[type-var]
    return replace(criteria, **{own: value})  # type: ignore[type-var]
