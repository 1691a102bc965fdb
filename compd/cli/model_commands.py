"""`compd effect add | remove | fit | undo`: changing a model, one step at a time."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from compd.comparison.aligned_recording import AlignedRecording
    from compd.diagnosis.model_changes import Change
    from compd.model.effect import Effect
    from compd.model_file import Declaration, ModelFile

ModelOption = Annotated[Path, typer.Option("--model", help="The model file; `add` begins one where there is none.")]
MachineOption = Annotated[
    Path | None, typer.Option("--machine", help="The machine's configuration; a shipped one is found by its name.")
]
RecordingOption = Annotated[Path, typer.Option("--recording", help="What to fit on: NAME.csv.")]
DryRunOption = Annotated[bool, typer.Option("--dry-run", help="Show what would happen; write nothing.")]
EFFECT_HELP = "An id from `compd effect list`, /absolute/file.py:NAME, or a YAML file with a formula."


def add(
    effect: Annotated[str, typer.Argument(metavar="EFFECT", help=EFFECT_HELP)],
    recording: RecordingOption,
    model: ModelOption,
    machine: MachineOption = None,
    dry_run: DryRunOption = False,
) -> None:
    """Add an effect to a model and fit all its effects together."""
    from compd.comparison.open import open_recording
    from compd.diagnosis.model_changes import add as add_effect

    declared, declared_effect = declaration_of(effect)
    aligned = open_recording(recording, machine)
    file = _opened(model, aligned) if model.exists() else _begun(aligned)
    change = add_effect(file, declared, declared_effect, aligned, _now())
    _finish(model, change, f"added {declared_effect.id}", dry_run)


def remove(
    effect: Annotated[str, typer.Argument(metavar="EFFECT", help="The id of an effect in the model.")],
    recording: RecordingOption,
    model: ModelOption,
    machine: MachineOption = None,
    dry_run: DryRunOption = False,
) -> None:
    """Take an effect out of a model and fit the others again."""
    from compd.comparison.open import open_recording
    from compd.diagnosis.model_changes import remove as remove_effect

    aligned = open_recording(recording, machine)
    _finish(model, remove_effect(_opened(model, aligned), effect, aligned, _now()), f"removed {effect}", dry_run)


def fit(
    recording: RecordingOption, model: ModelOption, machine: MachineOption = None, dry_run: DryRunOption = False
) -> None:
    """Fit all effects of a model again, on another recording."""
    from compd.comparison.open import open_recording
    from compd.diagnosis.model_changes import refit

    aligned = open_recording(recording, machine)
    _finish(model, refit(_opened(model, aligned), aligned, _now()), "fitted again", dry_run)


def undo(model: ModelOption) -> None:
    """Take back the last step; undo again for the step before it. The ledger keeps both."""
    from compd.diagnosis.model_changes import undo as undo_step
    from compd.model_file import read_stored, write_stored

    after = undo_step(read_stored(model), _now(), str(model))
    write_stored(model, after)
    names = ", ".join(_name(entry["effect"]) for entry in after.state["effects"]) or "none"
    typer.echo(f"{model}: one step taken back; effects now: {names}")


def _name(declared: Declaration) -> str:
    return declared if isinstance(declared, str) else str(declared["id"])


def declaration_of(text: str) -> tuple[Declaration, Effect]:
    """What the person named, and the effect it stands for. Raises CompdError with every problem."""
    from compd.configuration.document import read_document
    from compd.model.library import find_effect

    if Path(text).suffix in (".yaml", ".yml"):
        declared = read_document(Path(text)).data
        return declared, find_effect(declared, text)
    return text, find_effect(text, "compd effect add")


def _opened(path: Path, aligned: AlignedRecording) -> ModelFile:
    """All its numbers are about to be fitted again, on this geometry."""
    from compd.model_file import read_model_file

    file = read_model_file(path, aligned.recording.machine, aligned.rows.links)
    return replace(file, geometry=aligned.geometry_hash)


def _begun(aligned: AlignedRecording) -> ModelFile:
    from compd.model_file import ModelFile

    return ModelFile(aligned.recording.machine, geometry=aligned.geometry_hash)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _finish(path: Path, change: Change, done: str, dry_run: bool) -> None:
    """Write the file, unless it is a dry run, then say what the step did."""
    from rich.console import Console
    from rich.table import Table

    from compd.model_file import parameter_estimates, write_model_file

    links = change.after.aligned.rows.links
    if dry_run:
        done = f"not written: would have {done}"
    else:
        write_model_file(path, change.file, links)
    before, after = change.before, change.after
    console = Console(highlight=False)
    console.print(
        f"{path}: {done}; residual {before.rms_um:.3g} um -> {after.rms_um:.3g} um, floor ratio "
        f"{before.floor_ratio:.3g} -> {after.floor_ratio:.3g}"
    )
    ranges = {
        (fitted.effect.id, column.name): column.parameter
        for fitted in change.file.fitted
        for column in fitted.effect.columns(links)
    }
    table = Table("effect", "parameter", "value", "standard error", "unit", "plausible")
    for effect, number in parameter_estimates(change.file.fitted, links):
        parameter = ranges[effect, number["name"]]
        inside = parameter.low <= number["value"] <= parameter.high
        plausible = f"{parameter.low:g} to {parameter.high:g}" + ("" if inside else ": [red]outside[/]")
        table.add_row(
            effect, number["name"], f"{number['value']:.5g}", f"{number['std']:.2g}", number["unit"], plausible
        )
    for fitted in change.file.fitted:
        for name, value in fitted.constants.items():
            unit = next(constant.unit for constant in fitted.effect.constants if constant.name == name)
            table.add_row(fitted.effect.id, name, f"{value:.5g}", "searched", unit, "")
    console.print(table)
    typer.echo(after.verdict)
