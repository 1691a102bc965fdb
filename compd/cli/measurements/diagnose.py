"""`compd diagnose`: find the physical effect that the model lacks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from compd.cli.option_groups import PageOptions, with_groups
from compd.cli.options import EffectsOption, HoldOption, JsonOption, MachineOption, RangesOption


@with_groups
def diagnose(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING [SEALED...]",
            help="NAME.csv or NAME.parquet to learn from; any others stay sealed until the end, for one "
            "test of the result.",
        ),
    ],
    machine: MachineOption = None,
    model: Annotated[
        Path | None, typer.Option("--model", help="The model file with the known effects; it is not changed.")
    ] = None,
    effects: EffectsOption = None,
    ranges: RangesOption = None,
    hold: HoldOption = None,
    as_json: JsonOption = False,
    page: PageOptions = PageOptions(),
) -> None:
    """Find the missing physical effect: twelve lines with the verdict and the next step, then the evidence.

    Of a recording of more than 200,000 rows a sample is diagnosed, spread evenly.
    """
    from rich.console import Console

    from compd.api import diagnose as diagnose_recording
    from compd.cli.progress import open_shown, steps_shown
    from compd.diagnosis import evaluate_holdouts
    from compd.report import print_diagnosis

    page.check()
    sealed = [open_shown(path, machine, hold=hold or ()) for path in recordings[1:]]
    aligned = open_shown(recordings[0], machine, ranges or (), hold or ())
    with steps_shown(quiet=as_json) as progress:
        diagnosis = diagnose_recording(aligned, model, effects=effects or (), progress=progress)
    diagnosis, holdouts = evaluate_holdouts(diagnosis, sealed)
    if page.html is not None:
        from compd.report import write_diagnosis_page

        write_diagnosis_page(page.html, diagnosis, holdouts)
    if as_json:
        data: dict[str, Any] = {**diagnosis.as_json(), "sealed": [holdout.as_json() for holdout in holdouts]}
        if "sample" in (compared := diagnosis.before.as_json()):
            data["sample"] = compared["sample"]
        typer.echo(json.dumps(data, indent=1, allow_nan=False))
        return
    print_diagnosis(Console(highlight=False), diagnosis, holdouts)
    if page.html is not None:
        typer.echo(f"The same as pictures: {page.html}")
