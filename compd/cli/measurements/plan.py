"""`compd plan`: plan the measurement that distinguishes two effects."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from compd.cli.options import EffectsOption, MachineOption, OverwriteOption


class PlanShape(StrEnum):
    """Consumer of the rows."""

    plan = "plan"
    sa = "sa"
    csv = "csv"
    gcode = "gcode"


def plan(
    recording: Annotated[
        Path, typer.Argument(metavar="RECORDING", help="The recording so far: NAME.csv or NAME.parquet.")
    ],
    rivals: Annotated[str, typer.Option(help="Two effects or more, by id: A,B,C.")],
    rows: Annotated[int, typer.Option(min=2, help="Number of rows to measure.")] = 40,
    out: Annotated[Path | None, typer.Option(help="File for the rows (CSV); default: the screen.")] = None,
    machine: MachineOption = None,
    model: Annotated[Path | None, typer.Option("--model", help="The model file with the known effects.")] = None,
    effects: EffectsOption = None,
    beside: Annotated[
        str | None,
        typer.Option(help="Other effects found outside the model, by id: C,D. They are fitted along."),
    ] = None,
    workspace: Annotated[
        str | None,
        typer.Option(help="Workspace of the tip in mm: x0,x1,y0,y1,z0,z1; default: as in the recording."),
    ] = None,
    force: Annotated[float | None, typer.Option(min=0, help="Largest load in N; default: as in the recording.")] = None,
    temperature: Annotated[
        str | None, typer.Option(help="Lowest,highest in degC; default: as in the recording.")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(min=0, help="Highest speed in mm/s; default: as in the recording.")
    ] = None,
    limit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="COLUMN=LOW,HIGH",
            help="With `machine: external`: lowest and highest value of a column; default: as in the recording. "
            "May be repeated.",
        ),
    ] = None,
    shape: Annotated[
        PlanShape,
        typer.Option(
            "--as",
            help="plan (CSV for `compd simulate --plan`); targets for the instrument: sa (SpatialAnalyzer), csv; gcode "
            "for the controller.",
        ),
    ] = PlanShape.plan,
    feed: Annotated[float | None, typer.Option(min=0.1, help="For gcode: feed between the places, mm/min.")] = None,
    dwell: Annotated[float, typer.Option(min=0, help="For gcode: dwell at each place, s.")] = 3.0,
    overwrite: OverwriteOption = False,
) -> None:
    """Plan the rows (poses, loads, temperatures, speeds, other settings) on which rival effects differ most.

    Of three rivals or more, those that no rows within the limits tell apart are named.
    """
    from compd.api import plan_measurement
    from compd.comparison import open_recording
    from compd.files import check_replaceable
    from compd.plan_file import PURPOSE_COLUMN
    from compd.planning import MARKS

    if out is not None:
        mark = f"{PURPOSE_COLUMN},".encode() if shape is PlanShape.plan else MARKS[shape.value]
        check_replaceable(out, (mark,), "a plan", overwrite)
    box = None if workspace is None else _numbers("--workspace", workspace, 6)
    heat = None if temperature is None else _numbers("--temperature", temperature, 2)
    planned = plan_measurement(
        open_recording(recording, machine),
        [name.strip() for name in rivals.split(",")],
        rows=rows,
        model=model,
        effects=effects or (),
        beside=[name.strip() for name in beside.split(",")] if beside else (),
        workspace_M_mm=None if box is None else ((box[0], box[1]), (box[2], box[3]), (box[4], box[5])),
        force_N=force,
        temperature_degC=None if heat is None else (heat[0], heat[1]),
        speed_mm_per_s=speed,
        limits=_by_column(limit or []),
    )
    if out is None:
        sys.stdout.write(planned.text(shape.value, feed, dwell))
    else:
        planned.write(out, shape.value, feed, dwell)
    typer.echo(f"{planned.summary}\n{planned.instructions}", err=out is None)


def _by_column(texts: list[str]) -> dict[str, tuple[float, float]]:
    """The limits COLUMN=LOW,HIGH by column. Raises CompdError for the first malformed one."""
    from compd.errors import CompdError, Problem

    limits: dict[str, tuple[float, float]] = {}
    for text in texts:
        name, _, numbers = text.partition("=")
        low, high = _numbers(f"--limit {name}", numbers, 2)
        if name in limits:
            raise CompdError(Problem(where=f"--limit {name}", what="is given twice", next_step="leave one out"))
        limits[name] = low, high
    return limits


def _numbers(option: str, text: str, count: int) -> list[float]:
    """The numbers of an option. Raises CompdError unless there are `count`."""
    from compd.errors import CompdError, Problem

    try:
        values = [float(number) for number in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count:
        raise CompdError(
            Problem(
                where=option,
                what="is not understood",
                value=text,
                allowed=f"{count} numbers with commas, low before high",
            )
        )
    return values
