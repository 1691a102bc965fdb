"""Changes of a model file, one step at a time: add, remove, refit, undo; the file keeps every step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from compd.comparison import (
    AlignedRecording,
    Comparison,
    FitResult,
    compare,
    fit,
    initial_effect,
    search_constants,
)
from compd.determined_fit import determined
from compd.diagnosis import Criteria, library_pool, with_disturbances
from compd.errors import StateError
from compd.model.effects import Effect, FittedEffect, Observations, counted_from, recounted
from compd.model.library import load_library
from compd.model_file import Declaration, Kind, ModelFile, ModelStep, StoredModel


def add_to_model(
    model: ModelFile,
    declared: Declaration,
    effect: Effect,
    aligned: AlignedRecording,
    criteria: Criteria = Criteria(),
) -> ModelFile:
    """Add an effect and fit all effects together; its nonlinear constants are searched.

    declared : how the file declares the effect.
    Raises StateError where the model has the effect already, CompdError where it cannot be fitted on this recording.
    """
    if effect.id in [fitted.effect.id for fitted in model.fitted]:
        raise StateError.of(
            f"effect {effect.id}", "is in the model already", next_step="`compd model fit` fits it again"
        )
    before = compare(aligned, model.fitted, model.covariance)
    kept = _as_counted(model.fitted, aligned.rows)
    result = search_constants(aligned, kept, counted_from(effect, aligned.rows), before.floor.by_axis_um)
    extended = replace(
        model, declared=(*model.declared, declared), plausible={**model.plausible, **_stated(effect, aligned)}
    )
    return _changed(extended, model, result, before, "add", effect.id, criteria)


def _stated(effect: Effect, aligned: AlignedRecording) -> dict[str, dict[str, tuple[float, float]]]:
    """The ranges that a person stated for this effect, by its id and the numbers' names; empty for none."""
    stated = {one.parameter for one in aligned.ranges if one.effect == effect.id}
    columns = [column for column in effect.columns(aligned.rows.links) if column.parameter.name in stated]
    return {effect.id: {c.name: (c.parameter.low, c.parameter.high) for c in columns}} if columns else {}


def remove_effect(
    model: ModelFile,
    effect_id: str,
    aligned: AlignedRecording,
    criteria: Criteria = Criteria(),
) -> ModelFile:
    """Take an effect out and fit the others again.

    Raises StateError where the model has no such effect.
    """
    ids = [fitted.effect.id for fitted in model.fitted]
    if effect_id not in ids:
        raise StateError.of(
            f"effect {effect_id}", "is not in the model", allowed=", ".join(ids) or "the model has none"
        )
    k = ids.index(effect_id)
    before = compare(aligned, model.fitted, model.covariance)
    kept = _as_counted(model.fitted[:k] + model.fitted[k + 1 :], aligned.rows)
    result = fit(aligned, kept, before.floor.by_axis_um)
    reduced = replace(model, declared=model.declared[:k] + model.declared[k + 1 :])
    return _changed(reduced, model, result, before, "remove", effect_id, criteria)


def refit_model(
    model: ModelFile,
    aligned: AlignedRecording,
    criteria: Criteria = Criteria(),
) -> ModelFile:
    """Fit all effects again from zero, nonlinear constants as they are.

    They then count from machine zero where the recording has the quantities there, else from 20 degC.
    Raises StateError where there are none.
    """
    if not model.fitted:
        raise StateError.of("model", "has no effect to fit", next_step="`compd model add` adds one")
    before = compare(aligned, model.fitted, model.covariance)
    effects = [recounted(fitted.effect, aligned.rows) for fitted in model.fitted]
    unfitted = [
        initial_effect(effect, fitted.constants, aligned.rows.links)
        for effect, fitted in zip(effects, model.fitted, strict=True)
    ]
    result = fit(aligned, unfitted, before.floor.by_axis_um)
    return _changed(model, model, result, before, "fit", "", criteria)


def undo_step(stored: StoredModel, where: str) -> StoredModel:
    """The model before its last step that is not undone yet; the file keeps the step and its undoing.

    where : the file, for messages. Raises StateError where there is no step to undo.
    """
    standing = [k for k, step in enumerate(stored.steps) if step.kind != "undo" and not step.undone]
    if not standing:
        raise StateError.of(where, "has no step to undo")
    last = stored.steps[standing[-1]]
    steps = list(stored.steps)
    steps[standing[-1]] = replace(last, undone=True)
    undoing = ModelStep(
        kind="undo",
        effect=last.effect,
        date=_now(),
        recording=last.recording,
        sha256=last.sha256,
        rms_before_um=last.rms_after_um,
        rms_after_um=last.rms_before_um,
        noise_floor_um=last.noise_floor_um,
        replaced={},
        unit=last.unit,
    )
    return StoredModel(stored.machine, last.replaced, (*steps, undoing), stored.geometry)


def _changed(
    model: ModelFile,
    old: ModelFile,
    result: FitResult,
    before: Comparison,
    kind: Kind,
    effect_id: str,
    criteria: Criteria,
) -> ModelFile:
    """The model with the result of a fit and the step that led to it, standard errors with disturbances.

    model : with its declarations after the step.  old : before it.
    """
    aligned = before.aligned
    fitted_ids = [fitted.effect.id for fitted in result.fitted]
    others = library_pool(
        aligned, list(map(aligned.on_machine, load_library().values())), fitted_ids, criteria.candidates
    )
    result, remarks = determined(aligned, result)
    result = with_disturbances(result, aligned, before.floor.by_axis_um, others.candidates, criteria)
    after = compare(aligned, result.fitted, result.covariance)
    step = ModelStep(
        kind=kind,
        effect=effect_id,
        date=_now(),
        recording=aligned.recording.path.name,
        sha256=aligned.recording.sha256,
        rms_before_um=before.rms_um,
        rms_after_um=after.rms_um,
        noise_floor_um=after.floor.um,
        replaced=old.state(),
        unit=aligned.unit,
    )
    return replace(
        model,
        fitted=result.fitted,
        covariance=np.asarray(result.covariance),
        steps=(*old.steps, step),
        geometry=aligned.geometry_hash,  # all numbers were fitted on it
        fitted_range=result.ranges,
        plausible={id_: ranges for id_, ranges in model.plausible.items() if id_ in fitted_ids},
        warnings=remarks,
    )


def _as_counted(fitted: Sequence[FittedEffect], rows: Observations) -> tuple[FittedEffect, ...]:
    """The effects as they count in the rows on which they are fitted again."""
    return tuple(replace(each, effect=counted_from(each.effect, rows)) for each in fitted)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
