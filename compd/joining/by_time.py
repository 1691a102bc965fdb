"""Joining a recording of gauges and an instrument's export into one recording with a reference, on one clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.errors import Problem, RecordingError
from compd.joining.clock_offset import ClockOffset, estimate_offset, evaluate_offset
from compd.recording.columns import link_reference_column
from compd.recording.instrument_export import LENGTH, Track
from compd.recording.recording import Recording
from compd.recording.reference import Frame
from compd.recording.sidecar import sidecar_contents
from compd.recording.writer import write_recording

# The machine stands still where the instrument shows less motion than this, or less than its own noise can imitate.
STILL_MM = 0.001
_NOISE_SIGMAS = 6.0
# Between samples further apart than this many periods nothing is interpolated.
_GAP_PERIODS = 5.0
# Instants around a row at which the instrument's position is compared with that of the row itself.
_INSTANTS = 9


@dataclass(frozen=True)
class JoinResult:
    """What `join_reference` wrote.

    Attributes
    ----------
    path : the CSV file. offset : between the clocks.
    matched : rows that have a reference now. left_out : reason -> rows without one.
    still_mm : motion above which a row counts as in motion.
    """

    path: Path
    offset: ClockOffset
    matched: int
    left_out: Mapping[str, int]
    still_mm: float


@dataclass(frozen=True)
class Instrument:
    """What a person states about the instrument.

    Attributes
    ----------
    frame : of its x, y, z. sigma_um : standard uncertainty per axis; None where it is not known.
    link : for a length, the link that it measures (1-based).
    """

    frame: Frame = "instrument"
    sigma_um: float | None = None
    link: int | None = None


def join_reference(
    recording: Recording,
    track: Track,
    out: Path,
    instrument: Instrument,
    offset_s: float | None = None,
    moving: bool = False,
) -> JoinResult:
    """Write `out` (NAME.csv and NAME.yaml): the recording's columns, and the reference in further columns.

    Parameters
    ----------
    recording : of gauges alone. track : the instrument's export.
    offset_s : recording time = instrument time + offset_s; estimated from the motion when None.
    moving : take the reference in motion too; without it, only where the machine stands still for as long as
        the offset is uncertain. Elsewhere the cells stay empty.

    Raises
    ------
    RecordingError
        Where the offset cannot be estimated, no row matches, or the files cannot be written.
    """
    problems = _problems(recording, track, instrument)
    if problems or recording.scale_mm is None:
        raise RecordingError(problems)
    if offset_s is None:
        offset = estimate_offset(recording.time_s, recording.scale_mm, track)
    else:
        offset = evaluate_offset(recording.time_s, recording.scale_mm, track, offset_s)
    still_mm = max(STILL_MM, _NOISE_SIGMAS * track.noise_mm)
    reference_mm, left_out = _reference_at_rows(
        recording.time_s - offset.offset_s, track, offset, np.inf if moving else still_mm
    )
    matched = int(np.isfinite(reference_mm).all(axis=1).sum())
    if not matched:
        raise RecordingError(
            Problem(
                where=str(track.path),
                what=f"no row matches at an offset of {offset.offset_s:.3f} s: {_counts_text(left_out)}",
                next_step="check the offset; rows in motion are taken with --moving",
            )
        )
    names = [
        f"reference_{axis}_mm" if instrument.link is None else link_reference_column(instrument.link)
        for axis in track.axes
    ]
    columns = {**recording.columns, **dict(zip(names, reference_mm.T, strict=True))}
    write_recording(out, columns, _sidecar(recording, track, instrument, offset, matched))
    return JoinResult(out, offset, matched, left_out, still_mm)


def _problems(recording: Recording, track: Track, instrument: Instrument) -> list[Problem]:
    problems = []
    if recording.reference is not None:
        problems.append(
            Problem(
                where=str(recording.sidecar.path),
                what="has a reference already",
                value=recording.reference.quantity,
                next_step="join to a recording of gauges alone",
            )
        )
    if instrument.sigma_um is not None and not 0 < instrument.sigma_um < np.inf:
        problems.append(
            Problem(
                where=str(track.path),
                what="no standard uncertainty",
                value=str(instrument.sigma_um),
                allowed="more than 0 um",
                next_step="leave --sigma-um out where it is not known",
            )
        )
    if recording.scale_mm is None:
        problems.append(
            Problem(where=str(recording.path), what="has no scales to compare the instrument's motion with")
        )
    length = track.axes == (LENGTH,)
    links = 0 if recording.scale_mm is None else recording.scale_mm.shape[1]
    if length and (instrument.link is None or not 1 <= instrument.link <= links):
        problems.append(
            Problem(
                where=str(track.path),
                what="is a length, of no link of this machine",
                value=str(instrument.link or ""),
                allowed=f"1 to {links}",
                next_step="say which link it measures with --link",
            )
        )
    if not length and instrument.link is not None:
        problems.append(
            Problem(
                where=str(track.path),
                what="is a position, not a link's length",
                value=", ".join(track.axes),
                next_step="leave --link out",
            )
        )
    return problems


def _reference_at_rows(
    time_s: FloatArray, track: Track, offset: ClockOffset, still_mm: float
) -> tuple[FloatArray, Mapping[str, int]]:
    """(N, d) position at times of the instrument's clock, nan in gaps and in motion; and reason -> rows without one."""
    after = np.searchsorted(track.time_s, time_s).clip(1, len(track.time_s) - 1)
    outside = (time_s < track.time_s[0]) | (time_s > track.time_s[-1])
    gap = ~outside & (track.time_s[after] - track.time_s[after - 1] > _GAP_PERIODS * track.period_s)
    position_mm = track.position_at(time_s)
    # an offset that a person gave has no uncertainty: then only the neighbouring samples must agree
    reach_s = max(0.0 if np.isnan(offset.std_s) else 2.0 * offset.std_s, 1.5 * track.period_s)
    moved_mm = np.zeros(len(time_s))
    for shift_s in np.linspace(-reach_s, reach_s, _INSTANTS):
        moved_mm = np.maximum(moved_mm, np.abs(track.position_at(time_s + shift_s) - position_mm).max(axis=1))
    motion = ~outside & ~gap & (moved_mm > still_mm)
    position_mm[outside | gap | motion] = np.nan
    reasons = {"outside the instrument's time": outside, "in a gap of the instrument": gap, "in motion": motion}
    return position_mm, {reason: int(rows.sum()) for reason, rows in reasons.items() if rows.any()}


