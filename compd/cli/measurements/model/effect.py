"""`compd model`: the library of physical causes, and stepwise changes of a model file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from compd.cli.option_groups import PageOptions, with_groups
from compd.cli.options import EffectsOption, HoldOption, MachineOption, RangesOption
from compd.cli.paths import PathKind

if TYPE_CHECKING:
    from rich.console import RenderableType

    from compd.comparison import AlignedRecording
    from compd.configuration import Configuration
    from compd.errors import Problem
    from compd.model.effects import Effect
    from compd.model_file import Declaration, ModelFile

ModelOption = Annotated[Path, typer.Option("--model", help="The model file; `add` creates a missing one.")]
EFFECT_HELP = "An id from `compd model effects`; FILE.yaml with one effect, or FILE.yaml:ID; FILE.py:NAME."


effect = typer.Typer()


class StepOptions(NamedTuple):
    """Options of every step that fits a model to a recording."""

    recording: Annotated[Path, typer.Option(help="The recording for the fit: NAME.csv or NAME.parquet.")]
    model: ModelOption
    machine: MachineOption = None
    hold: HoldOption = None
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Show the result without writing it.")] = False


@effect.command("effects")
def list_effects(effects: EffectsOption = None) -> None:
    """List the installed effects, or those of --effects: port, required quantities, description."""
    from rich.console import Console
    from rich.table import Table

    from compd.model.library import gather_effects, load_library

    table = Table("effect", "port", "needs", "physics")
    table.columns[0].no_wrap = True
    table.columns[2].overflow = "fold"  # names of quantities stay whole for copying
    for entry in (gather_effects(effects) if effects else load_library()).values():
        table.add_row(entry.id, entry.port, ", ".join(entry.needs) or "-", entry.physics)
    Console().print(table)


@effect.command("effect")
@with_groups
def show(
    name: Annotated[str, typer.Argument(metavar="EFFECT", help=EFFECT_HELP), PathKind.NAME_OR_FILE],
    machine: Annotated[
        Path | None, typer.Option(help="Machine configuration (YAML); default: the shipped tripod.")
    ] = None,
    effects: EffectsOption = None,
    page: PageOptions = PageOptions(),
) -> None:
    """Show one effect: its physics, its parameters, and with --html its displacement of a machine's tip."""
    from rich.console import Console

    from compd.configuration import load_machine
    from compd.model.library import gather_effects, named_effect

    page.check()
    shown = named_effect(name, "compd model effect", gather_effects(effects or ()))
    configuration = load_machine(machine or "tripod-cmm")
    # an effect of one's own may belong to another machine than the shipped one
    Console().print(_card(shown, configuration if machine or not shown.declared else None))
    if page.html is not None:
        from compd.report import write_effect_page

        write_effect_page(page.html, shown, configuration)
        typer.echo(f"{shown.id} on {configuration.machine}: {page.html}")


@effect.command()
@with_groups
def add(
    name: Annotated[str, typer.Argument(metavar="EFFECT", help=EFFECT_HELP), PathKind.NAME_OR_FILE],
    step: StepOptions,
    effects: EffectsOption = None,
    ranges: RangesOption = None,
) -> None:
    """Add an effect to a model and fit all its effects together."""
    from compd.api import add_effect

    aligned = _open(step, ranges or ())
    before = _read_model(step.model, aligned) if step.model.exists() else None
    changed = add_effect(before, name, aligned, effects=effects or ())
    _finish(step, before, changed, aligned, f"added {changed.steps[-1].effect}")


@effect.command()
@with_groups
def remove(
    name: Annotated[str, typer.Argument(metavar="EFFECT", help="The id of an effect in the model.")],
    step: StepOptions,
) -> None:
    """Take an effect out of a model and fit the others again."""
    from compd.model_changes import remove_effect

    aligned = _open(step)
    before = _read_model(step.model, aligned)
    _finish(step, before, remove_effect(before, name, aligned), aligned, f"removed {name}")


@effect.command()
@with_groups
def fit(step: StepOptions) -> None:
    """Fit all effects of a model again, on another recording."""
    from compd.model_changes import refit_model

    aligned = _open(step)
    before = _read_model(step.model, aligned)
    _finish(step, before, refit_model(before, aligned), aligned, "fitted again")


@effect.command()
def undo(model: ModelOption) -> None:
    """Undo the last step; repeat it for the previous ones. The ledger keeps them."""
    from compd.model_changes import undo_step
    from compd.model_file import read_stored, write_stored

    after = undo_step(read_stored(model), str(model))
    write_stored(model, after)
    names = ", ".join(_declared_id(entry["effect"]) for entry in after.state["effects"]) or "none"
    typer.echo(f"{model}: one step taken back; effects now: {names}")


