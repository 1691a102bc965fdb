"""`compd join`: a reference instrument's export beside the gauges, by time, order, name or distance."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from compd.cli.export_options import (
    AngleUnitOption,
    ColumnsOption,
    DatesOption,
    DecimalOption,
    GroupOption,
    RateOption,
    ShapeOption,
    SheetOption,
    UnitOption,
)
from compd.cli.join_at_rest import ByChoice
from compd.cli.options import MachineOption


class FrameChoice(StrEnum):
    """Whose coordinates the instrument gives."""

    MACHINE = "machine"
    INSTRUMENT = "instrument"


def join(
    gauges: Annotated[Path, typer.Argument(help="The recording of the gauges, NAME.csv with NAME.yaml.")],
    export: Annotated[Path, typer.Argument(help="The instrument's export: text, SpatialAnalyzer, CARTO or Excel.")],
    out: Annotated[Path, typer.Argument(help="The recording to write: NAME.csv, and NAME.yaml beside it.")],
    time: Annotated[str | None, typer.Option(help="The export's time column; guessed from its name.")] = None,
    x: Annotated[str | None, typer.Option(help="The export's column of x; guessed from its name.")] = None,
    y: Annotated[str | None, typer.Option(help="The export's column of y; guessed from its name.")] = None,
    z: Annotated[str | None, typer.Option(help="The export's column of z; guessed from its name.")] = None,
    length: Annotated[str | None, typer.Option(help="The export's column of a length; guessed from its name.")] = None,
    link: Annotated[int | None, typer.Option(help="For a length: the link that it measures, 1 to 6.")] = None,
    ball: Annotated[
        int | None,
        typer.Option(
            min=1, help="For a length, of a ballbar or a tracer: the fixed ball from which it goes to the tip."
        ),
    ] = None,
    shape: ShapeOption = None,
    columns: ColumnsOption = None,
    unit: UnitOption = None,
    angle_unit: AngleUnitOption = None,
    decimal: DecimalOption = None,
    dates: DatesOption = None,
    rate_hz: RateOption = None,
    group: GroupOption = None,
    sheet: SheetOption = None,
    offset: Annotated[
        float | None,
        typer.Option(help="Recording time minus instrument time, in s; estimated from the motion if left out."),
    ] = None,
    frame: Annotated[
        FrameChoice, typer.Option(help="Frame of the coordinates: {M}, or the instrument's own, which is then fitted.")
    ] = FrameChoice.INSTRUMENT,
    sigma_um: Annotated[float | None, typer.Option(help="Standard uncertainty of the instrument per axis, um.")] = None,
    sigma_urad: Annotated[
        float | None,
        typer.Option(
            help="Standard uncertainty of an attitude about each axis, urad; without it, it is only compared."
        ),
    ] = None,
    moving: Annotated[bool, typer.Option("--moving", help="Take rows in motion too, not dwells alone.")] = False,
    by: Annotated[
        ByChoice | None,
        typer.Option(
            help="Put rows together by one clock; points at rest by their order, their names, or distances alone."
        ),
    ] = None,
    machine: MachineOption = None,
    plan: Annotated[
        Path | None, typer.Option(help="With --by name: the plan that was measured; its row k is the point P00k.")
    ] = None,
) -> None:
    """Put an instrument's export beside a recording: on one clock, whose offset is estimated, or point by point."""
    from compd.cli.export_options import echo_taken, read_options
    from compd.cli.join_at_rest import check_options, choose_by, join_points
    from compd.instruments.read import read_export
    from compd.instruments.track import track_of
    from compd.joining.by_time import Instrument, join_reference
    from compd.recording.reader import read_recording

    roles = {"time": time, "x": x, "y": y, "z": z, "length": length}
    options = read_options(shape, columns, roles, unit, angle_unit, decimal, dates, rate_hz, group, sheet)
    exported = read_export(export, options)
    echo_taken(export, exported.shape, exported.taken, exported.left_out)
    instrument = Instrument(frame.value, sigma_um, link, sigma_urad, ball)
    chosen = choose_by(by, exported)
    check_options(chosen, offset, moving, plan)
    if chosen != ByChoice.TIME:
        join_points(gauges, exported, out, instrument, chosen, machine, plan)
        return
    recording = read_recording(gauges, needs_reference=False)
    track = track_of(exported)
    joined = join_reference(recording, track, out, instrument, offset, moving)
    clock = joined.offset
    if math.isnan(clock.std_s):
        agreement = "not known" if math.isnan(clock.agreement) else f"{clock.agreement:.4f}"
        typer.echo(f"clock offset {clock.offset_s:+.4f} s, given; agreement with the scales {agreement}")
    else:
        typer.echo(
            f"clock offset {clock.offset_s:+.4f} s +- {clock.std_s:.4f} s (one standard uncertainty); "
            f"agreement with the scales {clock.agreement:.4f}"
            + (f", next best {clock.runner_up[1]:.4f} at {clock.runner_up[0]:+.2f} s" if clock.runner_up else "")
        )
    typer.echo(
        f"{joined.matched} of {recording.rows} rows have a reference now (still within {joined.still_mm * 1e3:.1f} um)"
    )
    for reason, count in joined.left_out.items():
        typer.echo(f"    {count} rows without: {reason}")
    typer.echo(f"written: {joined.path} and {joined.path.with_suffix('.yaml')}")
