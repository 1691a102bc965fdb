"""`compd calibrate`: from the drawing of a machine and measured poses to the machine as built."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from compd.cli.option_groups import PageOptions, with_groups
from compd.cli.options import HoldOption, JsonOption, MachineOption, RangesOption

if TYPE_CHECKING:
    from rich.console import Console

    from compd.calibration import Calibration
    from compd.comparison import AlignedRecording


@with_groups
def calibrate(
    recordings: Annotated[
        list[Path],
        typer.Argument(metavar="RECORDING...", help="NAME.csv or NAME.parquet: poses at rest to learn from."),
    ],
    machine: MachineOption = None,
    sealed: Annotated[
        list[Path] | None,
        typer.Option(metavar="RECORDING", help="A recording that is looked at last. May be repeated."),
    ] = None,
    check: Annotated[
        Path | None,
        typer.Option(
            metavar="RECORDING",
            help="Poses of another day: whether the calibration still holds there, and which numbers have changed.",
        ),
    ] = None,
    ranges: RangesOption = None,
    hold: HoldOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="The machine as built: the configuration with the numbers found, NAME.yaml, and NAME-model.yaml with "
            "what no drawing states, such as gains.",
        ),
    ] = None,
    page: PageOptions = PageOptions(),
    as_json: JsonOption = False,
) -> None:
    """Learn how the machine is built: joints, lengths, zeros, gains, from its drawing and measured poses.

    Poses that are left out, at random and by whole regions, decide which numbers are taken.
    """
    from rich.console import Console

    from compd.calibration import calibrate as calibrate_aligned
    from compd.calibration import check_calibration
    from compd.cli.progress import steps_shown
    from compd.comparison import open_recording

    page.check()
    if out is not None:
        from compd.built_machine import BUILT_MARK
        from compd.files import check_directory, check_replaceable

        if out.suffix not in (".yaml", ".yml"):
            raise typer.BadParameter(f"{out} is no configuration: NAME.yaml", param_hint="--out")
        check_directory(out)
        check_replaceable(out, (BUILT_MARK,), "a machine as built", page.overwrite)

    def opened(path: Path, stated: list[str] | None = None) -> AlignedRecording:
        return open_recording(path, machine, ranges=stated or (), hold=hold or ())

    learned = [opened(path, ranges) for path in recordings]
    last = [opened(path) for path in sealed or ()]
    later = None if check is None else opened(check)
    with steps_shown(quiet=as_json) as progress:
        calibration = calibrate_aligned(learned, last, progress)
        checked = None if later is None else check_calibration(calibration, learned, later)
    if out is not None:
        from compd.api import write_built_machine

        built = write_built_machine(calibration, learned, out, machine)
    if page.html is not None:
        from compd.report import write_calibration_page

        write_calibration_page(page.html, calibration, "" if out is None else str(out))
    if as_json:
        data = {**calibration.as_json(), **({} if checked is None else {"check": checked.as_json()})}
        typer.echo(json.dumps(data, indent=1, allow_nan=False))
        return
    console = Console(highlight=False)
    _print(console, calibration)
    if checked is not None:
        console.print(checked.verdict)
        for change in checked.changes:
            console.print(f"  {change.element}: {change.change:+.4g} +- {change.std:.2g} {change.unit}")
    if out is not None:
        beside = f", with {built.model} for what no drawing states" if built.model else ""
        console.print(f"{built.machine}: the machine as built, {len(built.geometry.numbers)} numbers{beside}")


def _print(console: Console, calibration: Calibration) -> None:
    from rich.table import Table

    console.print(calibration.verdict)
    for warning in calibration.warnings:
        console.print(f"warning: {warning}")
    errors = Table("poses", "rows", "as drawn (um)", "calibrated (um)")
    for one in (*calibration.learned, *calibration.held_out, *calibration.sealed):
        errors.add_row(one.what, str(len(one.rows)), f"{one.before_rms_um:.3g}", f"{one.after_rms_um:.3g}")
    console.print(errors)
    blocks = Table("numbers", "needed", "held-out error without", "with", "why")
    for block in calibration.blocks:
        blocks.add_row(
            block.words, "yes" if block.needed else "no", f"{block.without:.3g}", f"{block.with_it:.3g}", block.why
        )
    console.print(blocks)
    numbers = Table("number", "drawing", "as built", "standard error", "unit", "")
    for number in calibration.numbers:
        if number.needed or number.claimed:
            held = "held: told less than twice as well as by the tolerance" if number.held else ""
            digits = f"{number.value:.5g}" if number.unit != "mm" else f"{number.value:.4f}"
            numbers.add_row(number.element, f"{number.drawing:.6g}", digits, f"{number.std:.2g}", number.unit, held)
    console.print(numbers)
    if calibration.held:
        console.print("These poses do not tell, and the drawing holds:")
    remedies: dict[str, list[str]] = {}
    for combination in calibration.held:
        remedies.setdefault(combination.remedy, []).append(combination.words)
    for remedy, words in remedies.items():
        console.print(f"  {'; '.join(words)}. To tell it: {remedy}.")
    if calibration.prediction is not None:
        console.print(calibration.prediction.words)
    for pose in calibration.gross:
        console.print(f"left out: {pose.recording} row {pose.row}, {pose.error_mm:.3g} mm off")
    if calibration.diagnose_next:
        console.print(
            f"What is left is {calibration.left_over**0.5:.3g} times the noise: `compd diagnose` looks for its cause."
        )
