"""The model of a machine: opening its file, and adding an effect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from compd.api.arguments import Effects, Model, Recorded, opened_model, opened_recording
from compd.configuration import Machine, load_machine, shipped_names
from compd.diagnosis import Criteria
from compd.errors import CompdError, StateError
from compd.model.effects import Effect
from compd.model.library import find_effect, gather_effects, load_library, named_effect
from compd.model_changes import add_to_model
from compd.model_file import ModelFile, read_model_file, read_stored
from compd.parameter_ranges import check_ranges
from compd.recording import EXTERNAL


def open_model(path: str | Path, machine: Machine | None = None) -> ModelFile:
    """Open a model file: the effects that a machine's model has, with their numbers and the ledger.

    Parameters
    ----------
    path : str or Path
        The model file (YAML), as `ModelFile.write` and `compd model add` write it.
    machine : str, Path or Configuration, optional
        The machine as `load_machine` takes it. Left out, the configuration that comes with compd under the name in
        the file.

    Returns
    -------
    ModelFile

    Raises
    ------
    StateError
        With every problem of the file; or where it belongs to another machine.
    ConfigurationError
        Where the machine's configuration cannot be used, or none of this name comes with compd.

    Examples
    --------
    >>> import compd
    >>> model = compd.open_model("tripod.model.yaml")
    >>> for number in model.numbers():
    ...     print(number.parameter, round(number.value, 2), number.unit)
    a 1.11 ppm/K
    """
    path = Path(path)
    if machine is None:
        name = read_stored(path).machine
        links = None if name == EXTERNAL else _shipped_links(name, path)
    else:
        configuration = load_machine(machine)
        name, links = configuration.machine, configuration.geometry.links
    return read_model_file(path, name, links)


def add_effect(
    model: Model,
    effect: Effect | str | Path | Mapping[str, Any],
    recording: Recorded,
    *,
    effects: Effects = (),
    criteria: Criteria = Criteria(),
) -> ModelFile:
    """Add an effect to a model: all its effects are fitted together on a recording, and the ledger gets a line.

    Parameters
    ----------
    model : ModelFile, str, Path or None
        The model as it is; None begins a new one. It is not changed, nor is its file: the result is a new model, kept
        by its `write`.
    effect : Effect, str, Path or dict
        An effect of the library or of `effects`, or its id; ``"file.py:NAME"``; a formula as a mapping, such as
        `EmpiricalFinding.formula_effects` has; the path of a YAML file with one effect, or ``"file.yaml:ID"``.
    recording : AlignedRecording, str or Path
        What to fit on.
    effects : str, Path, Effect, or a sequence of these
        Effects of your own beside those that are installed, as for `diagnose`.
    criteria : Criteria
        As for `diagnose`: of these, `disturbance` widens the standard errors.

    Returns
    -------
    ModelFile
        The model with the effect, with standard errors and the joint covariance of all numbers.

    Raises
    ------
    StateError
        Where the model has the effect already, or belongs to another machine.
    PluginError, ConfigurationError
        Where there is no such effect, or the formula is faulty.
    CompdError
        Where the recording lacks a quantity that the effect needs, or the effect cannot be written into a file.

    Examples
    --------
    >>> import compd
    >>> monday = compd.open_recording("monday.csv")
    >>> model = compd.add_effect(None, "link_expansion", monday)
    >>> model.write("tripod.model.yaml")
    >>> round(compd.compare(monday, model).rms_um, 2)
    0.18
    """
    resolved = _resolve_effect(effect, gather_effects(effects))
    declared = resolved.declared if isinstance(resolved.declared, str) else dict(resolved.declared)
    aligned = opened_recording(recording)
    check_ranges(aligned.ranges, [*gather_effects(effects).values(), resolved])
    on_machine = aligned.on_machine(resolved)
    return add_to_model(opened_model(model, aligned), declared or resolved.id, on_machine, aligned, criteria)


def _resolve_effect(effect: Effect | str | Path | Mapping[str, Any], known: Mapping[str, Effect]) -> Effect:
    """The effect to add, in a form that a model file can name. Raises CompdError with every problem."""
    if isinstance(effect, Mapping):
        return find_effect(effect, "effect")
    if not isinstance(effect, Effect):
        return named_effect(str(effect), "effect", known)
    if not effect.declared and not _is_of_library(effect):
        raise CompdError.of(
            f"effect {effect.id}",
            "is not installed, so that a model file could not name it",
            next_step='put it into a file and give "/absolute/file.py:NAME"',
        )
    return effect


def _is_of_library(effect: Effect) -> bool:
    """Whether the library has this effect, with whatever plausible ranges a machine gives it."""
    known = load_library().get(effect.id)
    return known is not None and replace(effect, parameters=known.parameters) == known


def _shipped_links(name: str, path: Path) -> int:
    """Links of the machine that comes with compd under the name in a model file."""
    if name not in shipped_names():
        raise StateError.of(
            str(path),
            "no configuration of its machine comes with compd",
            value=name,
            allowed=", ".join([*shipped_names(), EXTERNAL]),
            next_step='give the configuration: machine="my-machine.yaml"',
        )
    return load_machine(name).geometry.links
