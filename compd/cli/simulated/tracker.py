"""`compd tracker`: the simulated machine's laser tracker writes its export, and looks over the daemon's shoulder."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Annotated

import typer

from compd.cli.options import OverwriteOption
from compd.units import UM_PER_MM

_ANSWER_TIMEOUT_S = 15.0
# So long at rest, every gauge has been read anew.
_REST_S = 0.5


def tracker(
    simulation: Annotated[Path, typer.Argument(help="The directory that `compd simulate` runs in.")],
    out: Annotated[Path, typer.Option(help="The export, a CSV for `compd join`.")],
    seconds: Annotated[float | None, typer.Option(min=1, help="End after so long; otherwise at Ctrl-C.")] = None,
    rate_hz: Annotated[float, typer.Option(min=1, max=50, help="Measurements per second.")] = 20.0,
    overwrite: OverwriteOption = False,
) -> None:
    """Let the simulated laser tracker look at the tip, and say how far the daemon's tip is from it at rest.

    Its clock begins at 0, as a real one's does: `compd join` finds the offset from the motion.
    """
    import numpy as np

    from compd.cli.progress import ElapsedShown
    from compd.cli.waiting import connect_patiently
    from compd.client import connect
    from compd.clock import MonotonicClock
    from compd.errors import CompdError, Problem
    from compd.output_file import check_replaceable
    from compd.simulation.wires.control_client import ControlClient

    if not out.parent.is_dir():
        raise CompdError(
            Problem(where=str(out), what="its directory does not exist", value=str(out.parent), next_step="make it")
        )
    check_replaceable(out, (), "an export", overwrite)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    looks: list[list[float]] = []
    apart_mm, at_rest = [], 0
    with (
        ControlClient(simulation / "control.sock") as machine,
        connect_patiently(str(simulation / "compd.sock"), lambda path: connect(path, _ANSWER_TIMEOUT_S)) as daemon,
        ElapsedShown(seconds, MonotonicClock()) as shown,
    ):
        typer.echo(f"{out}: the tracker looks {rate_hz:g} times a second")
        try:
            for setpoint in shown.show(daemon.watch(rate_hz), lambda: f"{len(looks)} looks"):
                seen = machine.ask("MEASURE")
                looks.append([seen["monotonic_s"], *seen["reference_mm"]])
                at_rest = 0 if seen["moving"] else at_rest + 1
                if at_rest > _REST_S * rate_hz and setpoint["valid"] and seen["tip_frame"] == "M":
                    apart_mm.append(np.subtract(setpoint["tip_M_mm"], seen["reference_mm"]))
                if seconds is not None and seen["monotonic_s"] - looks[0][0] >= seconds:
                    break
        except KeyboardInterrupt:
            pass  # the usual end
    if not looks:
        raise CompdError(
            Problem(where=str(out), what="the tracker has not looked once", next_step="let it look for longer")
        )
    table = np.array(looks)
    table[:, 0] -= table[0, 0]
    lines = [",".join(f"{value:.6f}" for value in row) for row in table]
    out.write_text("\n".join(["time_s,x_mm,y_mm,z_mm", *lines]) + "\n", encoding="utf-8")
    typer.echo(f"{len(looks)} looks in {table[-1, 0]:.0f} s")
    if apart_mm:
        rms_um = float(np.sqrt(np.mean(np.square(apart_mm)))) * UM_PER_MM
        typer.echo(
            f"at rest the daemon's tip and the tracker's differ by {rms_um:.2f} um, rms per coordinate; "
            f"{seen['sigma_um']:g} um of it is the tracker's own noise"
        )