def _declared_id(declared: Declaration) -> str:
    return declared if isinstance(declared, str) else str(declared["id"])


def _open(step: StepOptions, ranges: Sequence[str] = ()) -> AlignedRecording:
    """The recording; for one too long for the memory a sample, which is said."""
    from compd.cli.progress import open_shown

    aligned = open_shown(step.recording, step.machine, ranges, step.hold or ())
    if sample := aligned.recording.sample:
        typer.echo(f"Fitted to {len(sample.row):,} of {sample.rows:,} rows: a sample. Standard errors are those of it.")
    return aligned


def _read_model(path: Path, aligned: AlignedRecording) -> ModelFile:
    from compd.model_file import read_model_file

    return read_model_file(path, aligned.recording.machine, aligned.rows.links)


def _finish(
    step: StepOptions, model: ModelFile | None, changed: ModelFile, aligned: AlignedRecording, done: str
) -> None:
    """Write the file, unless it is a dry run, then print the step's result. model : before it, None for a new one."""
    from rich.console import Console
    from rich.table import Table

    from compd.api import compare
    from compd.display_unit import format_error
    from compd.report import keep_words_whole

    if step.dry_run:
        done = f"not written: would have {done}"
    else:
        changed.write(step.model)
    before, after = compare(aligned, model), compare(aligned, changed)
    console = Console(highlight=False)
    console.print(
        f"{step.model}: {done}; residual {format_error(before.rms_um, aligned.unit, 3)} -> "
        f"{format_error(after.rms_um, aligned.unit, 3)}, floor ratio "
        f"{before.floor_ratio:.3g} -> {after.floor_ratio:.3g}"
    )
    table = Table("effect", "parameter", "value", "standard error", "unit", "plausible")
    for number in changed.numbers():
        plausible = f"{number.plausible_low:g} to {number.plausible_high:g}"
        table.add_row(
            number.effect,
            number.parameter,
            f"{number.value:.5g}",
            "searched" if number.searched else f"{number.standard_error:.2g}",
            number.unit,
            "" if number.searched else plausible + ("" if number.plausible else ": [red]outside[/]"),
        )
    console.print(keep_words_whole(table, console.width))
    for fitted in changed.fitted:
        for text in fitted.effect.remarks:
            typer.echo(f"look: effect {fitted.effect.id}: {text}")
    for remark in changed.warnings:
        typer.echo(f"look: {remark.where}: {remark.what}; {remark.allowed}")
    typer.echo(after.verdict)


def _card(effect: Effect, configuration: Configuration | None) -> RenderableType:
    """The effect's declaration, and whether the machine, if any, meets its needs."""
    from rich.console import Group
    from rich.table import Table

    from compd.model.effects import PORTS

    card = Table.grid(padding=(0, 2))
    card.add_row("[bold]effect", effect.id)
    card.add_row("physics", effect.physics)
    for port in effect.ports:
        card.add_row("port", f"{port}: {PORTS[port]}")
    card.add_row("equation", effect.equation)
    for symbol, meaning in effect.symbols.items():
        card.add_row("", f"{symbol}: {meaning}")
    card.add_row("source", effect.source)
    card.add_row("needs", ", ".join(effect.needs) or "nothing but the links' gauges")
    if effect.remarks:
        card.add_row("look", "\n".join(effect.remarks))
    card.add_row("mistaken for", ", ".join(effect.mistaken_for) or "-")
    card.add_row("separated by", effect.separated_by)
    if configuration is not None:
        lacking = _lacking(effect, configuration)
        card.add_row(f"on {configuration.machine}", "\n".join(map(str, lacking)) or "has all that it needs")

    numbers = Table("parameter", "unit", "plausible", "one per", "where the range comes from")
    for parameter in effect.parameters:
        numbers.add_row(
            parameter.name,
            parameter.unit,
            f"{parameter.low:g} to {parameter.high:g}",
            parameter.per.replace("_", " and "),
            parameter.source,
        )
    for constant in effect.constants:
        how = f"from {constant.setting}, else searched" if constant.setting else "searched"
        numbers.add_row(constant.name, constant.unit, f"{constant.low:g} to {constant.high:g}", how, constant.source)
    return Group(card, numbers)


def _lacking(effect: Effect, configuration: Configuration) -> list[Problem]:
    """Quantities that the effect needs and the machine's gauges lack."""
    from compd.machine_builder import build_model
    from compd.model.effects import available_settings, unmet_needs

    model = build_model(configuration.geometry, configuration.wiring)
    assert model.constants is not None
    measured = {wire.name for wire in configuration.wiring.quantities}
    return unmet_needs(effect, measured | available_settings(model.constants), model.links)
