"""Changing a model, one step at a time: add, remove, fit, undo; each step is kept in the model file."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.compare import Comparison, compare
from compd.comparison.fit import FitResult, fit, start
from compd.comparison.shape_search import search_constants
from compd.diagnosis.candidates import library_pool
from compd.diagnosis.unmodelled import with_disturbances
from compd.errors import Problem, StateError
from compd.model.effect import Effect, FittedEffect
from compd.model.library import load_library
from compd.model_file import Declaration, Kind, ModelFile, ModelStep, StoredModel


@dataclass(frozen=True)
class Change:
    """The model after a step, and the recording against it before and after."""

    file: ModelFile
    before: Comparison
    after: Comparison


def add(file: ModelFile, declared: Declaration, effect: Effect, aligned: AlignedRecording, date: str) -> Change:
    """Add an effect and fit all effects together; its shape constants are searched.

    Raises StateError where the model has the effect already, CompdError where it cannot be fitted on this recording.
    """
    if any(one.effect.id == effect.id for one in file.fitted):
        raise StateError(
            Problem(
                where=f"effect {effect.id}",
                what="is in the model already",
                next_step="`compd effect fit` fits it again",
            )
        )
    before = compare(aligned, file.fitted, file.covariance)
    found = search_constants(aligned, file.fitted, effect, before.floor.by_axis_um)
    return _change(replace(file, declared=(*file.declared, declared)), file, found, before, "add", effect.id, date)


def remove(file: ModelFile, effect_id: str, aligned: AlignedRecording, date: str) -> Change:
    """Take an effect out and fit the others again. Raises StateError where the model has it not."""
    names = [one.effect.id for one in file.fitted]
    if effect_id not in names:
        raise StateError(
            Problem(
                where=f"effect {effect_id}",
                what="is not in the model",
                allowed=", ".join(names) or "the model has none",
            )
        )
    k = names.index(effect_id)
    before = compare(aligned, file.fitted, file.covariance)
    found = fit(aligned, file.fitted[:k] + file.fitted[k + 1 :], before.floor.by_axis_um)
    rest = replace(file, declared=file.declared[:k] + file.declared[k + 1 :])
    return _change(rest, file, found, before, "remove", effect_id, date)


def refit(file: ModelFile, aligned: AlignedRecording, date: str) -> Change:
    """Fit all effects again, shape constants as they are. Raises StateError where there are none."""
    if not file.fitted:
        raise StateError(Problem(where="model", what="has no effect to fit", next_step="`compd effect add` adds one"))
    before = compare(aligned, file.fitted, file.covariance)
    found = fit(aligned, [_afresh(one, aligned.rows.links) for one in file.fitted], before.floor.by_axis_um)
    return _change(file, file, found, before, "fit", "", date)


def undo(stored: StoredModel, date: str, where: str) -> StoredModel:
    """The model before its last standing step; the ledger keeps both. Raises StateError where there is none."""
    standing = [k for k, step in enumerate(stored.steps) if step.kind != "undo" and not step.undone]
    if not standing:
        raise StateError(Problem(where=where, what="has no step to undo"))
    last = stored.steps[standing[-1]]
    steps = list(stored.steps)
    steps[standing[-1]] = replace(last, undone=True)
    taken_back = ModelStep(
        "undo",
        last.effect,
        date,
        last.recording,
        last.sha256,
        last.rms_after_um,
        last.rms_before_um,
        last.noise_floor_um,
        {},
    )
    return StoredModel(stored.machine, last.replaced, (*steps, taken_back), stored.geometry)


def _afresh(one: FittedEffect, links: int) -> FittedEffect:
    return start(one.effect, one.constants, links)


def _change(
    file: ModelFile, old: ModelFile, found: FitResult, before: Comparison, kind: Kind, effect: str, date: str
) -> Change:
    aligned = before.aligned
    others = library_pool(aligned, list(load_library().values()), [one.effect.id for one in found.fitted])
    found = with_disturbances(found, aligned, before.floor.by_axis_um, others.candidates)
    after = compare(aligned, found.fitted, found.covariance)
    recording = aligned.recording
    step = ModelStep(
        kind,
        effect,
        date,
        recording.path.name,
        recording.sha256,
        before.rms_um,
        after.rms_um,
        after.floor.um,
        old.state(aligned.rows.links),
    )
    changed = replace(file, fitted=found.fitted, covariance=np.asarray(found.covariance), steps=(*old.steps, step))
    return Change(changed, before, after)
