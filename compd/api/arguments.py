"""Arguments of the public functions: a recording, a model and effects, each opened or given by its path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

from compd.comparison import AlignedRecording, ComparisonCriteria, open_whole_or_sample
from compd.errors import StateError
from compd.model.effects import Effect
from compd.model_file import ModelFile, read_model_file
from compd.parameter_ranges import fitted_on_machine

# An opened recording, or the path of one whose machine is found by its name.
Recorded: TypeAlias = AlignedRecording | str | Path
# An opened model or its path; None for the machine without effects.
Model: TypeAlias = ModelFile | str | Path | None
# Effects of one's own: an effect, a source of effects as `load_effects` takes it, or several of these.
Effects: TypeAlias = str | Path | Effect | Sequence[Effect | str | Path]


def opened_recording(recording: Recorded, criteria: ComparisonCriteria | None = None) -> AlignedRecording:
    """A recording, opened with its machine where it is named by its path: a sample where it is too long for the memory.

    criteria : by which it is compared; None for its own. One that is open keeps how it was aligned.
    """
    if not isinstance(recording, AlignedRecording):
        return open_whole_or_sample(Path(recording), criteria=criteria or ComparisonCriteria())
    return recording if criteria is None else replace(recording, criteria=criteria)


def opened_model(model: Model, aligned: AlignedRecording) -> ModelFile:
    """The model of the recording's machine. Raises StateError for the model of another one."""
    machine, links = aligned.recording.machine, aligned.rows.links
    if model is None:
        return ModelFile(machine, links)
    if not isinstance(model, ModelFile):
        return _on_machine(read_model_file(Path(model), machine, links), aligned)
    if model.machine != machine:
        raise StateError.of(
            "model",
            "belongs to another machine than the recording",
            value=model.machine,
            allowed=machine,
            next_step="give this machine's model, or begin a new one",
        )
    if model.links not in (0, links):
        raise StateError.of(
            "model",
            "has another number of links than the recording",
            value=str(model.links),
            allowed=str(links),
            next_step="give the model of these links, or begin a new one",
        )
    # an external model, whose effects lack numbers of single links
    return _on_machine(replace(model, links=links), aligned)


def _on_machine(model: ModelFile, aligned: AlignedRecording) -> ModelFile:
    """The model, its effects with the ranges that they have on the recording's machine."""
    return replace(model, fitted=fitted_on_machine(model.fitted, aligned.rows, aligned.ranges))
