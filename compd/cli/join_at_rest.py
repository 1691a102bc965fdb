"""What `compd join` does with points at rest: by order, name or distance, and what it says of it."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, cast

import typer

if TYPE_CHECKING:
    from compd.instruments.export import InstrumentExport
    from compd.joining.at_rest import By, RestJoin
    from compd.joining.by_time import Instrument

# Samples further apart in time and place are points, each of its own, and no track of a target.
_TRACK_PERIOD_S = 1.0


class ByChoice(StrEnum):
    """What puts a row of the export beside the gauges."""

    TIME = "time"
    ORDER = "order"
    NAME = "name"
    DISTANCE = "distance"


def choose_by(by: ByChoice | None, export: InstrumentExport) -> ByChoice:
    """What was chosen; without a choice the time, of an export that is a track in time.

    Raises RecordingError where that is not clear: an export without times, or of single points.
    """
    import numpy as np

    from compd.errors import Problem, RecordingError
    from compd.joining.assignment import REPEAT_MM

    if by is not None:
        return by
    names = "" if export.name is None else ", or --by name: the points' names are those of the recording or of a plan"
    next_step = (
        f"say --by order: the points were measured in the order of the dwells{names}"
        "; or --by distance: in any order, each place once"
    )
    if export.time_s is None:
        raise RecordingError(
            Problem(where=str(export.path), what="has no times, so it cannot be joined by time", next_step=next_step)
        )
    if len(export.values) > 1:
        steps_mm = np.linalg.norm(np.diff(export.values[:, :3], axis=0), axis=1)
        if np.median(np.abs(np.diff(export.time_s))) >= _TRACK_PERIOD_S and np.median(steps_mm) > REPEAT_MM:
            raise RecordingError(
                Problem(
                    where=str(export.path),
                    what="has times, but most of its rows are points by themselves, and no track in time",
                    next_step=f"{next_step}; or --by time",
                )
            )
    return ByChoice.TIME


def check_options(by: ByChoice, offset: float | None, moving: bool, plan: Path | None) -> None:
    """Raise typer.BadParameter for an option that does not go with what puts rows together."""
    if by != ByChoice.TIME and (offset is not None or moving):
        raise typer.BadParameter(f"does not go with --by {by}", param_hint="--moving" if moving else "--offset")
    if by != ByChoice.NAME and plan is not None:
        raise typer.BadParameter(f"does not go with --by {by}", param_hint="--plan")


def join_points(
    gauges: Path,
    export: InstrumentExport,
    out: Path,
    instrument: Instrument,
    by: ByChoice,
    machine: Path | None,
    plan: Path | None,
) -> RestJoin:
    """Join the recording `gauges` with points at rest, not by time, and print what was joined."""
    from compd.comparison.open import read_with_machine
    from compd.joining.at_rest import join_at_rest

    recording, configuration = read_with_machine(gauges, machine, needs_reference=False)
    joined = join_at_rest(recording, configuration, export, out, instrument, cast("By", by.value), plan)
    _report(joined)
    return joined


def _report(joined: RestJoin) -> None:
    typer.echo(
        f"joined by {joined.by}: {joined.joined} of {joined.points} points, {len(joined.dwells)} dwells of the machine"
    )
    for line, dwell in (joined.first, joined.last):
        typer.echo(f"    line {line}: {dwell}")
    next_best = ""
    if joined.next_best is not None:
        shift, rms_mm = joined.next_best
        next_best = f"; next best, {shift:+d} dwell{'s' * (abs(shift) != 1)}: {rms_mm:.4g} mm"
    kind = "lengths" if joined.of_lengths else "distances between points"
    typer.echo(f"{kind} agree with the machine's to {joined.rms_mm:.4g} mm rms{next_best}")
    for reason, which in joined.left_out.items():
        typer.echo(f"    left out, {reason}: {which}")
    typer.echo(f"written: {joined.path} and {joined.path.with_suffix('.yaml')}")
