"""Joining a recording of gauges and an instrument's export into one recording with a reference, on one clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray, TextArray
from compd.columns import ATTITUDE_COLUMNS, DISTANCE_COLUMN, link_reference_column
from compd.errors import Problem, RecordingError
from compd.instruments import LENGTH, Track
from compd.joining.clock_offset import ClockOffset, estimate_offset, evaluate_offset
from compd.joining.reflectors import Place
from compd.recording import Frame, Recording, sidecar_contents

# Largest motion (mm) in the instrument's data of a machine at rest, unless its own noise imitates more.
STILL_MM = 0.001
# 1 um at 100 mm from the point about which the platform turns.
STILL_RAD = 1e-5
_NOISE_SIGMAS = 6.0
# Longest gap (periods) between samples for interpolation.
_GAP_PERIODS = 5.0
# Instants around a row at which the instrument's position is compared with that of the row itself.
_INSTANTS = 9


@dataclass(frozen=True)
class JoinResult:
    """A recording with the reference that an instrument gives, on one clock; `write_recording` writes it."""

    columns: Mapping[str, FloatArray | TextArray]  #: columns, sidecar: of the recording
    sidecar: Mapping[str, Any]
    offset: ClockOffset  #: between the clocks
    matched: int  #: rows that have a reference now
    left_out: Mapping[str, int]  #: reason -> rows without one
    still_mm: float  #: motion above which a row counts as in motion


@dataclass(frozen=True)
class Instrument:
    """A person's statements about the instrument."""

    frame: Frame = "instrument"  #: of its x, y, z
    sigma_um: float | None = None  #: standard uncertainty per axis; None if it is not known
    link: int | None = None  #: for a length, the link that it measures (1-based)
    sigma_urad: float | None = None  #: standard uncertainty of an attitude about each axis; None if it is not known
    #: for a length, the number of the fixed ball, or of another fixed end, from which it is measured to the tip
    ball: int | None = None
    #: name -> place of each of several reflectors, from the tip along the axes of {P}, mm
    reflectors: Mapping[str, Place] = field(default_factory=dict)


def match_by_time(
    recording: Recording,
    track: Track,
    instrument: Instrument,
    offset_s: float | None = None,
    moving: bool = False,
) -> JoinResult:
    """The recording's columns, and the reference in further columns; nothing is written.

    Parameters
    ----------
    recording : of gauges alone. track : the instrument's export.
    offset_s : recording time = instrument time + offset_s; estimated from the motion when None.
    moving : take the reference in motion too; without it, only where the machine stands still for as long as
        the offset is uncertain. Elsewhere the cells stay empty.

    Raises
    ------
    RecordingError
        Where the offset cannot be estimated, or no row matches.
    """
    problems = _problems(recording, track, instrument, moving)
    if problems or recording.motion_mm is None:
        raise RecordingError(problems)
    if offset_s is None:
        offset = estimate_offset(recording.time_s, recording.motion_mm, track)
    else:
        offset = evaluate_offset(recording.time_s, recording.motion_mm, track, offset_s)
    still_mm = max(STILL_MM, _NOISE_SIGMAS * track.noise_mm)
    reference, left_out = _reference_at_rows(
        recording.time_s - offset.offset_s, track, offset, np.inf if moving else still_mm
    )
    matched = int(np.isfinite(reference).all(axis=1).sum())
    if not matched:
        raise RecordingError.of(
            str(track.path),
            f"no row matches at an offset of {offset.offset_s:.3f} s: {_counts_text(left_out)}",
            next_step="check the offset; rows in motion are taken with --moving",
        )
    measured = dict(zip(_column_names(track, instrument), reference.T, strict=True))
    columns = {**recording.with_texts(recording.columns), **measured}
    if instrument.ball is not None:
        columns["ball"] = np.where(np.isfinite(reference[:, 0]), float(instrument.ball), np.nan)
    sidecar = _sidecar(recording, track, instrument, offset, matched)
    return JoinResult(columns, sidecar, offset, matched, left_out, still_mm)


def _column_names(track: Track, instrument: Instrument) -> list[str]:
    if instrument.ball is not None:
        return [DISTANCE_COLUMN]
    if instrument.link is not None:
        return [link_reference_column(instrument.link)]
    return [f"reference_{axis}_mm" for axis in track.axes] + list(
        ATTITUDE_COLUMNS if track.rotation_rad is not None else ()
    )


