"""Thresholds: the numbers of a verdict, each a field of a frozen class, with its unit, its meaning and its reason."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import Field, field, fields, is_dataclass, replace
from typing import Any, TypeVar

T = TypeVar("T")


def threshold(value: float | tuple[float, ...], *, unit: str, meaning: str, reason: str) -> Any:
    """A field of a frozen dataclass of thresholds; unit, meaning and reason are its metadata, "1" is no unit."""
    return field(default=value, metadata={"unit": unit, "meaning": meaning, "reason": reason})


def thresholds(kind: type[Any]) -> dict[str, Field[Any]]:
    """Every threshold of a class of criteria by its name, of a section with the section's: "search.max_members"."""
    return dict(_thresholds(kind, ""))


def _thresholds(kind: type[Any], section: str) -> Iterator[tuple[str, Field[Any]]]:
    for member in fields(kind):
        if is_dataclass(member.default):
            yield from _thresholds(type(member.default), f"{member.name}.")
        else:
            yield f"{section}{member.name}", member


def with_value(criteria: T, name: str, value: object) -> T:
    """The criteria with another value of one threshold, by its name in `thresholds`.

    Example: with_value(Criteria(), "search.max_members", 3).
    """
    section, _, own = name.rpartition(".")
    if section:
        return replace(criteria, **{section: replace(getattr(criteria, section), **{own: value})})  # type: ignore[type-var]
    return replace(criteria, **{own: value})  # type: ignore[type-var]
