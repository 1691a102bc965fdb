"""`compd sim tracker`: write the export of the simulated laser tracker, and check the daemon's tip against it."""

from __future__ import annotations

import signal
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from compd.cli.options import OverwriteOption
from compd.cli.paths import PathKind
from compd.instruments import LENGTH_AXES, POSITION_AXES, written_forms
from compd.units import UM_PER_MM

if TYPE_CHECKING:
    from compd.instruments import WrittenForm
    from compd.simulation import Looks

    class ExportFormat(StrEnum):
        """In which form the export is written."""

else:
    ExportFormat = StrEnum("ExportFormat", {name: name for name in written_forms()})

_CSV = ExportFormat("csv")
_ANSWER_TIMEOUT_S = 15.0
# Rest (s) after which every gauge has been read again.
_REST_S = 0.5


def tracker(
    simulation: Annotated[Path, typer.Argument(help="The directory that `compd sim run` runs in."), PathKind.FOLDER],
    out: Annotated[Path, typer.Option(help="The export, for `compd recording join`.")],
    seconds: Annotated[
        float | None, typer.Option(min=1, help="End after this many seconds; default: at Ctrl-C.")
    ] = None,
    rate_hz: Annotated[float, typer.Option(min=1, max=50, help="Measurements per second.")] = 20.0,
    shape: Annotated[
        ExportFormat,
        typer.Option(
            "--as",
            help="Form of the export: "
            + "; ".join(f"{form.name}: {form.summary}" for form in written_forms().values())
            + ".",
        ),
    ] = _CSV,
    link: Annotated[
        int | None, typer.Option(min=1, max=6, help="An interferometer along this link, in place of the tracker.")
    ] = None,
    points: Annotated[
        bool, typer.Option("--points", help="One row per dwell, named P1, P2 ..., without a time.")
    ] = False,
    unit: Annotated[str, typer.Option(help="Unit of the lengths in the export.")] = "mm",
    overwrite: OverwriteOption = False,
) -> None:
    """Let the simulated laser tracker measure the tip, and print the distance of the daemon's tip from it at rest.

    Its clock begins at 0, as a real one's does: `compd recording join` finds the offset from the motion.
    """
    from datetime import datetime

    from compd.errors import CompdError
    from compd.files import check_replaceable, write_files
    from compd.simulation import Looks

    written = written_forms()[shape.value]
    _check_options(written, link, points, unit)
    if not out.parent.is_dir():
        raise CompdError.of(str(out), "its directory does not exist", value=str(out.parent), next_step="make it")
    check_replaceable(out, (), "an export", overwrite)
    looks = Looks(link)
    start = datetime.now()
    compared = _look(simulation, out, looks, seconds, rate_hz)
    if points:
        samples = looks.points(unit)
    else:
        samples = looks.at_rate(rate_hz, unit, start) if written.constant_rate else looks.track(unit, start)
    if not len(samples.values):
        raise CompdError.of(str(out), "the machine has not rested once", next_step="let the tracker look for longer")
    write_files({out: written.write(samples)})
    typer.echo(f"{len(looks)} looks in {looks.seconds:.0f} s" + (f", {len(samples.values)} points" if points else ""))
    if hint := _for_join(written, link, points, unit, rate_hz):
        typer.echo(f"the file does not say it, so give `compd recording join`: {hint}")
    if compared:
        typer.echo(compared)


def _check_options(written: WrittenForm, link: int | None, points: bool, unit: str) -> None:
    """Raise CompdError for a form that cannot hold what is to be written, or for no unit."""
    from compd.errors import CompdError, Problem
    from compd.units import UNIT_KINDS

    problems = []
    if unit not in UNIT_KINDS[0]:
        problems.append(Problem("--unit", "is no unit of a length", value=unit, allowed=", ".join(UNIT_KINDS[0])))
    where = f"--as {written.name}"
    if link is None and POSITION_AXES not in written.axes:
        problems.append(Problem(where, "is one length", next_step="name the link: --link 1"))
    if points and not written.holds_points:
        problems.append(Problem(where, "is a track", next_step="leave --points out"))
    if link is not None and LENGTH_AXES not in written.axes:
        others = " or ".join(form.name for form in written_forms().values() if LENGTH_AXES in form.axes)
        step = f"leave --link out, or choose --as {others}"
        problems.append(Problem(where, "is x, y, z", next_step=step))
    if problems:
        raise CompdError(problems)


def _look(simulation: Path, out: Path, looks: Looks, seconds: float | None, rate_hz: float) -> str:
    """Measure until the time is over; return the distance of the daemon's tip from the tracker's in words."""
    import numpy as np

    from compd.cli.progress import ElapsedShown
    from compd.cli.waiting import connect_patiently
    from compd.client import connect
    from compd.clock import MonotonicClock
    from compd.errors import CompdError
    from compd.simulation import ControlClient

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    apart_mm, at_rest = [], 0
    with (
        ControlClient(simulation / "control.sock") as machine,
        connect_patiently(str(simulation / "compd.sock"), lambda path: connect(path, _ANSWER_TIMEOUT_S)) as daemon,
        ElapsedShown(seconds, MonotonicClock()) as shown,
    ):
        looks.check_links(len(machine.ask("TRUTH")["scale_mm"]))
        typer.echo(f"{out}: the {looks.instrument} looks {rate_hz:g} times a second")
        try:
            for setpoint in shown.show(daemon.watch(rate_hz), lambda: f"{len(looks)} looks"):
                seen = machine.ask("MEASURE")
                looks.add(seen)
                at_rest = 0 if seen["moving"] else at_rest + 1
                if at_rest > _REST_S * rate_hz and setpoint["valid"] and seen["tip_frame"] == "M":
                    apart_mm.append(np.subtract(setpoint["tip_M_mm"], seen["reference_mm"]))
                if seconds is not None and looks.seconds >= seconds:
                    break
        except KeyboardInterrupt:
            pass  # the usual end
    if not len(looks):
        raise CompdError.of(str(out), "the tracker has not looked once", next_step="let it look for longer")
    if not apart_mm:
        return ""
    rms_um = float(np.sqrt(np.mean(np.square(apart_mm)))) * UM_PER_MM
    return (
        f"at rest the daemon's tip and the tracker's differ by {rms_um:.2f} um, rms per coordinate; "
        f"{seen['sigma_um']:g} um of it is the tracker's own noise"
    )


def _for_join(written: WrittenForm, link: int | None, points: bool, unit: str, rate_hz: float) -> str:
    """Options without which `compd recording join` asks, because the file says nothing of it."""
    given = [
        f"--unit {unit}" if not written.says_unit else "",
        f"--rate-hz {rate_hz:g}" if not written.says_rate and not points else "",
        f"--link {link}" if link is not None else "",
    ]
    return " ".join(filter(None, given))
