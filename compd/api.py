"""The public functions that put several rooms together: what `import compd` and the commands offer."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.compare import Comparison
from compd.comparison.compare import compare as compare_aligned
from compd.comparison.open import open_recording
from compd.comparison.shape_search import search_constants
from compd.configuration.shipped import Machine, load_machine, shipped_names
from compd.diagnosis import model_changes
from compd.diagnosis.diagnose import diagnose as diagnose_aligned
from compd.diagnosis.planning.measurement_plan import MeasurementPlan
from compd.diagnosis.planning.measurement_programmes import ProgrammeLimits, recorded_limits
from compd.diagnosis.planning.next_measurement import plan_measurement as plan_fitted_rivals
from compd.diagnosis.verdict import Diagnosis
from compd.errors import CompdError, Problem, StateError
from compd.model.effect import Effect
from compd.model.effect_needs import can_concern
from compd.model.library import find_effect, load_library
from compd.model.library.effects_file import gather_effects, named_effect
from compd.model_document import read_stored
from compd.model_file import ModelFile, read_model_file
from compd.recording.sidecar import EXTERNAL

# An opened recording, or the path of one whose machine is found by its name.
Recorded: TypeAlias = AlignedRecording | str | Path
# An opened model or its path; None for the machine without effects.
Model: TypeAlias = ModelFile | str | Path | None
# Effects of one's own: an effect, a source of effects as `load_effects` takes it, or several of these.
Effects: TypeAlias = str | Path | Effect | Sequence[Effect | str | Path]
# Lowest and highest.
Range: TypeAlias = tuple[float, float]


def open_model(path: str | Path, machine: Machine | None = None) -> ModelFile:
    """Open a model file: the effects that a machine's model has, with their numbers and the ledger.

    Parameters
    ----------
    path : str or Path
        The model file (YAML), as `ModelFile.write` and `compd effect add` write it.
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


def compare(recording: Recorded, model: Model = None) -> Comparison:
    """Compare a recording with the model of its machine; nothing is fitted.

    Parameters
    ----------
    recording : AlignedRecording, str or Path
        What was measured, as `open_recording` returns it; or the path of a recording whose machine comes with compd.
    model : ModelFile, str or Path, optional
        The effects that the model has; left out, none: what is left then is everything that the gauges do not see.

    Returns
    -------
    Comparison
        Residuals in um, the noise floor, what each part contributes, and what the residual follows.

    Raises
    ------
    RecordingError
        Where fewer than five rows have everything that is needed.
    StateError
        Where the model belongs to another machine.
    CompdError
        Where an effect of the model needs a quantity that the recording does not have.

    Examples
    --------
    >>> import compd
    >>> comparison = compd.compare("monday.csv")
    >>> round(comparison.rms_um, 2)  # error, um per coordinate
    0.82
    >>> round(comparison.floor.um, 2)  # what noise alone would be
    0.16
    """
    aligned = _opened(recording)
    file = _opened_model(model, aligned)
    return compare_aligned(aligned, file.fitted, file.covariance)


