"""`compd diagnose`: which physical effect is the model missing?"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from compd.diagnosis.empirical_search import EmpiricalFinding
    from compd.diagnosis.holdout import Holdout
    from compd.diagnosis.verdict import Diagnosis, DiagnosisStep

# Covariates that are listed; --json has them all.
SHOWN = 8


def diagnose(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING [SEALED...]",
            help="NAME.csv to learn from; any others stay sealed until the end, when the result is tried on them once.",
        ),
    ],
    machine: Annotated[
        Path | None, typer.Option("--machine", help="The machine's configuration; a shipped one is found by its name.")
    ] = None,
    model: Annotated[
        Path | None, typer.Option("--model", help="The model file with what is known already; it is not changed.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print numbers for programs.")] = False,
    html: Annotated[Path | None, typer.Option("--html", help="Write the page with pictures; works offline.")] = None,
) -> None:
    """Learn which physical effect is missing: the verdict, then the evidence, then what to measure next."""
    from rich.console import Console

    from compd.cli.compare import open_model, open_recording, write_page_to
    from compd.cli.progress import steps_shown
    from compd.diagnosis.diagnose import diagnose as diagnosed
    from compd.diagnosis.holdout import opened
    from compd.model.library import load_library

    if html is not None:
        write_page_to(html)
    sealed = [open_recording(path, machine)[0] for path in recordings[1:]]
    aligned, _ = open_recording(recordings[0], machine)
    file = open_model(model, aligned)
    effects = [*load_library().values()]
    with steps_shown(quiet=as_json) as progress:
        found = diagnosed(aligned, file.fitted, file.covariance, effects, progress)
    checked = [opened(found, one) for one in sealed]
    if html is not None:
        from compd.report.diagnosis_page import write_diagnosis

        write_diagnosis(html, found, checked)
    if as_json:
        data: dict[str, Any] = {**found.as_json(), "sealed": [one.as_json() for one in checked]}
        typer.echo(json.dumps(data, indent=1, allow_nan=False))
        return
    _print(Console(highlight=False), found, checked)
    if html is not None:
        typer.echo(f"The same as pictures: {html}")


def _print(console: Console, found: Diagnosis, checked: list[Holdout]) -> None:
    """Verdict first."""
    console.print(f"[bold]{found.verdict}[/]: {found.said}")
    for number, step in enumerate(found.steps, start=1):
        _print_step(console, number, step)
    for one in checked:
        console.print(f"\n{one.said}")
    if found.depends_on:
        console.print("\n[bold]What the rest follows[/] (a description, not a cause):")
        for dependence in found.depends_on[:SHOWN]:
            _print_dependence(console, dependence)
        _print_formulas(console, found.depends_on[0])
    _print_candidates(console, found)
    if found.next_measurement:
        console.print("\n[bold]Next[/], measure:")
        for row in found.next_measurement:
            console.print("    " + ", ".join(f"{name} {value}" for name, value in row.items()), soft_wrap=True)
        path = found.before.aligned.recording.path
        for step in found.steps:
            if step.rivals:
                pair = f"{step.effect.id},{step.rivals[0].name}"
                console.print(f"    more: compd plan {path} --rivals {pair} --rows 40", soft_wrap=True)


def _print_step(console: Console, number: int, step: DiagnosisStep) -> None:
    effect = step.effect
    console.print(f"\n[bold]{number}. {effect.id}[/]: {effect.physics}")
    console.print(f"    {effect.equation}", markup=False)
    for one in step.numbers:
        said = "" if one.plausible else " (implausible)"
        console.print(f"    {one.name} = {one.value:.4g} +- {one.std:.2g} {one.unit}{said}", markup=False)
    for name, value in step.fitted.constants.items():
        console.print(f"    {name} = {value:.4g}, searched")
    console.print(
        f"    explains {100 * step.explained_fraction:.3g} % of what was above the noise; error on rows left out "
        f"{step.heldout_rms_um:.3g} um; chance {step.p_adjusted:.3g}"
    )
    for rival in step.rivals:
        console.print(f"    rival: {rival.name}, {100 * rival.cosine:.1f} % alike on these rows")
    if step.rivals:
        console.print(f"    told apart by: {effect.separated_by}")


def _print_dependence(console: Console, one: EmpiricalFinding) -> None:
    console.print(
        f"    {one.covariate}, {one.form}, at the {one.port}: {100 * one.explained_fraction:.3g} % on rows left out "
        f"({one.heldout_rms_um:.3g} um left), chance {one.p_adjusted:.3g}"
        + (f", together with {', '.join(one.beside)}" if one.beside else "")
    )


def _print_formulas(console: Console, one: EmpiricalFinding) -> None:
    import yaml

    console.print("    To use it until the cause is known, each in a file of its own for `compd effect add`:")
    for effect, numbers in zip(one.formula_effects, one.numbers, strict=True):
        text = yaml.safe_dump(effect, sort_keys=False, default_flow_style=None, width=110)
        console.print("\n".join(f"      {line}" for line in text.splitlines()), markup=False, soft_wrap=True)
        fitted = ", ".join(f"{name} = {value:.4g}" for name, value in numbers.items())
        console.print(f"      # fitted: {fitted}", markup=False, soft_wrap=True)


def _print_candidates(console: Console, found: Diagnosis) -> None:
    from rich.table import Table

    table = Table("effect", "status", "explains", "left, um", "why")
    for one in found.candidates:
        if one.status in ("no_gain", "not_testable"):
            continue
        known = math.isfinite(one.explained_fraction)
        table.add_row(
            one.effect,
            one.status,
            f"{100 * max(one.explained_fraction, 0):.0f} %" if known else "-",
            f"{one.heldout_rms_um:.3g}" if known else "-",
            one.why,
        )
    if table.row_count:
        console.print("\n[bold]Effects of the library[/], each alone, on rows left out:")
        console.print(table)
    for status, said in (("no_gain", "Without gain"), ("not_testable", "Not testable here")):
        names = [one.effect for one in found.candidates if one.status == status]
        if names:
            console.print(f"{said}: {', '.join(names)}")
    console.print("--json gives each one's reason and numbers.")
