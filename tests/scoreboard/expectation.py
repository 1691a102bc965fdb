"""What a right diagnosis of a case says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from tests.scoreboard import hard_cases as hard
from tests.scoreboard.case import CONSTANT_CAUSES, Case

# A hidden cause whose error is smaller, over the noise, need not be named: its plausible range has ended before the
# size that was asked for.
MIN_FLOORS = 0.45
NAMED = ("identified", "likely", "ambiguous", "partial")
# A recording that cannot show it again: at most likely.
LESS_THAN_IDENTIFIED = NAMED[1:]
# Covariates of a cause that depends on the tip's position: any of its coordinates.
POSITION = ("tip_x_mm", "tip_y_mm", "tip_z_mm")
# Where the reference is a plane these are minus the error itself.
HEIGHTS = ("tip_z_mm", "model_z_mm", "reference_z_mm", "commanded_z_mm")
# Keys of an answer: effects of an external machine that are always there; what no analysis can take away, rms.
ALWAYS_THERE, LEFT_UM = "always_there", "left_um"
# A fit of as many numbers as it has takes a part of that away.
MIN_LEFT_SHARE = 0.7
# From this size on an effect has to be named before `identified` is said of many small ones.
MIN_IDENTIFIED_FLOORS = 1.0


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
    groups : one effect of each has to be named, or one covariate to be followed.
    may_name : effects that may be named besides.
    constant : ids of effects that are to be reported as a constant, each as a step or as what a constant may come from.
    constant_or : likewise, one of each group.
    never : effects that must not be named.
    never_alone : effects that must not be named without a rival.
    follows : one covariate of each group has to be among those that the rest follows.
    first : how many of these count; 0 for all.
    change : a change that has to be reported.
    gross_rows : so many rows have to be left out as gross.
    gross_rows_at_most : not more of them.
    left_um : the residual must not be larger.
    left_um_at_least : nor smaller: so much no analysis can take away.
    or_rival : a rival stands for what is to be named, where the recording cannot tell them apart.
    never_follows : covariates that the rest must not be said to follow.
    identified_needs : one effect of each has to be named where the word is `identified`.
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
    gross_rows_at_most: int | None = None
    left_um: float | None = None
    left_um_at_least: float | None = None
    or_rival: bool = False
    never_follows: tuple[str, ...] = ()
    identified_needs: tuple[tuple[str, ...], ...] = ()

    def as_json(self) -> dict[str, Any]:
        """The keys that are not empty."""
        return {
            key: value
            for key, value in asdict(self).items()
            if value not in ((), None, False) or (value == 0 and key == "gross_rows_at_most")
        }

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
    return _of_a_hard_case(case, answer, Expectation(words, groups, small), change_s)


def _of_a_hard_case(case: Case, answer: Mapping[str, Any], usual: Expectation, change_s: float | None) -> Expectation:
    """What an honest analysis says of a hard case. usual : of a recording like any other, which it is otherwise."""
    there = (*usual.may_name, *answer.get(ALWAYS_THERE, ()))
    left_um = None if LEFT_UM not in answer else MIN_LEFT_SHARE * answer[LEFT_UM]
    usual = replace(usual, may_name=there)
    match case.family:
        case hard.ONE_WARM_UP:
            words = LESS_THAN_IDENTIFIED if usual.groups else ("adequate", "unexplained", *LESS_THAN_IDENTIFIED)
            return replace(usual, verdicts=words, or_rival=True)
        case hard.ROUNDED:
            return replace(usual, left_um_at_least=left_um, or_rival=True)
        case hard.PLACE_BY_PLACE:
            return replace(usual, or_rival=True)
        case hard.WRONG_NOISE if not case.causes:
            return replace(usual, verdicts=("adequate", "unexplained"))
        case hard.PLANE:
            return replace(usual, or_rival=True, left_um_at_least=left_um, never_follows=HEIGHTS)
        case hard.RE_MOUNTED if change_s is not None:
            moved = Change(CONSTANT_CAUSES, change_s)
            return replace(usual, verdicts=("unexplained", *NAMED), may_name=(*there, *CONSTANT_CAUSES), change=moved)
        case hard.MANY_SMALL:
            plain = [name for name in answer["answers"] if answer["error_in_floors"][name] >= MIN_IDENTIFIED_FLOORS]
            return Expectation(
                ("unexplained", *NAMED),
                may_name=tuple(answer["answers"]),
                or_rival=True,
                identified_needs=_groups(plain),
            )
        case hard.ZERO_ELSEWHERE if answer["zero_is_unknown"]:
            # what has grown since then is a constant that nobody can tell from the drawing's errors
            return replace(usual, may_name=(*there, *CONSTANT_CAUSES))
    return usual


def covariates(follows: Sequence[str]) -> tuple[str, ...]:
    """Columns by which a cause outside the library can be described, from what its answer says that it follows."""
    return tuple(column for name in follows for column in (POSITION if name == "position" else (name,)))


def _groups(names: Sequence[str]) -> tuple[tuple[str, ...], ...]:
    """A group for each name; all that make a constant are one group."""
    constant = [name for name in names if name in CONSTANT_CAUSES]
    groups = [(name,) for name in names if name not in constant]
    return (*groups, CONSTANT_CAUSES) if constant else tuple(groups)
