"""`compd diagnose`: which physical effect is the model missing?"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from compd.cli.options import EffectsOption, MachineOption

if TYPE_CHECKING:
    from rich.console import Console

    from compd.diagnosis.findings import DiagnosisStep, EmpiricalFinding
    from compd.diagnosis.holdout import Holdout
    from compd.diagnosis.verdict import Diagnosis

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
    machine: MachineOption = None,
    model: Annotated[
        Path | None, typer.Option("--model", help="The model file with what is known already; it is not changed.")
    ] = None,
    effects: EffectsOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON, for programs.")] = False,
    html: Annotated[Path | None, typer.Option("--html", help="Write the page with pictures; works offline.")] = None,
) -> None:
    """Learn which physical effect is missing: the verdict, then the evidence, then what to measure next."""
    from rich.console import Console

    from compd.api import diagnose as diagnose_recording
    from compd.cli.progress import steps_shown
    from compd.comparison.open import open_recording
    from compd.diagnosis.holdout import evaluate_holdout

    if html is not None:
        from compd.report.page import check_page_path

        check_page_path(html)
    sealed = [open_recording(path, machine) for path in recordings[1:]]
    aligned = open_recording(recordings[0], machine)
    with steps_shown(quiet=as_json) as progress:
        diagnosis = diagnose_recording(aligned, model, effects=effects or (), progress=progress)
    holdouts = [evaluate_holdout(diagnosis, recording) for recording in sealed]
    if html is not None:
        from compd.report.diagnosis_page import write_diagnosis_page

        write_diagnosis_page(html, diagnosis, holdouts)
    if as_json:
        data: dict[str, Any] = {**diagnosis.as_json(), "sealed": [holdout.as_json() for holdout in holdouts]}
        typer.echo(json.dumps(data, indent=1, allow_nan=False))
        return
    _print_diagnosis(Console(highlight=False), diagnosis, holdouts)
    if html is not None:
        typer.echo(f"The same as pictures: {html}")


def _print_diagnosis(console: Console, diagnosis: Diagnosis, holdouts: list[Holdout]) -> None:
    """Verdict first."""
    console.print(f"[bold]{diagnosis.verdict}[/]: {diagnosis.summary}")
    for number, step in enumerate(diagnosis.steps, start=1):
        _print_step(console, number, step)
    for holdout in holdouts:
        console.print(f"\n{holdout.summary}")
    if diagnosis.depends_on:
        console.print("\n[bold]What the rest follows[/] (a description, not a cause):")
        for finding in diagnosis.depends_on[:SHOWN]:
            _print_finding(console, finding)
        _print_formulas(console, diagnosis.depends_on[0])
    _print_candidates(console, diagnosis)
    if diagnosis.next_measurement:
        console.print("\n[bold]Next[/], measure:")
        for row in diagnosis.next_measurement:
            console.print("    " + ", ".join(f"{name} {value}" for name, value in row.items()), soft_wrap=True)
        path = diagnosis.before.aligned.recording.path
        for step in diagnosis.steps:
            if step.rivals:
                pair = f"{step.effect.id},{step.rivals[0].name}"
                console.print(f"    more: compd plan {path} --rivals {pair} --rows 40", soft_wrap=True)


def _print_step(console: Console, number: int, step: DiagnosisStep) -> None:
    effect = step.effect
    console.print(f"\n[bold]{number}. {effect.id}[/]: {effect.physics}")
    console.print(f"    {effect.equation}", markup=False)
    for parameter in step.parameters:
        remark = "" if parameter.plausible else " (implausible)"
        value = f"{parameter.value:.4g} +- {parameter.std:.2g} {parameter.unit}"
        console.print(f"    {parameter.name} = {value}{remark}", markup=False)
    for name, constant in step.fitted.constants.items():
        console.print(f"    {name} = {constant:.4g}, searched")
    console.print(
        f"    explains {100 * step.explained_fraction:.3g} % of what was above the noise; error on rows left out "
        f"{step.heldout_rms_um:.3g} um; chance {step.p_value:.3g}"
    )
    for rival in step.rivals:
        console.print(f"    rival: {rival.name}, {100 * rival.cosine:.1f} % alike on these rows")
    if step.rivals:
        console.print(f"    told apart by: {effect.separated_by}")


def _print_finding(console: Console, finding: EmpiricalFinding) -> None:
    console.print(
        f"    {finding.covariate}, {finding.form}, at the {finding.port}: "
        f"{100 * finding.explained_fraction:.3g} % on rows left out "
        f"({finding.heldout_rms_um:.3g} um left), chance {finding.p_value:.3g}"
        + (f", together with {', '.join(finding.beside)}" if finding.beside else "")
    )


def _print_formulas(console: Console, finding: EmpiricalFinding) -> None:
    import yaml

    console.print("    To use it until the cause is known, each in a file of its own for `compd effect add`:")
    for effect, parameters in zip(finding.formula_effects, finding.parameters, strict=True):
        text = yaml.safe_dump(effect, sort_keys=False, default_flow_style=None, width=110)
        console.print("\n".join(f"      {line}" for line in text.splitlines()), markup=False, soft_wrap=True)
        fitted = ", ".join(f"{name} = {value:.4g}" for name, value in parameters.items())
        console.print(f"      # fitted: {fitted}", markup=False, soft_wrap=True)


def _print_candidates(console: Console, diagnosis: Diagnosis) -> None:
    from rich.table import Table

    table = Table("effect", "status", "explains", "left, um", "why")
    for candidate in diagnosis.candidates:
        if candidate.status in ("no_gain", "not_testable"):
            continue
        known = math.isfinite(candidate.explained_fraction)
        table.add_row(
            candidate.effect,
            candidate.status,
            f"{100 * max(candidate.explained_fraction, 0):.0f} %" if known else "-",
            f"{candidate.heldout_rms_um:.3g}" if known else "-",
            candidate.why,
        )
    if table.row_count:
        console.print("\n[bold]Effects of the library[/], each alone, on rows left out:")
        console.print(table)
    for status, heading in (("no_gain", "Without gain"), ("not_testable", "Not testable here")):
        names = [candidate.effect for candidate in diagnosis.candidates if candidate.status == status]
        if names:
            console.print(f"{heading}: {', '.join(names)}")
    console.print("--json gives each one's reason and numbers.")
