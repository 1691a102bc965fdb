"""Reading a machine's model: the effects that its file names, with their fitted numbers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, count
from pathlib import Path

import numpy as np

from compd.errors import CompdError, Problem, StateError
from compd.model.effects import Effect, FittedEffect, is_measured, needed_quantities
from compd.model.library import find_effect
from compd.model_file.model_document import EffectEntry, ModelDocument, read_document
from compd.model_file.model_file import ModelFile, estimates, with_own_covariance
from compd.plugins import OWN_CODE, Code

# By which a standard error may differ from the covariance's: numbers are written with all their digits.
_ROUNDING = 1e-9


def read_model_file(
    path: Path,
    machine: str,
    links: int | None,
    geometry: str = "",
    content: bytes | None = None,
    code: Code = OWN_CODE,
) -> ModelFile:
    """Read a model file for the machine of this name with so many links.

    links : 0 for an external model of a tip; None for an external model, of as many links as the file has numbers of.
    geometry : hash of the machine's geometry, where numbers that were fitted on another one are of no use.
    content : of the file, where it has been read already.
    code : which Python files its effects may be in; by default a person's own.
    Raises StateError with every problem: what `read_stored` refuses, another machine, an effect that is not
    installed, numbers that are missing.
    """
    document, stored = read_document(path, content)
    if stored.machine != machine:
        raise StateError.of(
            str(path),
            "belongs to another machine",
            value=stored.machine,
            allowed=machine,
            next_step="give this machine's model file, or begin a new one",
        )
    if geometry and stored.geometry and stored.geometry != geometry:
        raise StateError.of(
            str(path),
            "was fitted on another geometry of this machine",
            value=stored.geometry,
            allowed=geometry,
            next_step="fit it again with `compd model fit`",
        )
    problems: list[Problem] = []
    found: list[tuple[Effect, EffectEntry, str]] = []
    for number, entry in enumerate(document.effects, start=1):
        where = f"{path}, effect {number}"
        try:
            effect = find_effect(entry.effect, where, code=code)
            if is_measured(effect):
                effect = replace(effect, counts_from=entry.counts_from)
            found.append((effect, entry, where))
        except CompdError as error:
            problems += error.problems
    if links is None:
        links = max((_links_of(effect, entry) for effect, entry, _ in found), default=0)
    fitted = [_fitted_effect(effect, entry, links, where, problems) for effect, entry, where in found]
    parameters = sum(len(effect.theta) for effect in fitted)
    size = len(document.covariance)
    covariance = np.array(document.covariance, dtype=np.float64).reshape(size, size)
    if not problems and len(covariance) != parameters:
        problems.append(
            Problem(
                f"{path}, covariance",
                "has another size than the parameters",
                value=str(covariance.shape),
                allowed=f"({parameters}, {parameters})",
                next_step="fit it again with `compd model fit`",
            )
        )
    with_covariance = () if problems else with_own_covariance(fitted, covariance)
    for fitted_effect, (_, entry, where) in zip(with_covariance, found, strict=False):
        problems += _error_problems(fitted_effect, entry, links, where)
    if problems:
        raise StateError(problems)
    return ModelFile(
        stored.machine,
        links,
        tuple(entry.effect for entry in document.effects),
        with_covariance,
        covariance,
        stored.steps,
        stored.geometry,
        document.fitted_range,
        {effect.id: entry.plausible for effect, entry, _ in found if entry.plausible},
        tuple(_warnings(document, with_covariance, links, path)),
    )


def _warnings(document: ModelDocument, fitted: Sequence[FittedEffect], links: int, path: Path) -> Iterator[Problem]:
    """What the file does not say of itself, as those of releases up to 0.2 do not."""
    if not document.checksum:
        yield Problem(
            str(path),
            "has no checksum: what was changed in it after it was written cannot be seen",
            next_step="`compd model fit` writes one",
        )
    needed = dict.fromkeys(chain.from_iterable(needed_quantities(effect.effect, links) for effect in fitted))
    if unknown := [name for name in needed if name not in document.fitted_range]:
        yield Problem(
            str(path),
            "does not say in which range it was fitted: its effects are extrapolated without a limit",
            value=", ".join(unknown),
            next_step="fit it again with `compd model fit`",
        )


def _links_of(effect: Effect, entry: EffectEntry) -> int:
    """How many links the file has numbers of an effect for; 0 where it has none for single links."""
    names = {parameter.name for parameter in entry.parameters}
    of_links = [parameter for parameter in effect.parameters if parameter.per in ("scale", "link")]
    return next(i for i in count() if not any(f"{parameter.name}_{i + 1}" in names for parameter in of_links))


def _fitted_effect(effect: Effect, entry: EffectEntry, links: int, where: str, problems: list[Problem]) -> FittedEffect:
    """The effect with its numbers; what is missing, or in another unit, goes to `problems`."""
    values = {parameter.name: parameter.value for parameter in entry.parameters}
    units = {parameter.name: parameter.unit for parameter in entry.parameters}
    columns = effect.columns(links)
    names = [column.name for column in columns]
    if sorted(values) != sorted(names):
        problems.append(
            Problem(
                where,
                f"has not the parameters of {effect.id}",
                value=", ".join(values),
                allowed=", ".join(names),
                next_step="fit it again with `compd model fit`",
            )
        )
        return FittedEffect(effect, np.zeros(len(columns)))
    problems += [
        Problem(
            f"{where}, {effect.id}, {column.name}",
            "is in another unit than the effect has" if units[column.name] else "has no unit",
            value=f"unit: {units[column.name]}" if units[column.name] else "",
            allowed=f"unit: {column.parameter.unit}",
            next_step=f"write the value in {column.parameter.unit}, and `unit: {column.parameter.unit}`",
        )
        for column in columns
        if units[column.name] != column.parameter.unit
    ]
    known = [*names, *(constant.name for constant in effect.constants)]
    problems += [
        Problem(
            f"{where}, {effect.id}, plausible",
            "is a range of no number of this effect",
            value=name,
            allowed=", ".join(known),
            next_step="mend the name, or remove it",
        )
        for name in entry.plausible
        if name not in known
    ]
    theta = np.array([column.parameter.to_theta(values[column.name]) for column in columns])
    shape = {c.name: c.unstated for c in effect.constants if c.unstated is not None} | entry.shape
    missing = [constant.name for constant in effect.constants if constant.name not in shape]
    if missing:
        problems.append(
            Problem(
                where,
                f"has not the shape constants of {effect.id}",
                allowed=", ".join(missing),
                next_step="remove the effect and add it again: `compd model add` searches them",
            )
        )
    return FittedEffect(effect, theta, shape)


def _error_problems(fitted: FittedEffect, entry: EffectEntry, links: int, where: str) -> Iterator[Problem]:
    """Standard errors that are not those of the covariance: one of the two was changed."""
    said = {parameter.name: parameter.std for parameter in entry.parameters}
    for estimate in estimates(fitted, links):
        std, of_covariance = said[estimate["name"]], estimate["std"]
        if math.isnan(std) or math.isclose(std, of_covariance, rel_tol=_ROUNDING):
            continue
        yield Problem(
            f"{where}, {fitted.effect.id}, {estimate['name']}",
            "has a standard error that is not the one of the covariance",
            value=f"std: {std:g}",
            allowed=f"std: {of_covariance:g}",
            next_step="write that one, or mend the covariance",
        )
