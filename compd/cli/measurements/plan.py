"""`compd plan`: the measurement that tells two effects apart."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from compd.cli.options import MachineOption


def plan(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="What was measured so far: NAME.csv.")],
    rivals: Annotated[str, typer.Option(help="Two effects, by id: A,B.")],
    rows: Annotated[int, typer.Option(min=2, help="How many rows may be measured.")] = 40,
    out: Annotated[Path | None, typer.Option(help="Where to write the rows (CSV); on the screen if left out.")] = None,
    machine: MachineOption = None,
    model: Annotated[Path | None, typer.Option("--model", help="The model file with what is known already.")] = None,
    workspace: Annotated[
        str | None,
        typer.Option(help="Where the tip may go, in mm: x0,x1,y0,y1,z0,z1; as in the recording if left out."),
    ] = None,
    force: Annotated[
        float | None, typer.Option(min=0, help="Largest load in N; as in the recording if left out.")
    ] = None,
    temperature: Annotated[
        str | None, typer.Option(help="Lowest,highest in degC; as in the recording if left out.")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(min=0, help="Highest speed in mm/s; as in the recording if left out.")
    ] = None,
) -> None:
    """Plan the rows (poses, loads, temperatures, speeds) on which two rival effects differ most."""
    from compd.comparison.compare import compare
    from compd.comparison.open import open_model, open_recording
    from compd.comparison.shape_search import search_constants
    from compd.diagnosis.measurement_programmes import recorded_limits
    from compd.diagnosis.next_measurement import plan_measurement
    from compd.errors import CompdError, Problem
    from compd.model.library import find_effect

    names = [name.strip() for name in rivals.split(",")]
    if len(names) != 2 or names[0] == names[1]:
        raise CompdError(
            Problem(
                where="--rivals",
                what="needs two effects",
                value=rivals,
                allowed="A,B",
                next_step="`compd diagnose` names rivals",
            )
        )
    effects = [find_effect(name, "--rivals") for name in names]
    aligned = open_recording(recording, machine)
    file = open_model(model, aligned)
    present = [fitted.effect.id for fitted in file.fitted if fitted.effect.id in names]
    if present:
        raise CompdError(
            Problem(
                where="--rivals",
                what="is in the model already",
                value=", ".join(present),
                allowed="effects that are not",
                next_step="`compd effect remove` takes it out",
            )
        )
    limits = recorded_limits(aligned)
    if workspace is not None:
        x0, x1, y0, y1, z0, z1 = _numbers("--workspace", workspace, 6)
        low, high = limits.tip_low_M_mm.copy(), limits.tip_high_M_mm.copy()
        low[:], high[:] = (x0, y0, z0), (x1, y1, z1)
        limits = limits._replace(tip_low_M_mm=low, tip_high_M_mm=high)
    if force is not None:
        limits = limits._replace(force_N=force)
    if temperature is not None:
        coldest, warmest = _numbers("--temperature", temperature, 2)
        limits = limits._replace(temperature_degC=(coldest, warmest))
    if speed is not None:
        limits = limits._replace(speed_mm_per_s=speed)
    sigma_um = compare(aligned, file.fitted, file.covariance).floor.by_axis_um
    first, second = (search_constants(aligned, file.fitted, effect, sigma_um).fitted[-1] for effect in effects)
    planned = plan_measurement(aligned, file.fitted, (first, second), sigma_um, limits, rows)
    if out is None:
        planned.write_to(sys.stdout)
    else:
        planned.write(out)
    typer.echo(
        f"{names[0]} and {names[1]} differ by {planned.before:.2g} times the noise on what was measured, by "
        f"{planned.separation:.2g} times with these {len(planned.rows)} rows.",
        err=out is None,
    )


def _numbers(option: str, text: str, count: int) -> list[float]:
    """The numbers of an option, in rising pairs. Raises CompdError where there are not `count`, or a pair falls."""
    from compd.errors import CompdError, Problem

    try:
        values = [float(number) for number in text.split(",")]
    except ValueError:
        values = []
    rising = all(low < high for low, high in zip(values[::2], values[1::2], strict=False))
    if len(values) != count or not rising:
        raise CompdError(
            Problem(
                where=option,
                what="is not understood",
                value=text,
                allowed=f"{count} numbers with commas, low before high",
            )
        )
    return values
