"""`compd recording join`: a reference instrument's export beside the gauges, by time, order, name or distance."""

from __future__ import annotations

from contextlib import ExitStack
from enum import StrEnum
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from compd.cli.export_options import ExportForm, LogForm, echo_taken
from compd.cli.option_groups import with_groups
from compd.cli.options import MachineOption


class ByChoice(StrEnum):
    """Way of matching a row of the export with the gauges."""

    TIME = "time"
    ORDER = "order"
    NAME = "name"
    DISTANCE = "distance"


class FrameChoice(StrEnum):
    """Frame of the instrument's coordinates."""

    MACHINE = "machine"
    INSTRUMENT = "instrument"


class RoleOptions(NamedTuple):
    """Names of the export's columns."""

    time: Annotated[str | None, typer.Option(help="The export's time column; default: by its name.")] = None
    x: Annotated[str | None, typer.Option(help="The export's column of x; default: by its name.")] = None
    y: Annotated[str | None, typer.Option(help="The export's column of y; default: by its name.")] = None
    z: Annotated[str | None, typer.Option(help="The export's column of z; default: by its name.")] = None
    length: Annotated[str | None, typer.Option(help="The export's column of a length; default: by its name.")] = None
    visit: Annotated[
        str | None,
        typer.Option(help="The export's column that tells visits apart: rows with one text in it are repeats."),
    ] = None
    reflector: Annotated[
        str | None, typer.Option(help="The export's column of the reflectors' names; default: by its name.")
    ] = None


@with_groups
def join(
    gauges: Annotated[
        Path,
        typer.Argument(
            help="The recording of the gauges, NAME.csv or NAME.parquet with NAME.yaml; or the machine's own log, a "
            "workbook or text, with --machine and --log."
        ),
    ],
    export: Annotated[Path, typer.Argument(help="The instrument's export, in a format that --as names.")],
    out: Annotated[
        Path, typer.Argument(help="The recording to write: NAME.csv or NAME.parquet, and NAME.yaml beside it.")
    ],
    roles: RoleOptions = RoleOptions(),
    link: Annotated[int | None, typer.Option(help="For a length: its link, 1 to 6.")] = None,
    ball: Annotated[
        int | None,
        typer.Option(
            min=1, help="For a length, of a ballbar or a tracer: the fixed ball from which it goes to the tip."
        ),
    ] = None,
    reflector_place: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=X,Y,Z",
            help="Of several reflectors: where one is, from the tip along the axes of {P}, mm. Once for each.",
        ),
    ] = None,
    form: ExportForm = ExportForm(),
    offset: Annotated[
        float | None,
        typer.Option(help="Recording time minus instrument time, in s; default: estimated from the motion."),
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
    moving: Annotated[bool, typer.Option("--moving", help="Take rows in motion as well as dwells.")] = False,
    by: Annotated[
        ByChoice | None,
        typer.Option(help="Match rows by one clock; points at rest by their order, their names, or distances alone."),
    ] = None,
    machine: MachineOption = None,
    log: Annotated[
        list[str] | None,
        typer.Option(
            "--log",
            metavar="COLUMN=NAME[:UNIT]",
            help='Of the machine\'s own log: a column and what it is in a recording, "X [mm]=commanded_x_mm". May be '
            "repeated.",
        ),
    ] = None,
    log_form: LogForm = LogForm(),
    plan: Annotated[
        Path | None, typer.Option(help="With --by name: the measured plan; its row k is the point P00k.")
    ] = None,
) -> None:
    """Join an instrument's export and a recording: on one clock with an estimated offset, or point by point."""
    from compd.configuration import load_machine
    from compd.instruments import read_export
    from compd.joining import (
        Instrument,
        JoinOptions,
        LogOptions,
        choose_by,
        is_machine_log,
        log_as_recording,
        machine_recording,
        match_export,
        reflector_places,
        summary_lines,
        unfit_option,
    )
    from compd.recording import write_recording

    read_as, log_read = form.read_as(roles._asdict()), log_form.read_as
    exported = read_export(export, read_as)
    echo_taken(export, exported.shape, exported.taken, exported.left_out)
    places = reflector_places(reflector_place or ())
    instrument = Instrument(frame.value, sigma_um, link, sigma_urad, ball, places)
    options = JoinOptions(instrument, by.value if by else None, offset, moving, machine, plan)
    chosen = choose_by(options.by, exported)
    if option := unfit_option(chosen, options):
        raise typer.BadParameter(f"contradicts --by {chosen}", param_hint=option)
    with ExitStack() as written:
        if log or is_machine_log(gauges):
            if machine is None:
                what = f"{gauges} has no sidecar, so it is a machine's own log, which needs --machine"
                raise typer.BadParameter(what)
            recorded = machine_recording(out)
            as_said = LogOptions(tuple(log or ()), log_read)
            read = written.enter_context(log_as_recording(gauges, recorded, load_machine(machine), as_said))
            echo_taken(gauges, read.shape, read.taken, read.left_out)
            typer.echo(f"{gauges}: the machine's own log, as a recording: {recorded}")
            gauges = recorded
        joined = match_export(gauges, exported, options)
        write_recording(out, joined.columns, joined.sidecar)
    for line in summary_lines(joined):
        typer.echo(line)
    typer.echo(f"written: {out} and {out.with_suffix('.yaml')}")