def diagnose(
    recording: Recorded,
    model: Model = None,
    *,
    effects: Effects = (),
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Learn which physical effect the model of the machine lacks.

    Every effect of the library, every pair and the best triples are fitted to one part of the recording and tried on
    rows that were left out; so is every measured quantity, for causes that the library does not have.

    Parameters
    ----------
    recording : AlignedRecording, str or Path
        What to learn from, as for `compare`. Sessions on several days, different loads, temperatures and directions
        make effects distinguishable.
    model : ModelFile, str or Path, optional
        What is known already; its effects are fitted along. The file is not changed.
    effects : str, Path, Effect, or a sequence of these
        Effects of your own, tried beside those that are installed: each an effect, or a source of several as
        `load_effects` takes it.
    progress : callable
        Called with a text when a stage of the search begins. A diagnosis takes seconds.

    Returns
    -------
    Diagnosis
        The verdict with its evidence.

    Raises
    ------
    CompdError
        As `compare`, and as `load_effects` for `effects`.

    Notes
    -----
    With ``machine: external`` only those effects of the library are tried that act on what was predicted; the others
    act inside a machine that compd does not know.

    The selection is by cross-validation over sessions with a penalty for each further effect (M. Stone, J. R. Stat.
    Soc. B 36 (1974) 111); every threshold stands with its reason in `compd.diagnosis.criteria`.

    Examples
    --------
    >>> import compd
    >>> diagnosis = compd.diagnose("monday.csv")
    >>> diagnosis.verdict, [step.effect.id for step in diagnosis.steps]
    ('identified', ['link_expansion'])
    """
    aligned = _opened(recording)
    file = _opened_model(model, aligned)
    given = gather_effects(effects)
    rows = aligned.rows
    library = [effect for effect in load_library().values() if can_concern(effect, rows.available, rows.links)]
    candidates = [*library, *given.values()]
    return diagnose_aligned(aligned, file.fitted, file.covariance, candidates, progress or (lambda status: None))


def add_effect(
    model: Model,
    effect: Effect | str | Path | Mapping[str, Any],
    recording: Recorded,
    *,
    effects: Effects = (),
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
    found = _found(effect, gather_effects(effects))
    declared = found.declared if isinstance(found.declared, str) else dict(found.declared)
    aligned = _opened(recording)
    return model_changes.add(_opened_model(model, aligned), declared or found.id, found, aligned)


def plan_measurement(
    recording: Recorded,
    rivals: tuple[str, str],
    *,
    rows: int = 40,
    model: Model = None,
    effects: Effects = (),
    beside: Sequence[str] = (),
    workspace_M_mm: tuple[Range, Range, Range] | None = None,
    force_N: float | None = None,
    temperature_degC: Range | None = None,
    speed_mm_per_s: float | None = None,
    limits: Mapping[str, Range] | None = None,
) -> MeasurementPlan:
    """Plan the rows (poses, loads, temperatures, speeds) on which two rival effects differ most.

    Parameters
    ----------
    recording : AlignedRecording, str or Path
        What was measured so far; both effects are fitted on it.
    rivals : (str, str)
        Ids of two effects that the recording cannot tell apart, as a diagnosis names them.
    rows : int
        How many rows may be measured at most.
    model : ModelFile, str or Path, optional
        What is known already.
    effects : str, Path, Effect, or a sequence of these
        Effects of your own, which `rivals` and `beside` may name, as for `diagnose`.
    beside : sequence of str
        Ids of other effects that act on the recording and are not in the model, such as the other steps of a diagnosis;
        they are fitted along.
    workspace_M_mm : three pairs of float, optional
        Lowest and highest x, y and z of the tip in {M}, mm; left out, as in the recording.
    force_N : float, optional
        Largest load along any axis, N; left out, as in the recording.
    temperature_degC : (float, float), optional
        Lowest and highest temperature, degC; left out, as in the recording.
    speed_mm_per_s : float, optional
        Fastest motion of a link, mm/s; left out, as in the recording.
    limits : dict, optional
        With ``machine: external``, in place of the four above: lowest and highest value of a column that the rivals are
        computed from; of a column that is left out, as in the recording.

    Returns
    -------
    MeasurementPlan
        The rows, and by how much the two effects will differ on them.

    Raises
    ------
    CompdError
        Where the rivals are not two different effects, or one of them is in the model already; where a limit is no
        rising pair, negative, or for another kind of machine; where the effects cannot be fitted on this recording.
    RecordingError
        Where a place within the limits cannot be reached.

    Notes
    -----
    The criterion is T-optimality: A. C. Atkinson, V. V. Fedorov, Biometrika 62 (1975) 57.

    Examples
    --------
    >>> import compd
    >>> elastic = ["link_elasticity=60"]  # N/um
    >>> files = compd.simulate_campaign("tripod-cmm", "loads.csv", seed=5, effects=elastic)
    >>> rivals = ("link_elasticity", "joint_contact")
    >>> plan = compd.plan_measurement("loads.csv", rivals, rows=20, force_N=100.0)
    >>> print(f"{plan.before:.0f} -> {plan.separation:.0f}")  # standard deviations of the noise
    30 -> 36
    >>> plan.write("next.csv")
    """
    if len(rivals) != 2 or rivals[0] == rivals[1]:
        raise CompdError(
            Problem(
                where="rivals",
                what="needs two effects",
                value=",".join(rivals),
                allowed="two different ids",
                next_step="a diagnosis names rivals",
            )
        )
    own = gather_effects(effects)
    first, second, *others = (named_effect(name, "rivals", own) for name in (*rivals, *beside))
    aligned = _opened(recording)
    file = _opened_model(model, aligned)
    present = [fitted.effect.id for fitted in file.fitted if fitted.effect.id in (*rivals, *beside)]
    if present:
        raise CompdError(
            Problem(
                where="rivals",
                what="is in the model already",
                value=", ".join(present),
                allowed="effects that are not",
                next_step="`compd effect remove` takes it out",
            )
        )
    given = _plan_limits(aligned, workspace_M_mm, force_N, temperature_degC, speed_mm_per_s, limits or {})
    sigma_um = compare_aligned(aligned, file.fitted, file.covariance).floor.by_axis_um
    fitted = file.fitted
    for effect in others:
        fitted = search_constants(aligned, fitted, effect, sigma_um).fitted
    pair = [search_constants(aligned, fitted, effect, sigma_um).fitted for effect in (first, second)]
    return plan_fitted_rivals(aligned, pair[0][:-1], (pair[0][-1], pair[1][-1]), sigma_um, given, rows)


def _opened(recording: Recorded) -> AlignedRecording:
    return recording if isinstance(recording, AlignedRecording) else open_recording(recording)


def _opened_model(model: Model, aligned: AlignedRecording) -> ModelFile:
    """The model of the recording's machine. Raises StateError where it is of another one."""
    machine, links = aligned.recording.machine, aligned.rows.links
    if model is None:
        return ModelFile(machine, links)
    if not isinstance(model, ModelFile):
        return read_model_file(Path(model), machine, links)
    if model.machine != machine:
        raise StateError(
            Problem(
                where="model",
                what="belongs to another machine than the recording",
                value=model.machine,
                allowed=machine,
                next_step="give this machine's model, or begin a new one",
            )
        )
    if model.links not in (0, links):
        raise StateError(
            Problem(
                where="model",
                what="has another number of links than the recording",
                value=str(model.links),
                allowed=str(links),
                next_step="give the model of these links, or begin a new one",
            )
        )
    # of an external model, whose effects had no number of a single link
    return replace(model, links=links)


def _found(effect: Effect | str | Path | Mapping[str, Any], given: Mapping[str, Effect]) -> Effect:
    """The effect that is to be added, such that a model file can name it. Raises CompdError with every problem."""
    if isinstance(effect, Mapping):
        return find_effect(effect, "effect")
    if not isinstance(effect, Effect):
        return named_effect(str(effect), "effect", given)
    if not effect.declared and load_library().get(effect.id) != effect:
        raise CompdError(
            Problem(
                where=f"effect {effect.id}",
                what="is not installed, so that a model file could not name it",
                next_step='put it into a file and give "/absolute/file.py:NAME"',
            )
        )
    return effect


def _shipped_links(name: str, path: Path) -> int:
    """Links of the machine that comes with compd under the name in a model file."""
    if name not in shipped_names():
        raise StateError(
            Problem(
                where=str(path),
                what="no configuration of its machine comes with compd",
                value=name,
                allowed=", ".join([*shipped_names(), EXTERNAL]),
                next_step='give the configuration: machine="my-machine.yaml"',
            )
        )
    return load_machine(name).geometry.links


def _plan_limits(
    aligned: AlignedRecording,
    workspace_M_mm: tuple[Range, Range, Range] | None,
    force_N: float | None,
    temperature_degC: Range | None,
    speed_mm_per_s: float | None,
    by_column: Mapping[str, Range],
) -> ProgrammeLimits | Mapping[str, Range]:
    """The limits that a plan keeps.

    Raises CompdError with every one that is faulty, or for the other kind of machine.
    """
    pairs = {f"workspace_M_mm, {axis}": pair for axis, pair in zip("xyz", workspace_M_mm or (), strict=False)}
    if temperature_degC is not None:
        pairs["temperature_degC"] = temperature_degC
    largest = {"force_N": force_N, "speed_mm_per_s": speed_mm_per_s}
    given: dict[str, Any] = {name: value for name, value in largest.items() if value is not None}
    problems = [
        Problem(where=name, what="is not understood", value=str(pair), allowed="two numbers, low before high")
        for name, pair in pairs.items()
        if not (len(pair) == 2 and pair[0] < pair[1])
    ]
    problems += [
        Problem(where=f"limit of {name}", what="is not understood", value=str(pair), allowed="two numbers, low first")
        for name, pair in by_column.items()
        if not (len(pair) == 2 and pair[0] <= pair[1])
    ]
    problems += [
        Problem(where=name, what="is not understood", value=str(value), allowed="0 or more")
        for name, value in given.items()
        if not value >= 0
    ]
    external = aligned.model is None
    problems += [
        Problem(
            where=name,
            what="is a limit of an external machine" if not external else "is no limit of an external machine",
            allowed="limits by column" if external else "workspace, force, temperature and speed",
            next_step="give `--limit COLUMN=LOW,HIGH`, in Python limits={COLUMN: (LOW, HIGH)}" if external else "",
        )
        for name in ([*pairs, *given] if external else [f"limit of {name}" for name in by_column])
    ]
    if problems:
        raise CompdError(problems)
    if external:
        return by_column
    if workspace_M_mm is not None:
        low_M_mm, high_M_mm = np.array(workspace_M_mm, dtype=np.float64).T
        given |= {"tip_low_M_mm": low_M_mm, "tip_high_M_mm": high_M_mm}
    if temperature_degC is not None:
        given["temperature_degC"] = temperature_degC
    return recorded_limits(aligned)._replace(**given)
