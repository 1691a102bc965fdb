"""The model file: a machine's effects with their fitted numbers, and every step by which they came to be.

One YAML file, written whole or not at all. Each step keeps what it replaced, so that it can be undone.

    format: 2               # 1 was written by release 0.1.0, with the same keys; a file without it counts as 1
    machine: tripod-cmm     # name of the configuration, or "external"
    geometry: 9f3a...       # hash of the geometry that it was fitted on; left out where that is not known
    release: 0.2.0          # of compd, that wrote it
    effects:
    - effect: link_sag      # an id, /absolute/file.py:NAME, or a formula written out
      shape: {n: 3.0}       # values of its nonlinear constants
      parameters:
      - {name: s, value: 1.0, std: 0.1, unit: um}
    covariance: [[0.01]]    # of all fitted numbers jointly, in the order of the file
    steps: []               # see ModelStep
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import numpy as np
import yaml
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from compd.arrays import FloatArray
from compd.errors import CompdError, Problem, StateError
from compd.files import write_files
from compd.model.effect import FittedEffect
from compd.model.library import find_effect
from compd.release import __version__
from compd.tables import Columns, data_frame, html_table

if TYPE_CHECKING:
    import pandas as pd

FORMAT = 2
Kind = Literal["add", "remove", "fit", "undo"]
# An effect's id, /absolute/file.py:NAME, or a formula written out.
Declaration: TypeAlias = str | dict[str, Any]
# The parts of the file that a step replaces, as plain data.
State: TypeAlias = Mapping[str, Any]
NOTHING: State = {"effects": [], "covariance": []}


@dataclass(frozen=True)
class ModelStep:
    """One change of the model, as its ledger keeps it and as the model file has it."""

    kind: Annotated[Kind, Field(description="what was done")]
    effect: Annotated[str, Field(description='the effect that was added or removed; "" for a fit of all')]
    date: Annotated[str, Field(description="when, UTC, ISO 8601")]
    recording: Annotated[str, Field(description="the recording that it was fitted on")]
    sha256: Annotated[str, Field(description="hash of that recording with its sidecar")]
    rms_before_um: Annotated[float, Field(description="residual before, root mean square per coordinate, um")]
    rms_after_um: Annotated[float, Field(description="residual after, um")]
    noise_floor_um: Annotated[float, Field(description="noise floor of the recording, um")]
    replaced: Annotated[State, Field(description="`effects` and `covariance` as they were before, for undo")]
    undone: Annotated[bool, Field(description="whether a later step took it back")] = False

    # for pydantic, which checks the steps of a file
    __pydantic_config__ = ConfigDict(extra="forbid", coerce_numbers_to_str=True)


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
    def plausible(self) -> bool:
        """Whether it lies in the plausible range."""
        return self.plausible_low <= self.value <= self.plausible_high


@dataclass(frozen=True)
class StoredModel:
    """A model file as plain data: what can be shown and undone without the machine."""

    machine: str
    state: State = field(default_factory=lambda: NOTHING)
    steps: tuple[ModelStep, ...] = ()
    geometry: str = ""


@dataclass(frozen=True, repr=False)
class ModelFile:
    """The effects that a machine's model has, with their fitted numbers, and the ledger of how they came to be.

    `open_model` reads one, `add_effect` begins one or adds to it, `write` keeps it. It is never changed in place.

    Attributes
    ----------
    machine : str
        Name of the machine's configuration, or ``"external"``.
    links : int
        Number of the machine's links; 0 for ``"external"``.
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
    """

    machine: str
    links: int
    declared: tuple[Declaration, ...] = ()
    fitted: tuple[FittedEffect, ...] = ()
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    steps: tuple[ModelStep, ...] = ()
    geometry: str = ""

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
                "shape": {name: float(value) for name, value in fitted.constants.items()},
                "parameters": _estimates(fitted, self.links),
            }
            for declared, fitted in zip(self.declared, _with_own_covariance(self.fitted, self.covariance), strict=True)
        ]
        return {"effects": effects, "covariance": self.covariance.tolist()}

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
            f"{step.kind} {step.effect} on {step.recording}: {step.rms_before_um:.3g} um to {step.rms_after_um:.3g} um"
            + (" (undone)" if step.undone else "")
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
            for column, estimate in zip(effect.columns(self.links), _estimates(fitted, self.links), strict=True):
                name, value, std, unit = estimate.values()
                numbers.append(
                    EffectNumber(effect.id, name, value, std, unit, column.parameter.low, column.parameter.high, False)
                )
            for constant in effect.constants:
                value, unit = float(fitted.constants[constant.name]), constant.unit
                numbers.append(
                    EffectNumber(effect.id, constant.name, value, np.nan, unit, constant.low, constant.high, True)
                )
        return numbers

    def _columns(self) -> Columns:
        numbers = self.numbers()
        return {name: [getattr(number, name) for number in numbers] for name in EffectNumber.__dataclass_fields__}


def _square(rows: list[list[float]]) -> list[list[float]]:
    if any(len(row) != len(rows) for row in rows):
        raise ValueError("is no matrix of numbers: it has not as many rows as columns")
    return rows


# A key without a value is an empty list or mapping.
_EmptyList = BeforeValidator(lambda value: [] if value is None else value)
_EmptyMapping = BeforeValidator(lambda value: {} if value is None else value)


class FilePart(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, coerce_numbers_to_str=True)


class ParameterEntry(FilePart):
    """One fitted parameter."""

    name: str = Field(description="name of the parameter; b_1, b_2, ... where there is one for each link")
    value: float = Field(description="in its unit")
    std: float = Field(default=float("nan"), description="standard error, in the same unit; nan where it is not known")
    unit: str = Field(default="", description="the unit, for people")


class EffectEntry(FilePart):
    """One effect with its fitted parameters."""

    effect: Declaration = Field(description="an id of the library, /absolute/file.py:NAME, or a formula's declaration")
    shape: Annotated[dict[str, float], _EmptyMapping] = Field(
        default={}, description="values of its nonlinear constants, by name"
    )
    parameters: list[ParameterEntry] = Field(description="its fitted parameters")


class ModelDocument(FilePart):
    """The keys of the file."""

    format: Annotated[int, Field(ge=1)] = Field(
        default=1, description=f"number of the format: {FORMAT}; 1, of release 0.1, has the same keys"
    )
    machine: str = Field(description='name of the machine\'s configuration, or "external"')
    geometry: str = Field(
        default="",
        description="hash of the geometry that it was fitted on; on another one its parameters are of no use",
    )
    release: str = Field(default="", description="release of compd that wrote the file")
    effects: Annotated[list[EffectEntry], _EmptyList] = Field(default=[], description="the effects of the machine")
    covariance: Annotated[list[list[float]], _EmptyList, AfterValidator(_square)] = Field(
        default=[], description="covariance of all fitted parameters jointly, in the order of the file, one row a list"
    )
    steps: Annotated[list[ModelStep], _EmptyList] = Field(
        default=[], description="every step by which the model came to be, the last one last"
    )


def read_stored(path: Path) -> StoredModel:
    """Read a model file without looking up its effects.

    Raises StateError with every problem: no such file, not YAML, a later format, keys that are missing, unknown or
    of the wrong kind.
    """
    _, stored = _read(path)
    return stored


def read_model_file(path: Path, machine: str, links: int, geometry: str = "") -> ModelFile:
    """Read a model file for the machine of this name with so many links (0 for an external model).

    geometry : hash of the machine's geometry, where numbers that were fitted on another one are of no use.
    Raises StateError with every problem: what `read_stored` refuses, another machine, an effect that is not
    installed, numbers that are missing.
    """
    document, stored = _read(path)
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
    fitted: list[FittedEffect] = []
    for number, entry in enumerate(document.effects, start=1):
        try:
            fitted.append(_fitted_effect(entry, links, f"{path}, effect {number}", problems))
        except CompdError as error:
            problems += error.problems
    count = sum(len(effect.theta) for effect in fitted)
    covariance = np.array(document.covariance, dtype=np.float64).reshape(len(document.covariance), -1)
    if not problems and len(covariance) != count:
        problems.append(
            Problem(
                where=f"{path}, covariance",
                what="has another size than the parameters",
                value=str(covariance.shape),
                allowed=f"({count}, {count})",
                next_step="fit it again with `compd effect fit`",
            )
        )
    if problems:
        raise StateError(problems)
    return ModelFile(
        stored.machine,
        links,
        tuple(entry.effect for entry in document.effects),
        _with_own_covariance(fitted, covariance),
        covariance,
        stored.steps,
        stored.geometry,
    )


def _read(path: Path) -> tuple[ModelDocument, StoredModel]:
    """The checked file, and the same with its effects as they were written."""
    where = str(path)
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise StateError(
            Problem(where=where, what=f"cannot be read: {error.strerror}", next_step="`compd effect add` writes one")
        ) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise StateError(Problem(where=where, what="is not YAML", value=str(error).splitlines()[0])) from error
    if not isinstance(data, dict):
        raise StateError(
            Problem(
                where=where,
                what="is no model file",
                value=str(data)[:80],
                allowed=", ".join(ModelDocument.model_fields),
                next_step="`compd effect add` writes one",
            )
        )
    if isinstance(data.get("format"), int) and data["format"] > FORMAT:
        raise StateError(
            Problem(
                where=where,
                what="was written by a later release of compd",
                value=f"format: {data['format']}",
                allowed=f"format: 1 to {FORMAT}",
                next_step=f"install release {data.get('release', 'that wrote it')} or later, or fit the effects anew",
            )
        )
    try:
        document = ModelDocument.model_validate(data)
    except ValidationError as error:
        raise StateError([_problem(detail, where) for detail in error.errors(include_url=False)]) from error
    state = {"effects": data.get("effects") or [], "covariance": data.get("covariance") or []}
    return document, StoredModel(document.machine, state, tuple(document.steps), document.geometry)


def _problem(detail: ErrorDetails, where: str) -> Problem:
    """One of pydantic's errors, with the place as people count: `effects 2` is the second effect."""
    place = ""
    for part in detail["loc"]:
        if isinstance(part, int):
            place += f" {part + 1}"
        elif part not in ("str", "dict[str,any]"):  # pydantic's names for the two kinds of declaration
            place += f", {part}"
    top_level_keys = ", ".join(ModelDocument.model_fields) if len(detail["loc"]) == 1 else ""
    what, allowed = {
        "missing": ("is missing", ""),
        "extra_forbidden": ("is no key that belongs here", top_level_keys),
        "list_type": ("is no list", ""),
        "dict_type": ("is no mapping", ""),
        "model_type": ("is no mapping", ""),
        "dataclass_type": ("is no mapping", ""),
        "unexpected_keyword_argument": ("is no key that belongs here", ""),
        "string_type": ("is no text", ""),
        "float_type": ("is no number", ""),
        "float_parsing": ("is no number", ""),
        "literal_error": ("is none of the choices", str(detail.get("ctx", {}).get("expected", ""))),
    }.get(detail["type"], (detail["msg"].removeprefix("Value error, "), ""))
    return Problem(
        where=f"{where}{place}",
        what=what,
        value="" if detail["type"] == "missing" else str(detail["input"])[:80],
        allowed=allowed,
        next_step="mend it, or take the file from a copy",
    )


