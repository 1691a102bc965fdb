"""`compd sim campaign`: simulate the recording of a measuring campaign."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class ReferenceKind(StrEnum):
    """The reference instrument beside the gauges."""

    tracker = "tracker"
    interferometer = "interferometer"
    ball_plate = "ball_plate"
    ballbar = "ballbar"
    pin = "pin"
    ball = "ball"
    pose = "pose"


def campaign(
    config: Annotated[Path, typer.Argument(help="The machine's configuration; it is read, never written.")],
    out: Annotated[
        Path, typer.Option(help="The recording to write: NAME.csv or NAME.parquet, and NAME.yaml beside it.")
    ],
    seed: Annotated[int, typer.Option(min=0, help="Random seed of machine, weather, points and noise.")] = 1,
    effect: Annotated[
        list[str] | None,
        typer.Option(help="A cause unseen by the gauges: id=strength, or id alone for three times the noise."),
    ] = None,
    hidden: Annotated[
        int | None, typer.Option(min=0, help="Hide a random cause by this seed; its answer is sealed.")
    ] = None,
    reference: Annotated[ReferenceKind, typer.Option(help="The reference instrument.")] = ReferenceKind.tracker,
    other_days: Annotated[
        int, typer.Option(min=0, help="Another campaign on the same machine: other points, weather and loads.")
    ] = 0,
    plan: Annotated[Path | None, typer.Option(help="Measure only these rows, written by `compd plan --out`.")] = None,
    zero_degC: Annotated[
        float, typer.Option("--zero-temperature", help="Temperature of machine and room at machine zero, degC.")
    ] = 20.0,
    overwrite: Annotated[bool, typer.Option(help="Overwrite existing files.")] = False,
) -> None:
    """Simulate a measuring campaign: about 600 rows in four sessions, repeats, loads, passes, 1 % outliers.

    Two disturbances of a fifth of the noise are always in it. What was hidden, and how strong, is written to
    NAME.answer.json; who wants to diagnose leaves that file shut.
    """
    from rich.console import Console

    from compd.simulation import simulate_campaign

    written = simulate_campaign(
        config,
        out,
        seed=seed,
        effects=effect or [],
        hidden=hidden,
        reference=reference.value,
        other_days=other_days,
        plan=plan,
        zero_degC=zero_degC,
        overwrite=overwrite,
    )
    summary = f"{written.rows} rows, {written.columns} columns"
    if written.planned:
        summary = (
            f"the plan's {written.planned} rows, {written.measured} with repeats, and "
            f"{written.rows - written.measured} between them that only the gauges saw"
        )
    Console().print(f"{written.recording}: {summary}; under seal: {written.answer}", soft_wrap=True)
