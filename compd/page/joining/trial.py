"""Trial of a join: how many rows match, why others do not, and the data of its picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from compd.arrays import FloatArray
from compd.errors import CompdError, RecordingError
from compd.instruments import InstrumentExport, track_of
from compd.joining import (
    ClockOffset,
    JoinOptions,
    JoinResult,
    RestJoin,
    agreement_curve,
    choose_by,
    match_export,
    summary_lines,
)
from compd.recording import read_recording
from compd.units import UM_PER_MM


def tried(gauges: Path, export: InstrumentExport, options: JoinOptions) -> dict[str, Any]:
    """The result of `match_export` for a browser; no file is written.

    `reason` : why they cannot be put together, "" if they can. `lines` : what the command prints. `by` : what puts
    the rows together, "" if that is not clear. `time` : curve and offset. `rest` : each point with its dwell.
    """
    answer: dict[str, Any] = {"reason": "", "lines": [], "by": "", "time": None, "rest": None}
    joined: JoinResult | RestJoin | None = None
    try:
        answer["by"] = choose_by(options.by, export)
        joined = match_export(gauges, export, options)
        answer["lines"] = summary_lines(joined)
    except CompdError as error:
        answer["reason"] = str(error)
    if isinstance(joined, RestJoin):
        answer["rest"] = _rest(joined)
    elif answer["by"] == "time":
        # the picture shows best why no offset is found
        answer["time"] = _time(gauges, export, joined.offset if joined else None)
    return answer


def _time(gauges: Path, export: InstrumentExport, offset: ClockOffset | None) -> dict[str, Any] | None:
    """The agreement over all offsets; None if there is none."""
    try:
        recording, track = read_recording(gauges, needs_reference=False), track_of(export)
        if recording.scale_mm is None:
            return None
        curve = agreement_curve(recording.time_s, recording.scale_mm, track)
    except RecordingError:
        return None
    answer: dict[str, Any] = {
        "offset_s": _numbers(curve.offset_s),
        "agreement": _numbers(curve.agreement),
        "window_s": curve.window_s,
    }
    if offset is not None:
        answer["peak"] = [offset.offset_s, offset.agreement]
        answer["next_best"] = None if offset.runner_up is None else list(offset.runner_up)
    return answer


def _rest(joined: RestJoin) -> dict[str, Any]:
    return {
        "line": joined.line.tolist(),
        "dwell_number": joined.dwell_number.tolist(),
        "residual_um": _numbers(joined.residual_mm * UM_PER_MM),
        "dwells": len(joined.dwells),
    }


def _numbers(values: FloatArray) -> list[float]:
    return [float(value) for value in values]