def _sidecar(
    recording: Recording, track: Track, instrument: Instrument, offset: ClockOffset, matched: int
) -> dict[str, Any]:
    """The joined recording's sidecar; rows are numbered anew where some were left out."""
    reference: dict[str, Any] = {"quantity": "link_length" if instrument.link else "tool_position"}
    if not instrument.link:
        reference["frame"] = instrument.frame
    if instrument.sigma_um is not None:
        reference["sigma_um"] = instrument.sigma_um
    joined: dict[str, Any] = {
        "gauges": recording.path.name,
        "gauges_sha256": recording.sha256,
        "instrument": track.path.name,
        "offset_s": round(offset.offset_s, 6),
        "offset_from": "a person" if np.isnan(offset.std_s) else "the motion that both saw",
        "matched_rows": matched,
    }
    known = {"agreement": offset.agreement, "offset_std_s": offset.std_s}
    joined |= {name: round(value, 6) for name, value in known.items() if not np.isnan(value)}
    provenance = {**recording.sidecar.provenance, "join": joined}
    return sidecar_contents(
        recording.machine,
        reference,
        recording.exclusions_by_position(),
        provenance,
        recording.sidecar.notes,
        recording.sidecar.folds,
    )


def _counts_text(left_out: Mapping[str, int]) -> str:
    return ", ".join(f"{count} rows {reason}" for reason, count in left_out.items())
