"""Changes of a model file, one step at a time: add, remove, refit, undo; the file keeps every step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.compare import Comparison, compare
from compd.comparison.fit import FitResult, fit, initial_effect
from compd.comparison.shape_search import search_constants
from compd.diagnosis.candidates import library_pool
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.unmodelled import with_disturbances
from compd.errors import Problem, StateError
from compd.model.effect import Effect
from compd.model.library import load_library
from compd.model_file import Declaration, Kind, ModelFile, ModelStep, StoredModel


@dataclass(frozen=True)
class Change:
    """A model after a step, and the recording compared with the model before and after it."""

    file: ModelFile
    before: Comparison
    after: Comparison


def add(file: ModelFile, declared: Declaration, effect: Effect, aligned: AlignedRecording, date: str) -> Change:
    """Add an effect and fit all effects together; its nonlinear constants are searched.

    declared : how the file declares the effect.  date : of the step, as it is to be written.
    Raises StateError where the model has the effect already, CompdError where it cannot be fitted on this recording.
    """
    if effect.id in [fitted.effect.id for fitted in file.fitted]:
        raise StateError(
            Problem(
                where=f"effect {effect.id}",
                what="is in the model already",
                next_step="`compd effect fit` fits it again",
            )
        )
    before = compare(aligned, file.fitted, file.covariance)
    result = search_constants(aligned, file.fitted, effect, before.floor.by_axis_um)
    extended = replace(file, declared=(*file.declared, declared))
    return _change(extended, file, result, before, "add", effect.id, date)


def remove(file: ModelFile, effect_id: str, aligned: AlignedRecording, date: str) -> Change:
    """Take an effect out and fit the others again. Raises StateError where the model has no such effect."""
    ids = [fitted.effect.id for fitted in file.fitted]
    if effect_id not in ids:
        raise StateError(
            Problem(
                where=f"effect {effect_id}",
                what="is not in the model",
                allowed=", ".join(ids) or "the model has none",
            )
        )
    k = ids.index(effect_id)
    before = compare(aligned, file.fitted, file.covariance)
    result = fit(aligned, file.fitted[:k] + file.fitted[k + 1 :], before.floor.by_axis_um)
    reduced = replace(file, declared=file.declared[:k] + file.declared[k + 1 :])
    return _change(reduced, file, result, before, "remove", effect_id, date)


def refit(file: ModelFile, aligned: AlignedRecording, date: str) -> Change:
    """Fit all effects again from zero, nonlinear constants as they are. Raises StateError where there are none."""
    if not file.fitted:
        raise StateError(Problem(where="model", what="has no effect to fit", next_step="`compd effect add` adds one"))
    before = compare(aligned, file.fitted, file.covariance)
    unfitted = [initial_effect(fitted.effect, fitted.constants, aligned.rows.links) for fitted in file.fitted]
    result = fit(aligned, unfitted, before.floor.by_axis_um)
    return _change(file, file, result, before, "fit", "", date)


def undo(stored: StoredModel, date: str, where: str) -> StoredModel:
    """The model before its last step that is not undone yet; the file keeps the step and its undoing.

    where : the file, for messages. Raises StateError where there is no step to undo.
    """
    standing = [k for k, step in enumerate(stored.steps) if step.kind != "undo" and not step.undone]
    if not standing:
        raise StateError(Problem(where=where, what="has no step to undo"))
    last = stored.steps[standing[-1]]
    steps = list(stored.steps)
    steps[standing[-1]] = replace(last, undone=True)
    undoing = ModelStep(
        kind="undo",
        effect=last.effect,
        date=date,
        recording=last.recording,
        sha256=last.sha256,
        rms_before_um=last.rms_after_um,
        rms_after_um=last.rms_before_um,
        noise_floor_um=last.noise_floor_um,
        replaced={},
    )
    return StoredModel(stored.machine, last.replaced, (*steps, undoing), stored.geometry)


def _change(
    file: ModelFile, old: ModelFile, result: FitResult, before: Comparison, kind: Kind, effect_id: str, date: str
) -> Change:
    """Write the result of a fit and the step that led to it into the file, standard errors with disturbances.

    file : with its declarations after the step.  old : the file before it.
    """
    aligned = before.aligned
    criteria = Criteria()
    fitted_ids = [fitted.effect.id for fitted in result.fitted]
    others = library_pool(aligned, list(load_library().values()), fitted_ids, criteria)
    result = with_disturbances(result, aligned, before.floor.by_axis_um, others.candidates, criteria)
    after = compare(aligned, result.fitted, result.covariance)
    step = ModelStep(
        kind=kind,
        effect=effect_id,
        date=date,
        recording=aligned.recording.path.name,
        sha256=aligned.recording.sha256,
        rms_before_um=before.rms_um,
        rms_after_um=after.rms_um,
        noise_floor_um=after.floor.um,
        replaced=old.state(aligned.rows.links),
    )
    changed = replace(file, fitted=result.fitted, covariance=np.asarray(result.covariance), steps=(*old.steps, step))
    return Change(changed, before, after)