def write_stored(path: Path, stored: StoredModel) -> None:
    """Write a model whole or not at all. Raises StateError where the disk refuses."""
    data = {
        "format": FORMAT,
        "machine": stored.machine,
        **({"geometry": stored.geometry} if stored.geometry else {}),
        "release": __version__,
        **stored.state,
        "steps": [{**asdict(step), "replaced": dict(step.replaced)} for step in stored.steps],
    }
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110)
    try:
        # the daemon, another user, must be able to read it
        write_files({path: text}, mode=0o644)
    except OSError as error:
        raise StateError(
            Problem(
                where=str(path),
                what=f"cannot be written: {error.strerror}",
                next_step="choose a place that may be written",
            )
        ) from error


def _with_own_covariance(fitted: Sequence[FittedEffect], covariance: FloatArray) -> tuple[FittedEffect, ...]:
    """The effects, each with its block of the joint covariance."""
    ends = np.cumsum([0, *(len(effect.theta) for effect in fitted)])
    return tuple(
        replace(effect, covariance=covariance[begin:end, begin:end])
        for effect, begin, end in zip(fitted, ends[:-1], ends[1:], strict=True)
    )


def _fitted_effect(entry: EffectEntry, links: int, where: str, problems: list[Problem]) -> FittedEffect:
    """The effect with its numbers; what is missing goes to `problems`. Raises CompdError where it is not installed."""
    effect = find_effect(entry.effect, where)
    values = {parameter.name: parameter.value for parameter in entry.parameters}
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
