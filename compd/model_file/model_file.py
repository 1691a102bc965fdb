"""A machine's model: its effects with their fitted numbers, and the ledger of how they came to be.

`compd.model_file.model_document` has the keys of the file that a model is kept in.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from compd.arrays import FloatArray
from compd.errors import CompdError, Problem, StateError
from compd.model.effects import Effect, FittedEffect, is_measured, needed_quantities
from compd.model.library import find_effect
from compd.model_file.model_document import (
    Declaration,
    EffectEntry,
    ModelDocument,
    ModelStep,
    State,
    StoredModel,
    read_document,
    write_stored,
)
from compd.plugins import OWN_CODE, Code
from compd.result_tables import Columns, data_frame, html_table

if TYPE_CHECKING:
    import pandas as pd

# Lowest and highest value.
Range: TypeAlias = tuple[float, float]
# By which a standard error may differ from the covariance's: numbers are written with all their digits.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class EffectNumber:
    """One number of an effect, in the unit that people read.

    Attributes
    ----------
    effect : str
        Id of the effect.
    parameter : str
        Name of the parameter; with ``_1``, ``_x`` where there is one per link or axis.
    value : float
        Its value, in `unit`.
    standard_error : float
        In `unit`; nan where it is not known.
    unit : str
        For instance ``"ppm/K"``.
    plausible_low : float
        Lower end of the plausible range, in `unit`.
    plausible_high : float
        Upper end of the plausible range, in `unit`.
    searched : bool
        A nonlinear constant, which was searched and has no standard error.
    """

    effect: str
    parameter: str
    value: float
    standard_error: float
    unit: str
    plausible_low: float
    plausible_high: float
    searched: bool

    @property
    def undetermined(self) -> bool:
        """Whether its standard error is larger than the plausible range; not where it is not known."""
        return self.standard_error > self.plausible_high - self.plausible_low

    @property
    def plausible(self) -> bool:
        """Whether it lies in the plausible range."""
        return self.plausible_low <= self.value <= self.plausible_high


@dataclass(frozen=True, repr=False)
class ModelFile:
    """The effects that a machine's model has, with their fitted numbers, and the ledger of how they came to be.

    `open_model` reads one, `add_effect` begins one or adds to it, `write` keeps it. It is never changed in place.

    Attributes
    ----------
    machine : str
        Name of the machine's configuration, or ``"external"``.
    links : int
        Number of the machine's links; of an external model 0, or the number of links whose length it predicts.
    declared : tuple of str or dict
        Each effect as it was named: an id, ``/absolute/file.py:NAME``, or a formula written out.
    fitted : tuple of FittedEffect
        The same effects with their P fitted numbers.
    covariance : (P, P) array
        Of all fitted numbers jointly, in the order of `fitted`.
    steps : tuple of ModelStep
        The ledger: every change, with the recording it was fitted on and the error before and after.
    geometry : str
        Hash of the geometry that it was fitted on; ``""`` where that is not known.
    fitted_range : dict
        Lowest and highest value of each quantity that the effects read, in the rows that they were fitted to, by the
        quantity's name; empty where that is not known. Beyond it the daemon computes with the nearer end.
    plausible : dict
        Ranges that a person means in place of the effects' own, by the effect's id and the number's name.
    warnings : tuple of Problem
        What the file, as it was read, does not say of itself.
    """

    machine: str
    links: int
    declared: tuple[Declaration, ...] = ()
    fitted: tuple[FittedEffect, ...] = ()
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    steps: tuple[ModelStep, ...] = ()
    geometry: str = ""
    fitted_range: Mapping[str, Range] = field(default_factory=dict)
    plausible: Mapping[str, Mapping[str, Range]] = field(default_factory=dict)
    warnings: tuple[Problem, ...] = ()

    def write(self, path: str | Path) -> None:
        """Write the model file (YAML), whole or not at all; an existing file is replaced.

        Parameters
        ----------
        path : str or Path
            Where to. `compd adopt` takes the file into the running daemon.

        Raises
        ------
        StateError
            Where the disk refuses.
        """
        write_stored(Path(path), StoredModel(self.machine, self.state(), self.steps, self.geometry))

    def state(self) -> State:
        """The effects as plain data, for the file."""
        effects = [
            {
                "effect": declared if isinstance(declared, str) else dict(declared),
                **({"counts_from": fitted.effect.counts_from} if is_measured(fitted.effect) else {}),
                "shape": {name: float(value) for name, value in fitted.constants.items()},
                "parameters": _estimates(fitted, self.links),
                **({"plausible": _lists(meant)} if (meant := self.plausible.get(fitted.effect.id)) else {}),
            }
            for declared, fitted in zip(self.declared, _with_own_covariance(self.fitted, self.covariance), strict=True)
        ]
        ranges = {"fitted_range": _lists(self.fitted_range)} if self.fitted_range else {}
        return {"effects": effects, "covariance": self.covariance.tolist(), **ranges}

    def to_dataframe(self) -> pd.DataFrame:
        """One row per number of each effect, as a pandas data frame.

        Returns
        -------
        pandas.DataFrame
            Columns `effect`, `parameter`; `value`, `standard_error`, `plausible_low` and `plausible_high`, all in
            `unit`; and `searched`, true for a nonlinear constant, which has no standard error: nan.

        Raises
        ------
        CompdError
            Where pandas is not installed.
        """
        return data_frame(self._columns())

    def _repr_html_(self) -> str:
        remarks = [
            f"{step.kind} {step.effect} on {step.recording}: "
            f"{step.rms_before_um:.3g} to {step.rms_after_um:.3g} {step.unit}" + (" (undone)" if step.undone else "")
            for step in self.steps
        ]
        return html_table(str(self), self._columns(), remarks)

    def __str__(self) -> str:
        names = ", ".join(fitted.effect.id for fitted in self.fitted) or "no effects"
        return f"Model of {self.machine}: {names}"

    def __repr__(self) -> str:
        return f"<{self}>"

    def numbers(self) -> list[EffectNumber]:
        """Every number of every effect: its parameters, then its searched nonlinear constants."""
        numbers: list[EffectNumber] = []
        for fitted in _with_own_covariance(self.fitted, self.covariance):
            effect = fitted.effect
            meant = self.plausible.get(effect.id, {})
            for column, estimate in zip(effect.columns(self.links), _estimates(fitted, self.links), strict=True):
                name, value, std, unit = estimate.values()
                low, high = meant.get(name, (column.parameter.low, column.parameter.high))
                numbers.append(EffectNumber(effect.id, name, value, std, unit, low, high, False))
            for constant in effect.constants:
                value, unit = float(fitted.constants[constant.name]), constant.unit
                low, high = meant.get(constant.name, (constant.low, constant.high))
                numbers.append(EffectNumber(effect.id, constant.name, value, np.nan, unit, low, high, True))
        return numbers

    def _columns(self) -> Columns:
        numbers = self.numbers()
        return {name: [getattr(number, name) for number in numbers] for name in EffectNumber.__dataclass_fields__}


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
        raise StateError(
            Problem(
                where=str(path),
                what="belongs to another machine",
                value=stored.machine,
                allowed=machine,
                next_step="give this machine's model file, or begin a new one",
            )
        )
    if geometry and stored.geometry and stored.geometry != geometry:
        raise StateError(
            Problem(
                where=str(path),
                what="was fitted on another geometry of this machine",
                value=stored.geometry,
                allowed=geometry,
                next_step="fit it again with `compd effect fit`",
            )
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
                where=f"{path}, covariance",
                what="has another size than the parameters",
                value=str(covariance.shape),
                allowed=f"({parameters}, {parameters})",
                next_step="fit it again with `compd effect fit`",
            )
        )
    with_covariance = () if problems else _with_own_covariance(fitted, covariance)
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
            where=str(path),
            what="has no checksum: what was changed in it after it was written cannot be seen",
            next_step="`compd effect fit` writes one",
        )
    needed = dict.fromkeys(chain.from_iterable(needed_quantities(effect.effect, links) for effect in fitted))
    if unknown := [name for name in needed if name not in document.fitted_range]:
        yield Problem(
            where=str(path),
            what="does not say in which range it was fitted: its effects are extrapolated without a limit",
            value=", ".join(unknown),
            next_step="fit it again with `compd effect fit`",
        )


def _with_own_covariance(fitted: Sequence[FittedEffect], covariance: FloatArray) -> tuple[FittedEffect, ...]:
    """The effects, each with its block of the joint covariance."""
    ends = np.cumsum([0, *(len(effect.theta) for effect in fitted)])
    return tuple(
        replace(effect, covariance=covariance[begin:end, begin:end])
        for effect, begin, end in zip(fitted, ends[:-1], ends[1:], strict=True)
    )


def _links_of(effect: Effect, entry: EffectEntry) -> int:
    """How many links the file has numbers of an effect for; 0 where it has none for single links."""
    names = {parameter.name for parameter in entry.parameters}
    of_links = [parameter for parameter in effect.parameters if parameter.per == "link"]
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
                where=where,
                what=f"has not the parameters of {effect.id}",
                value=", ".join(values),
                allowed=", ".join(names),
                next_step="fit it again with `compd effect fit`",
            )
        )
        return FittedEffect(effect, np.zeros(len(columns)))
    problems += [
        Problem(
            where=f"{where}, {effect.id}, {column.name}",
            what="is in another unit than the effect has" if units[column.name] else "has no unit",
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
            where=f"{where}, {effect.id}, plausible",
            what="is a range of no number of this effect",
            value=name,
            allowed=", ".join(known),
            next_step="mend the name, or remove it",
        )
        for name in entry.plausible
        if name not in known
    ]
    theta = np.array([column.parameter.to_theta(values[column.name]) for column in columns])
    missing = [constant.name for constant in effect.constants if constant.name not in entry.shape]
    if missing:
        problems.append(
            Problem(
                where=where,
                what=f"has not the shape constants of {effect.id}",
                allowed=", ".join(missing),
                next_step="remove the effect and add it again: `compd effect add` searches them",
            )
        )
    return FittedEffect(effect, theta, entry.shape)


def _error_problems(fitted: FittedEffect, entry: EffectEntry, links: int, where: str) -> Iterator[Problem]:
    """Standard errors that are not those of the covariance: one of the two was changed."""
    said = {parameter.name: parameter.std for parameter in entry.parameters}
    for estimate in _estimates(fitted, links):
        std, of_covariance = said[estimate["name"]], estimate["std"]
        if math.isnan(std) or math.isclose(std, of_covariance, rel_tol=_ROUNDING):
            continue
        yield Problem(
            where=f"{where}, {fitted.effect.id}, {estimate['name']}",
            what="has a standard error that is not the one of the covariance",
            value=f"std: {std:g}",
            allowed=f"std: {of_covariance:g}",
            next_step="write that one, or mend the covariance",
        )


def _lists(ranges: Mapping[str, Range]) -> dict[str, list[float]]:
    return {name: [float(low), float(high)] for name, (low, high) in ranges.items()}


def _estimates(fitted: FittedEffect, links: int) -> list[dict[str, Any]]:
    """Each number as people read it: value, standard error, unit."""
    estimates = []
    for k, column in enumerate(fitted.effect.columns(links)):
        std = float(np.sqrt(fitted.covariance[k, k])) if k < len(fitted.covariance) else float("nan")
        value, value_std = column.parameter.from_theta(float(fitted.theta[k]), std)
        estimates.append(
            {"name": column.name, "value": float(value), "std": float(value_std), "unit": column.parameter.unit}
        )
    return estimates


def parameter_estimates(fitted: Sequence[FittedEffect], links: int) -> list[tuple[str, dict[str, Any]]]:
    """(effect id, {name, value, std, unit}) of every number."""
    return [(effect.effect.id, estimate) for effect in fitted for estimate in _estimates(effect, links)]
