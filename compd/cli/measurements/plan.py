"""`compd plan`: plan the measurement that distinguishes two effects, or the poses of a calibration."""

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
        Path | None,
        typer.Argument(
            metavar="RECORDING",
            help="The recording so far: NAME.csv or NAME.parquet; with --calibrate it may be left out.",
            show_default=False,
        ),
    ] = None,
    rivals: Annotated[str | None, typer.Option(help="Two effects or more, by id: A,B,C.")] = None,
    calibrate: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="In place of rivals: N poses that tell most of how the machine is built, for `compd calibrate`.",
        ),
    ] = None,
    noise: Annotated[
        str | None,
        typer.Option(
            metavar="UM[,URAD]",
            help="With --calibrate: standard deviation of the instrument, um of a position; of whole poses urad of the "
            "attitude as well.",
        ),
    ] = None,
    rows: Annotated[int, typer.Option(min=2, help="Number of rows to measure.")] = 40,
    out: Annotated[Path | None, typer.Option(help="File for the rows (CSV); default: the screen.")] = None,
    machine: MachineOption = None,
    model: Annotated[Path | None, typer.Option(help="The model file with the known effects.")] = None,
    effects: EffectsOption = None,
    beside: Annotated[
        str | None, typer.Option(help="Other effects found outside the model, by id: C,D. They are fitted along.")
    ] = None,
    workspace: Annotated[
        str | None, typer.Option(help="Workspace of the tip in mm: x0,x1,y0,y1,z0,z1; default: as in the recording.")
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
            help="plan (CSV for `compd sim run --plan`); targets for the instrument: sa (SpatialAnalyzer), csv; gcode "
            "for the controller.",
        ),
    ] = PlanShape.plan,
    feed: Annotated[float | None, typer.Option(min=0.1, help="For gcode: feed between the places, mm/min.")] = None,
    dwell: Annotated[float, typer.Option(min=0, help="For gcode: dwell at each place, s.")] = 3.0,
    overwrite: OverwriteOption = False,
) -> None:
    """Plan the rows (poses, loads, temperatures, speeds, other settings) on which rival effects differ most.

    Of three rivals or more, those that no rows within the limits tell apart are named.

    With --calibrate, plan the poses that tell most of how the machine is built, and say what they are worth.
    """
    from compd.api import plan_calibration, plan_measurement
    from compd.comparison import open_recording
    from compd.files import check_replaceable
    from compd.plan_file import PURPOSE_COLUMN
    from compd.planning import MARKS

    if (rivals is None) == (calibrate is None):
        raise typer.BadParameter("give --rivals A,B or --calibrate N, one of the two")
    if out is not None:
        mark = f"{PURPOSE_COLUMN},".encode() if shape is PlanShape.plan else MARKS[shape.value]
        check_replaceable(out, (mark,), "a plan", overwrite)
    box = None if workspace is None else _numbers("--workspace", workspace, 6)
    corners = None if box is None else ((box[0], box[1]), (box[2], box[3]), (box[4], box[5]))
    if calibrate is not None:
        aligned = None if recording is None else open_recording(recording, machine)
        if aligned is None and machine is None:
            raise typer.BadParameter("--calibrate needs --machine, or a recording")
        if noise is None:
            raise typer.BadParameter("--calibrate needs --noise UM of the instrument, or UM,URAD of one for poses")
        both = _numbers("--noise", noise, noise.count(",") + 1)
        poses = plan_calibration(
            str(aligned.recording.machine if machine is None and aligned is not None else machine),
            calibrate,
            both[0],
            noise_urad=both[1] if len(both) > 1 else None,
            workspace_M_mm=corners,
            measured=() if aligned is None else (aligned,),
        )
        if out is None:
            sys.stdout.write(poses.text(shape.value, feed, dwell))
        else:
            poses.write(out, shape.value, feed, dwell)
        typer.echo(poses.summary, err=out is None)
        return
    if recording is None or rivals is None:
        raise typer.BadParameter("--rivals needs a recording")
    heat = None if temperature is None else _numbers("--temperature", temperature, 2)
    planned = plan_measurement(
        open_recording(recording, machine),
        [name.strip() for name in rivals.split(",")],
        rows=rows,
        model=model,
        effects=effects or (),
        beside=[name.strip() for name in beside.split(",")] if beside else (),
        workspace_M_mm=corners,
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
    from compd.errors import CompdError

    limits: dict[str, tuple[float, float]] = {}
    for text in texts:
        name, _, numbers = text.partition("=")
        low, high = _numbers(f"--limit {name}", numbers, 2)
        if name in limits:
            raise CompdError.of(f"--limit {name}", "is given twice", next_step="leave one out")
        limits[name] = low, high
    return limits


def _numbers(option: str, text: str, count: int) -> list[float]:
    """The numbers of an option. Raises CompdError unless there are `count`."""
    from compd.errors import CompdError

    try:
        values = [float(number) for number in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count:
        raise CompdError.of(
            option,
            "is not understood",
            value=text,
            allowed="a number" if count == 1 else f"{count} numbers with commas, low before high",
        )
    return values