def _problems(recording: Recording, track: Track, instrument: Instrument, moving: bool) -> list[Problem]:
    problems = []
    if moving and track.time_std_s > 0:
        problems.append(
            Problem(
                str(track.path),
                "has times that are too coarse for rows in motion: speed times their uncertainty is an error",
                value=f"+- {track.time_std_s:.2g} s",
                allowed="rows at rest, or times as fine as the rows",
                next_step="leave --moving out, or export with fractions of a second",
            )
        )
    if recording.reference is not None:
        problems.append(
            Problem(
                str(recording.sidecar.path),
                "has a reference already",
                value=recording.reference.quantity,
                next_step="join to a recording of gauges alone",
            )
        )
    problems += [
        Problem(
            str(track.path),
            "no standard uncertainty",
            value=str(sigma),
            allowed=f"more than 0 {unit}",
            next_step=f"leave --sigma-{unit} out where it is not known",
        )
        for unit, sigma in (("um", instrument.sigma_um), ("urad", instrument.sigma_urad))
        if sigma is not None and not 0 < sigma < np.inf
    ]
    if instrument.sigma_urad is not None and track.rotation_rad is None:
        problems.append(
            Problem(str(track.path), "has no attitude", next_step="leave --sigma-urad out, or export rx, ry, rz")
        )
    if not recording.has_time:
        problems.append(
            Problem(
                str(recording.path),
                "has no `time_s` to compare with the instrument's",
                allowed="a time in each row",
                next_step="join with --by order, name or distance",
            )
        )
    if recording.motion_mm is None:
        problems.append(
            Problem(
                str(recording.path), "has neither scales nor a commanded pose to compare the instrument's motion with"
            )
        )
    length = track.axes == (LENGTH,)
    links = 0 if recording.scale_mm is None else recording.scale_mm.shape[1]
    if length and (instrument.link is None) == (instrument.ball is None):
        problems.append(
            Problem(
                str(track.path),
                "is a length of an unknown object" if instrument.link is None else "is one length",
                allowed="--link or --ball",
                next_step="name its link with --link, or its fixed ball with --ball",
            )
        )
    if length and instrument.link is not None and not 1 <= instrument.link <= links:
        problems.append(
            Problem(
                str(track.path),
                "is a length, of no link of this machine",
                value=str(instrument.link),
                allowed=f"1 to {links}",
                next_step="say which link it measures with --link",
            )
        )
    if not length and (instrument.link is not None or instrument.ball is not None):
        problems.append(
            Problem(
                str(track.path),
                "is a position, not a length",
                value=", ".join(track.axes),
                next_step="leave --link and --ball out",
            )
        )
    return problems


def _reference_at_rows(
    time_s: FloatArray, track: Track, offset: ClockOffset, still_mm: float
) -> tuple[FloatArray, Mapping[str, int]]:
    """(N, d) position, and attitude behind it, at times of the instrument's clock; and reason -> rows without one.

    nan outside the track, in gaps and in motion.
    """
    after = np.searchsorted(track.time_s, time_s).clip(1, len(track.time_s) - 1)
    outside = (time_s < track.time_s[0]) | (time_s > track.time_s[-1])
    gap = ~outside & (track.time_s[after] - track.time_s[after - 1] > _GAP_PERIODS * track.period_s)
    position_mm = track.position_at(time_s)
    # a given offset has no uncertainty: only the neighbouring samples must agree
    std_s = float(np.hypot(0.0 if np.isnan(offset.std_s) else offset.std_s, track.time_std_s))
    reach_s = max(2.0 * std_s, 1.5 * track.period_s)
    shifts_s = np.linspace(-reach_s, reach_s, _INSTANTS)
    moved = np.zeros(len(time_s), dtype=bool)
    for shift_s in shifts_s:
        moved |= np.abs(track.position_at(time_s + shift_s) - position_mm).max(axis=1) > still_mm
    reference = position_mm
    if track.rotation_rad is not None:
        rotation_rad = track.rotation_at(time_s)
        still_rad = max(STILL_RAD, _NOISE_SIGMAS * track.rotation_noise_rad) if np.isfinite(still_mm) else np.inf
        attitude = Rotation.from_rotvec(rotation_rad)
        for shift_s in shifts_s:
            turn = Rotation.from_rotvec(track.rotation_at(time_s + shift_s)) * attitude.inv()
            moved |= turn.magnitude() > still_rad
        reference = np.column_stack([position_mm, rotation_rad])
    motion = ~outside & ~gap & moved
    reference[outside | gap | motion] = np.nan
    reasons = {"outside the instrument's time": outside, "in a gap of the instrument": gap, "in motion": motion}
    return reference, {reason: int(rows.sum()) for reason, rows in reasons.items() if rows.any()}


def _sidecar(
    recording: Recording, track: Track, instrument: Instrument, offset: ClockOffset, matched: int
) -> dict[str, Any]:
    """The joined recording's sidecar; rows are numbered anew where some were left out."""
    if instrument.ball is not None:
        reference: dict[str, Any] = {"quantity": "distance"}
    elif instrument.link is not None:
        reference = {"quantity": "link_length"}
    else:
        tool = "tool_position" if track.rotation_rad is None else "tool_pose"
        reference = {"quantity": tool, "frame": instrument.frame}
    if instrument.sigma_um is not None:
        reference["sigma_um"] = instrument.sigma_um
    if instrument.sigma_urad is not None:
        reference["sigma_urad"] = instrument.sigma_urad
    joined: dict[str, Any] = {
        "gauges": recording.path.name,
        "gauges_sha256": recording.sha256,
        "instrument": track.path.name,
        "offset_s": round(offset.offset_s, 6),
        "offset_from": "a person" if np.isnan(offset.std_s) else "the motion that both saw",
        "matched_rows": matched,
    }
    known = {"agreement": offset.agreement, "offset_std_s": offset.std_s}
    if track.time_std_s > 0:
        known["time_std_s"] = track.time_std_s
    joined |= {name: round(value, 6) for name, value in known.items() if not np.isnan(value)}
    provenance = {**recording.sidecar.provenance, "join": joined}
    return sidecar_contents(
        recording.machine,
        reference,
        recording.exclusions_by_position(),
        provenance,
        recording.sidecar.notes,
        recording.sidecar.folds,
        recording.sidecar.quantities_at_zero,
        machine_file=recording.sidecar.machine_file,
    )


def _counts_text(left_out: Mapping[str, int]) -> str:
    return ", ".join(f"{count} rows {reason}" for reason, count in left_out.items())
