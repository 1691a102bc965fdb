"""Check of a formula while it is typed: every problem with its field, and names that are no column yet."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from compd.errors import CompdError, Problem
from compd.model.effects import Effect, Observations, unmet_needs
from compd.model.formula import ANYWHERE, FUNCTIONS, NUMBERS, OF_LINK, OF_READING, column_needs, formula_effect
from compd.page.workbench.own_effects import too_large

_WHERE = "formula"
_FORMULA = re.compile(r"formula(?: of [a-z0-9_]+)?(?:(?:\.|, )(?P<axis>[xyz]))?(?:, character (?P<character>\d+))?")
_PARAMETER = re.compile(r"parameters(?:\.(?P<parameter>[A-Za-z]\w*))?(?:\.(?P<part>[a-z]+)(?:\.(?P<end>[01]))?)?")
_NAME = re.compile(r"(?<![\w.])[A-Za-z][A-Za-z0-9_]*(?![\w]|\s*\()")
_PARAMETER_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_FIELDS = ("id", "port", "formula", "axis", "gives", "parameters", "physics", "sensitivity")


class FieldProblem(NamedTuple):
    """A problem with one field of the form.

    field : key of the declaration, "" for none. axis : of the formula. parameter, part : `low`, `unit` ... of one.
    character : in the formula, from 1; None where not known.  text : in words.
    """

    field: str
    text: str
    axis: str = ""
    parameter: str = ""
    part: str = ""
    character: int | None = None


class Checked(NamedTuple):
    """A checked declaration.

    effect : None if it has a mistake.  problems : of its fields; of an effect without mistake, why it is not tried.
    missing : names in the formula that are neither columns nor parameters.
    """

    effect: Effect | None
    problems: tuple[FieldProblem, ...]
    missing: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """As plain data."""
        problems = [problem._asdict() for problem in self.problems]
        return {"right": self.effect is not None, "problems": problems, "missing": list(self.missing)}


def check(declaration: Mapping[str, Any], rows: Observations, present: Sequence[str] = ()) -> Checked:
    """Check a declaration while it is typed. rows : of the recording. present : ids of the model's effects."""
    missing = _missing(declaration)
    effect, problems = _effect(declaration)
    if effect is None:
        if not any(_place(problem).field == "formula" for problem in problems):
            # an empty field must not hide a mistake in the formula
            stand_in, further = _effect(_with_stand_ins(declaration, missing))
            problems += [problem for problem in further if _place(problem).field == "formula"]
            problems += _reasons_not_to_try(stand_in, rows) if stand_in else []
        return Checked(None, _field_problems(problems, declaration), missing)
    problems = _reasons_not_to_try(effect, rows)
    if effect.id in present:
        step = "give it another id, or take that one out of the model"
        problems.append(Problem(f"{_WHERE}, id", "is in the model already", value=effect.id, next_step=step))
    return Checked(effect, _field_problems(problems, declaration), missing)


def _effect(declaration: Mapping[str, Any]) -> tuple[Effect | None, list[Problem]]:
    effect, problems = None, list[Problem]()
    try:
        effect = formula_effect(declaration, _WHERE)
    except CompdError as error:
        problems += error.problems
    return (None if problems else effect), problems


def _reasons_not_to_try(effect: Effect, rows: Observations) -> list[Problem]:
    place = f"{_WHERE}, formula of {effect.id}"
    unmet = unmet_needs(effect, rows.available, rows.links, rows.quantities_at_zero)
    return [replace(problem, where=place) for problem in unmet] + too_large(effect, place)


def _with_stand_ins(declaration: Mapping[str, Any], missing: Sequence[str]) -> dict[str, Any]:
    """The declaration's formula in an otherwise valid declaration. missing : names that will be parameters."""
    parameters = declaration.get("parameters")
    names = (*(parameters if isinstance(parameters, Mapping) else ()), *missing)
    stand_in = {"unit": "", "plausible": [0.5, 1], "source": ""}
    return {
        **{key: declaration[key] for key in ("port", "formula", "axis") if key in declaration},
        "id": "effect",
        "parameters": {name: stand_in for name in names if _PARAMETER_NAME.fullmatch(str(name))},
    }


def _missing(declaration: Mapping[str, Any]) -> tuple[str, ...]:
    """Names in the formula that can only be parameters, and are not declared yet."""
    formula, parameters = declaration.get("formula"), declaration.get("parameters")
    texts = formula.values() if isinstance(formula, Mapping) else [formula]
    known = {*ANYWHERE, *OF_LINK, *OF_READING, *FUNCTIONS, *NUMBERS, "lag"}
    known |= set(parameters) if isinstance(parameters, Mapping) else set()
    names = [name for text in texts if isinstance(text, str) for name in _NAME.findall(text)]
    return tuple(
        name for name in dict.fromkeys(names) if name not in known and isinstance(column_needs(name, "link"), Problem)
    )


def _place(problem: Problem) -> FieldProblem:
    """The field of a problem, without words."""
    where = problem.where.removeprefix(f"{_WHERE}, ")
    if match := _FORMULA.fullmatch(where):
        character = match["character"]
        return FieldProblem("formula", "", match["axis"] or "", character=int(character) if character else None)
    if match := _PARAMETER.fullmatch(where):
        part = {"0": "low", "1": "high"}.get(match["end"] or "", match["part"] or "")
        return FieldProblem("parameters", "", parameter=match["parameter"] or "", part=part)
    return FieldProblem(where if where in _FIELDS else "", "")


def _field_problems(problems: Sequence[Problem], declaration: Mapping[str, Any]) -> tuple[FieldProblem, ...]:
    formula = declaration.get("formula")
    typed = list(formula.values()) if isinstance(formula, Mapping) else [formula]
    return tuple(_place(problem)._replace(text=words(problem, typed)) for problem in problems)


def words(problem: Problem, typed: Sequence[object] = ()) -> str:
    """A problem without its location, and without the text of its field."""
    value = "" if problem.value in ("", "None") or problem.value in typed else f" ({problem.value})"
    text = f"{problem.what}{value}"
    text += f"; allowed: {problem.allowed}" if problem.allowed else ""
    return f"{text}; {problem.next_step}" if problem.next_step else text
