"""The model file: a machine's effects with their fitted numbers, and every step by which they came to be.

One YAML file, written whole or not at all. Each step keeps what it replaced, so that it can be undone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import yaml

from compd import __version__
from compd.arrays import FloatArray
from compd.errors import CompdError, Problem, StateError
from compd.files import write_files
from compd.model.effect import FittedEffect
from compd.model.library import find

FORMAT = 1
Kind = Literal["add", "remove", "fit", "undo"]
# An effect's id, /absolute/file.py:NAME, or a formula written out.
Declaration: TypeAlias = str | Mapping[str, Any]
# The parts of the file that a step replaces, as plain data.
State: TypeAlias = Mapping[str, Any]
NOTHING: State = {"effects": [], "covariance": []}


@dataclass(frozen=True)
class ModelStep:
    """One command that changed the model; um per coordinate.

    effect : what was added or removed, "" for a fit of all.  date : UTC, ISO 8601.
    recording, sha256 : what it was fitted on.  undone : whether a later step took it back.
    """

    kind: Kind
    effect: str
    date: str
    recording: str
    sha256: str
    rms_before_um: float
    rms_after_um: float
    noise_floor_um: float
    replaced: State
    undone: bool = False


@dataclass(frozen=True)
class Stored:
    """A model file as plain data: what can be shown and undone without the machine."""

    machine: str
    state: State = field(default_factory=lambda: NOTHING)
    steps: tuple[ModelStep, ...] = ()
    geometry: str = ""


@dataclass(frozen=True)
class ModelFile:
    """machine : the name of its configuration, or "external".

    declared : each effect as the person named it.  fitted : with numbers and their own covariance.
    covariance : (P, P) of all fitted numbers jointly, in the order of `fitted`.
    geometry : hash of the geometry that it was fitted on; "" where that is not known.
    """

    machine: str
    declared: tuple[Declaration, ...] = ()
    fitted: tuple[FittedEffect, ...] = ()
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    steps: tuple[ModelStep, ...] = ()
    geometry: str = ""

    def state(self, links: int) -> State:
        """The effects as plain data, for the file."""
        effects = [
            {
                "effect": declared if isinstance(declared, str) else dict(declared),
                "shape": {name: float(value) for name, value in one.shape.items()},
                "parameters": _numbers(one, links),
            }
            for declared, one in zip(self.declared, _each_its_own(self.fitted, self.covariance), strict=True)
        ]
        return {"effects": effects, "covariance": self.covariance.tolist()}


def read_stored(path: Path) -> Stored:
    """Read a model file without looking into its effects.

    Raises StateError: no such file, not YAML, another format, a step that cannot be read.
    """
    where = str(path)
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise StateError(
            Problem(where=where, what=f"cannot be read: {error.strerror}", next_step="`compd effect add` writes one")
        ) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise StateError(Problem(where=where, what="is not YAML", value=str(error).splitlines()[0])) from error
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        found = data.get("format") if isinstance(data, dict) else None
        raise StateError(
            Problem(
                where=where,
                what="is no model file of this version",
                value=f"format: {found}",
                allowed=f"format: {FORMAT}",
            )
        )
    try:
        steps = tuple(ModelStep(**step) for step in data.get("steps") or ())
    except (TypeError, AttributeError) as error:
        raise StateError(Problem(where=where, what=f"a step cannot be read: {error}")) from error
    state = {"effects": data.get("effects") or [], "covariance": data.get("covariance") or []}
    for key, value in state.items():
        if not isinstance(value, list):
            raise StateError(
                Problem(
                    where=f"{where}, {key}",
                    what="is no list",
                    value=str(value)[:80],
                    allowed="as `compd effect add` writes it",
                )
            )
    return Stored(str(data.get("machine")), state, steps, str(data.get("geometry") or ""))


def read_model_file(path: Path, machine: str, links: int, geometry: str = "") -> ModelFile:
    """Read a model file for the machine of this name with so many links (0 for an external model).

    geometry : hash of the machine's geometry, where numbers that were fitted on another one are of no use.
    Raises StateError with every problem: what `read_stored` refuses, another machine, an effect that is not
    installed, numbers that are missing.
    """
    stored = read_stored(path)
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
    return _opened(stored, links, str(path))


def _opened(stored: Stored, links: int, where: str) -> ModelFile:
    problems: list[Problem] = []
    declared: list[Declaration] = []
    fitted: list[FittedEffect] = []
    for number, entry in enumerate(stored.state["effects"], start=1):
        place = f"{where}, effect {number}"
        try:
            fitted.append(_fitted(entry, links, place, problems))
            declared.append(entry["effect"])
        except CompdError as error:
            problems += error.problems
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            problems.append(
                Problem(where=place, what=f"cannot be read: {error!r}", allowed="effect, shape, parameters")
            )
    count = sum(len(one.theta) for one in fitted)
    try:
        covariance = np.array(stored.state["covariance"] or np.zeros((0, 0)), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise StateError(
            [*problems, Problem(where=f"{where}, covariance", what=f"is no matrix of numbers: {error}")]
        ) from error
    if not problems and covariance.shape != (count, count):
        problems.append(
            Problem(
                where=f"{where}, covariance",
                what="has another size than the parameters",
                value=str(covariance.shape),
                allowed=f"({count}, {count})",
            )
        )
    if problems:
        raise StateError(problems)
    return ModelFile(
        stored.machine, tuple(declared), _each_its_own(fitted, covariance), covariance, stored.steps, stored.geometry
    )


def write_model_file(path: Path, file: ModelFile, links: int) -> None:
    """Write a model whole or not at all. Raises StateError where the disk refuses."""
    write_stored(path, Stored(file.machine, file.state(links), file.steps, file.geometry))


def write_stored(path: Path, stored: Stored) -> None:
    """As `write_model_file`, from plain data."""
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


def _each_its_own(fitted: Sequence[FittedEffect], covariance: FloatArray) -> tuple[FittedEffect, ...]:
    """The effects, each with its block of the joint covariance."""
    ends = np.cumsum([0, *(len(one.theta) for one in fitted)])
    return tuple(
        replace(one, covariance=covariance[a:b, a:b]) for one, a, b in zip(fitted, ends[:-1], ends[1:], strict=True)
    )


def _fitted(entry: Mapping[str, Any], links: int, where: str, problems: list[Problem]) -> FittedEffect:
    effect = find(entry["effect"], where)
    values = {number["name"]: number["value"] for number in entry["parameters"]}
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
    theta = np.array([column.parameter.fitted(float(values[column.name])) for column in columns])
    shape = {name: float(value) for name, value in (entry.get("shape") or {}).items()}
    absent = [constant.name for constant in effect.constants if constant.name not in shape]
    if absent:
        problems.append(
            Problem(where=where, what=f"has not the shape constants of {effect.id}", allowed=", ".join(absent))
        )
    return FittedEffect(effect, theta, shape)


def _numbers(one: FittedEffect, links: int) -> list[dict[str, Any]]:
    """Each number as people read it: value, standard error, unit."""
    found = []
    for k, column in enumerate(one.effect.columns(links)):
        std = float(np.sqrt(one.covariance[k, k])) if k < len(one.covariance) else float("nan")
        value, value_std = column.parameter.shown(float(one.theta[k]), std)
        found.append(
            {"name": column.name, "value": float(value), "std": float(value_std), "unit": column.parameter.unit}
        )
    return found


def numbers_of(fitted: Sequence[FittedEffect], links: int) -> list[tuple[str, dict[str, Any]]]:
    """(effect id, {name, value, std, unit}) of every number."""
    return [(one.effect.id, number) for one in fitted for number in _numbers(one, links)]
