"""Joins a recording of gauges and an instrument's export by the options of `compd recording join`."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from compd.comparison import read_with_machine
from compd.configuration import load_machine
from compd.errors import RecordingError
from compd.instruments import InstrumentExport, track_of
from compd.joining.assignment import REPEAT_MM
from compd.joining.at_rest import RestJoin, match_at_rest
from compd.joining.by_time import Instrument, JoinResult, match_by_time
from compd.joining.reflectors import of_points_at_rest
from compd.recording import Recording, read_recording

JoinBy = Literal["time", "order", "name", "distance"]
JOIN_BY: tuple[JoinBy, ...] = get_args(JoinBy)
# Samples further apart in time (s) and place are single points, no track of a target.
_TRACK_PERIOD_S = 1.0


@dataclass(frozen=True)
class JoinOptions:
    """A person's options for a join."""

    instrument: Instrument = field(default_factory=Instrument)  #: what gave the reference
    by: JoinBy | None = None  #: what puts rows together; None: the time, of a track in time
    offset_s: float | None = None  #: recording time minus instrument time, with "time"; None: estimated from the motion
    moving: bool = False  #: with "time": rows in motion too
    #: the configuration of the machine, which the joined recording then names; None: the one that the recording names
    machine: Path | None = None
    plan: Path | None = None  #: with "name": the plan that was measured


def choose_by(by: JoinBy | None, export: InstrumentExport) -> JoinBy:
    """The chosen way of joining; by default the time, for an export that is a track in time.

    Raises RecordingError if that is not clear: an export without times, or of single points.
    """
    if by is not None:
        return by
    names = "" if export.name is None else ", or --by name: the points' names are those of the recording or of a plan"
    next_step = (
        f"say --by order: the points were measured in the order of the dwells{names}"
        "; or --by distance: in any order, each place once"
    )
    if export.time_s is None:
        raise RecordingError.of(str(export.path), "has no times, so it cannot be joined by time", next_step=next_step)
    if len(export.values) > 1:
        steps_mm = np.linalg.norm(np.diff(export.values[:, :3], axis=0), axis=1)
        if np.median(np.abs(np.diff(export.time_s))) >= _TRACK_PERIOD_S and np.median(steps_mm) > REPEAT_MM:
            raise RecordingError.of(
                str(export.path),
                "has times, but most of its rows are points by themselves, and no track in time",
                next_step=f"{next_step}; or --by time",
            )
    return "time"


def unfit_option(by: JoinBy, options: JoinOptions) -> str:
    """The option that contradicts the way of joining, as on the command line; "" if there is none."""
    if by != "time" and options.moving:
        return "--moving"
    if by != "time" and options.offset_s is not None:
        return "--offset"
    return "--plan" if by != "name" and options.plan is not None else ""


def match_export(gauges: Path, export: InstrumentExport, options: JoinOptions) -> JoinResult | RestJoin:
    """The result of `compd recording join` before it is written.

    gauges : a recording of gauges alone, NAME.csv or NAME.parquet.
    Raises RecordingError with every reason why the two cannot be told to belong together, or an option is not fit.
    """
    by = choose_by(options.by, export)
    if option := unfit_option(by, options):
        raise RecordingError.of(option, f"contradicts --by {by}", next_step="leave it out")
    if by == "time" and (problems := of_points_at_rest(export, options.instrument.reflectors)):
        raise RecordingError(problems)
    if by == "time":
        configuration = None if options.machine is None else load_machine(options.machine)
        recording = _of_machine(read_recording(gauges, configuration, needs_reference=False), options.machine)
        return match_by_time(recording, track_of(export), options.instrument, options.offset_s, options.moving)
    recording, configuration = read_with_machine(gauges, options.machine, needs_reference=False)
    recording = _of_machine(recording, options.machine)
    return match_at_rest(recording, configuration, export, options.instrument, by, options.plan)


def _of_machine(recording: Recording, machine: Path | None) -> Recording:
    """The recording with the stated configuration, if any, as that of its machine."""
    if machine is None:
        return recording
    return replace(recording, sidecar=replace(recording.sidecar, machine_file=machine))
