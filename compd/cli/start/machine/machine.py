"""`compd machine`: a configuration from a few dimensions, and a drawing of a configuration."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal, NamedTuple, TypeAlias

import typer

from compd.cli.option_groups import with_groups
from compd.cli.options import OverwriteOption

machine = typer.Typer()

Kind: TypeAlias = Literal["6-ups", "6-pus", "6-rus", "3-spr", "3-rps", "3-prs", "linear-delta", "rotary-delta"]
Tolerance: TypeAlias = Literal["ground", "measured", "machined", "printed", "hand-built"]


class DimensionOptions(NamedTuple):
    """Dimensions of a machine, by the names of `compd.machine_kinds`."""

    base_radius_mm: Annotated[
        float | None, typer.Option("--base-radius", help="Of the circle of the base joints, mm.")
    ] = None
    platform_radius_mm: Annotated[
        float | None, typer.Option("--platform-radius", help="Of the circle of the platform joints, mm.")
    ] = None
    height_mm: Annotated[
        float | None,
        typer.Option(
            "--height",
            help="Of the platform joints above the base joints at machine zero, mm; negative where the platform hangs.",
        ),
    ] = None
    base_angle_deg: Annotated[
        float | None, typer.Option("--base-angle", help="Six legs: between the two base joints of a pair, degrees.")
    ] = None
    platform_angle_deg: Annotated[
        float | None,
        typer.Option("--platform-angle", help="Six legs: between the two platform joints of a pair, degrees."),
    ] = None
    spacing_mm: Annotated[
        float | None, typer.Option("--spacing", help="Deltas: between the two rods of an arm, mm.")
    ] = None
    crank_mm: Annotated[float | None, typer.Option("--crank", help="6-rus, rotary-delta: of a crank, mm.")] = None
    tool_mm: Annotated[float | None, typer.Option("--tool", help="Of the tip beyond the platform joints, mm.")] = None


@machine.command()
@with_groups
def new(
    kind: Annotated[
        Kind,
        typer.Option(
            help="6-ups: six legs that extend; 6-pus: six rods on rails; 6-rus: six cranks with rods; 3-spr, 3-rps: "
            "three legs that extend, hinged at the platform or at the base; 3-prs: three rods on rails; linear-delta, "
            "rotary-delta: three carriages or cranks with two rods each.",
        ),
    ],
    out: Annotated[Path | None, typer.Option(help="Write the file; left out, the text is printed.")] = None,
    name: Annotated[str | None, typer.Option(help="Of the machine; left out, that of the file.")] = None,
    given: DimensionOptions = DimensionOptions(),
    tolerance: Annotated[
        Tolerance, typer.Option(help="How the machine is made: what is plausible of its geometry follows.")
    ] = "machined",
    overwrite: OverwriteOption = False,
) -> None:
    """Write the configuration of a machine of a kind, from a few dimensions, in at most 60 lines.

    Dimensions that are left out have usual values. The scales are read over Modbus TCP: put in your own gauges.
    """
    from compd.machine_kinds import KINDS, machine_text

    stated = {key: value for key, value in given._asdict().items() if value is not None}
    dimensions = KINDS[kind].usual._replace(**stated)
    own_name = name or (out.stem if out is not None else kind)
    text = machine_text(own_name, kind, dimensions, tolerance)
    if out is None:
        typer.echo(text, nl=False)
        return
    _check_free(out, overwrite)
    out.write_text(text, encoding="utf-8")
    typer.echo(f"{out}: a {kind}. Next: `compd machine draw {out}`, `compd check {out}`")


@machine.command()
def draw(
    config: Annotated[Path, typer.Argument(help="The machine's configuration (YAML).")],
    out: Annotated[
        Path | None, typer.Option(help="The picture, SVG; left out, the configuration's name with .svg.")
    ] = None,
    overwrite: OverwriteOption = False,
) -> None:
    """Draw a machine at machine zero in three views: joints, rods with their numbers, rails, cranks, hinges, tool."""
    from compd.configuration import load
    from compd.machine_builder import build_model
    from compd.report import machine_svg

    out = config.with_suffix(".svg") if out is None else out
    if out.suffix != ".svg":
        raise typer.BadParameter(f"{out}: the picture is SVG, so end the name in .svg")
    if out.exists() and not overwrite and not out.read_text(encoding="utf-8", errors="replace").startswith("<svg"):
        raise typer.BadParameter(f"{out} exists and is no picture: give --overwrite to replace it")
    configuration = load(config)
    if configuration.external is not None:
        raise typer.BadParameter(f"{config}: compd knows no joints of `machine: external`, so there is nothing to draw")
    model = build_model(configuration.geometry, configuration.wiring)
    out.write_text(machine_svg(model, configuration.machine), encoding="utf-8")
    typer.echo(f"{out}: {configuration.machine} at machine zero")


class Export(StrEnum):
    """What reads the numbers of a machine."""

    csv = "csv"
    klipper = "klipper"
    reprapfirmware = "reprapfirmware"
    linuxcnc = "linuxcnc"


@machine.command()
def export(
    config: Annotated[Path, typer.Argument(help="The machine's configuration (YAML).")],
    shape: Annotated[
        Export,
        typer.Option(
            "--as",
            help="csv: joints, zeros, directions and gains of any machine; settings of a linear delta: klipper, "
            "reprapfirmware, linuxcnc.",
        ),
    ] = Export.csv,
    model_file: Annotated[
        Path | None,
        typer.Option(
            "--model", help="The model file with its effects; left out, the one of `state: model_file`, if any."
        ),
    ] = None,
    bed_M_mm: Annotated[float, typer.Option("--bed", help="Deltas: height of the controller's z 0 in {M}, mm.")] = 0.0,
    endstops: Annotated[str, typer.Option(help="Deltas: readings of scales 1, 2, 3 at the endstops, mm.")] = "0,0,0",
    out: Annotated[Path | None, typer.Option(help="Write the file; left out, the text is printed.")] = None,
    overwrite: OverwriteOption = False,
) -> None:
    """Write a machine's numbers for other programs: a table of all, or the settings of a delta's controller.

    What a controller's settings cannot hold, such as two rods of a pair that differ, is said as the error that it costs
    at the tip.
    """
    from compd import open_model
    from compd.built_machine import FORMS, delta_settings, numbers_text, settings_text
    from compd.configuration import load
    from compd.machine_builder import build_model

    configuration = load(config)
    if configuration.external is not None:
        raise typer.BadParameter(f"{config}: compd knows no joints of `machine: external`")
    stated = configuration.state.model_file
    effects_in = model_file or (Path(stated) if stated else None)
    effects = open_model(effects_in, configuration).fitted if effects_in else ()
    if shape is Export.csv:
        text = numbers_text(configuration, effects)
    else:
        model = replace(build_model(configuration.geometry, configuration.wiring), effects=effects)
        settings = delta_settings(model, FORMS[shape.value], bed_M_mm, _three(endstops))
        text = settings_text(shape.value, settings, configuration.machine)
    if out is None:
        typer.echo(text, nl=False)
        return
    _check_free(out, overwrite)
    out.write_text(text, encoding="utf-8")
    typer.echo(f"{out}: {configuration.machine} for {shape.value}")


def _check_free(out: Path, overwrite: bool) -> None:
    from compd.files import check_directory

    check_directory(out)
    if out.exists() and not overwrite:
        raise typer.BadParameter(f"{out} exists: give --overwrite to replace it")


def _three(text: str) -> tuple[float, float, float]:
    try:
        first, second, third = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(
            f"{text}: three numbers in mm, with commas between them", param_hint="--endstops"
        ) from None
    return first, second, third
