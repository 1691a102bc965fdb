"""Changes of the model from the page: preview of a step, as with `--dry-run`, then the step itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from compd.api import add_effect
from compd.errors import StateError
from compd.model.effects import Effect
from compd.model_changes import refit_model, remove_effect, undo_step
from compd.model_file import EffectNumber, ModelFile, read_stored, write_stored
from compd.page.workbench.opened_recording import OpenedRecording, fall, model_of
from compd.text import nan_to_null


def proposed(opened: OpenedRecording, kind: str, effect: str, library: Mapping[str, Effect]) -> OpenedRecording:
    """The recording with the model after a proposed step.

    kind : "add", "remove" or "fit".  effect : the id that is added or removed.
    Raises CompdError if the step cannot be made, StateError for another kind.
    """
    aligned, model = opened.aligned, opened.model
    match kind:
        case "add":
            if effect not in library:  # never a path, from which code would be loaded
                raise StateError.of("step", "no such effect", value=effect)
            changed = add_effect(model, library[effect], aligned)
        case "remove":
            changed = remove_effect(model, effect, aligned)
        case "fit":
            changed = refit_model(model, aligned)
        case _:
            raise StateError.of("step", "is not known", value=kind, allowed="add, remove, fit")
    return replace(opened, model=changed)


def write(opened: OpenedRecording) -> None:
    """Write a proposed model. Raises StateError if the disk refuses."""
    opened.model.write(opened.model_path)


def undone(opened: OpenedRecording) -> OpenedRecording:
    """Undo the last step in the file. Raises StateError if there is none."""
    path = opened.model_path
    if not path.exists():
        raise StateError.of(str(path), "has no step to undo")
    write_stored(path, undo_step(read_stored(path), str(path)))
    return replace(opened, model=model_of(path, opened.aligned))


def step_summary(before: OpenedRecording, after: OpenedRecording) -> dict[str, Any]:
    """The errors before and after a step, and every number's old and new value, as plain data."""
    old = {(number.effect, number.parameter): number.value for number in before.model.numbers()}
    summary: dict[str, Any] = nan_to_null(
        {
            **fall(before.comparison, after.comparison),
            "floor_ratio": [before.comparison.floor_ratio, after.comparison.floor_ratio],
            "unit": after.aligned.unit,
            "verdict": after.comparison.verdict,
            "numbers": [_number(number, old) for number in after.model.numbers()],
            "gone": [f"{effect}.{name}" for effect, name in old if effect not in _ids(after.model)],
        }
    )
    return summary


def _ids(model: ModelFile) -> set[str]:
    return {fitted.effect.id for fitted in model.fitted}


def _number(number: EffectNumber, old: Mapping[tuple[str, str], float]) -> dict[str, Any]:
    was = old.get((number.effect, number.parameter))
    return {**vars(number), "plausible": number.plausible, "was": was}
