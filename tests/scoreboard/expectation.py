"""What a right diagnosis of a case says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from tests.scoreboard.cases import CONSTANT_CAUSES, Case

# A hidden cause whose error is smaller, over the noise, need not be named: its plausible range has ended before the
# size that was asked for.
MIN_FLOORS = 0.45
NAMED = ("identified", "ambiguous", "partial")
# Covariates of a cause that depends on the tip's position: any of its coordinates.
POSITION = ("tip_x_mm", "tip_y_mm", "tip_z_mm")


@dataclass(frozen=True)
class Change:
    """An effect that begins or changes. effects : any of these ids is right. time_s : when."""

    effects: tuple[str, ...]
    time_s: float


@dataclass(frozen=True)
class Expectation:
    """Attributes
    ----------
    verdicts : the words that are right.
    groups : one effect of each has to be named.
    may_name : effects that may be named besides.
    constant : ids of effects that are to be reported as a constant, each as a step or as what a constant may come from.
    constant_or : likewise, one of each group.
    never : effects that must not be named.
    never_alone : effects that must not be named without a rival.
    follows : one covariate of each group has to be among those that the rest follows.
    first : how many of these count; 0 for all.
    change : a change that has to be reported.
    gross_rows : so many rows have to be left out as gross.
    left_um : the residual must not be larger.
    """

    verdicts: tuple[str, ...]
    groups: tuple[tuple[str, ...], ...] = ()
    may_name: tuple[str, ...] = ()
    constant: tuple[str, ...] = ()
    constant_or: tuple[tuple[str, ...], ...] = ()
    never: tuple[str, ...] = ()
    never_alone: tuple[str, ...] = ()
    follows: tuple[tuple[str, ...], ...] = ()
    first: int = 0
    change: Change | None = None
    gross_rows: int = 0
    left_um: float | None = None

    def as_json(self) -> dict[str, Any]:
        """The keys that are not empty."""
        return {key: value for key, value in asdict(self).items() if value not in ((), None, 0)}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Expectation:
        """From `as_json`, or from an entry of answers.yaml. Raises KeyError for a key that is not known."""
        known = {field.name for field in fields(cls)}
        if unknown := set(data) - known:
            raise KeyError(f"unknown: {', '.join(sorted(unknown))}; known: {', '.join(sorted(known))}")
        values = {key: _tuples(value) for key, value in data.items()}
        if change := data.get("change"):
            values["change"] = Change(tuple(change["effects"]), float(change["time_s"]))
        return cls(**values)


def _tuples(value: Any) -> Any:
    return tuple(_tuples(part) for part in value) if isinstance(value, list | tuple) else value


def expectation(case: Case, answer: Mapping[str, Any], change_s: float | None) -> Expectation:
    """What a diagnosis of this simulated case should say.

    answer : `effects`, `answers`, `follows` and `error_in_floors`, as the simulation's answer has them.
    """
    floors: Mapping[str, float] = answer["error_in_floors"]
    large = [name for name in answer["answers"] if floors[name] >= MIN_FLOORS]
    small = tuple(name for name in answer["answers"] if name not in large)
    groups = _groups(large)
    words = NAMED if groups else ("adequate", *NAMED[:-1])
    match case.family:
        case "nothing":
            return Expectation(("adequate",))
        case "drift":
            return Expectation(("unexplained", "not_testable"))
        case "outside":
            return Expectation(("unexplained",), follows=(covariates(answer["follows"]),), first=2)
        case "blind":
            return Expectation(("unexplained", "partial", "not_testable"), may_name=tuple(large) + small)
        case "change" if change_s is not None:
            (changing,) = _groups(answer["answers"])
            return Expectation(("unexplained", *NAMED), may_name=changing, change=Change(changing, change_s))
        case "shifted":
            return Expectation(NAMED, (*groups, CONSTANT_CAUSES), small)
    return Expectation(words, groups, small)


def covariates(follows: Sequence[str]) -> tuple[str, ...]:
    """Columns by which a cause outside the library can be described, from what its answer says that it follows."""
    return tuple(column for name in follows for column in (POSITION if name == "position" else (name,)))


def _groups(names: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """A group for each name; all that make a constant are one group."""
    constant = [name for name in names if name in CONSTANT_CAUSES]
    groups = [(name,) for name in names if name not in constant]
    return (*groups, CONSTANT_CAUSES) if constant else tuple(groups)
