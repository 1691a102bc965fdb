"""Dwells of a recording of gauges: rest of the machine, each with the mean of every column."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.columns import ID_COLUMNS, approach_columns
from compd.errors import Problem, RecordingError
from compd.recording import Recording

# Largest motion (mm) of the scales of a machine at rest, unless their own noise imitates more.
STILL_MM = 0.001
NOISE_SIGMAS = 6.0
# Limit (mm) above which any change is motion, even for noisy scales: `shared_motion.MOTION_MM` for a recording without
# an instrument.
MAX_LIMIT_MM = 0.01
# Least rows and duration (s) of a dwell, below those of a measurement: a machine that reverses also stands still for a
# moment.
MIN_ROWS = 3
MIN_S = 1.0
# Most missing or wrong rows within a dwell.
_MAX_GAP_ROWS = 2
# The quarter quantile of the absolute value of a standard normal variable.
_QUARTER = 0.3186


@dataclass(frozen=True)
class Dwell:
    """Rows of a recording in which the machine stood at one place."""

    number: int  #: from 1, in the order of time
    rows: IntArray  #: (R,) positions of the rows in the recording
    time_s: tuple[float, float]  #: (2,) of the first and the last of them; nan in a recording without `time_s`
    point: str = ""  #: id of the place as the recording has it; "" if it has none

    @property
    def middle_s(self) -> float:
        """Time in the middle of the dwell."""
        return (self.time_s[0] + self.time_s[1]) / 2.0

    def __str__(self) -> str:
        point = f" (point {self.point})" if self.point else ""
        at = "" if np.isnan(self.middle_s) else f" at {self.middle_s:.1f} s"
        return f"dwell {self.number}{point}{at}"


def find_dwells(recording: Recording) -> tuple[Dwell, ...]:
    """The dwells of a recording with scales, in the order of time.

    Rows with an id in `point` are at rest by what the recording says: successive rows of one visit, without visits of
    one point, are one dwell. Without a column `point` a dwell is a stretch in which every scale stays within STILL_MM,
    or within what its noise can imitate, for MIN_ROWS rows and MIN_S seconds. Rows that a person excluded are in
    no dwell.

    Raises RecordingError if there is none, or the recording has neither `time_s` nor `point`.
    """
    if recording.point is None and not recording.has_time:
        raise RecordingError(_neither_time_nor_point(recording))
    stretches = _stretches_of_points(recording) if recording.point is not None else _still_stretches(recording)
    if not stretches:
        raise RecordingError(_no_dwell(recording))
    # without `has_time`, `time_s` has numbers of rows
    time_s = recording.time_s if recording.has_time else np.full(recording.rows, np.nan)
    return tuple(
        Dwell(number, rows, (float(time_s[rows[0]]), float(time_s[rows[-1]])), point)
        for number, (rows, point) in enumerate(stretches, start=1)
    )


def dwell_columns(recording: Recording, rows_of: Sequence[IntArray]) -> dict[str, FloatArray]:
    """Name -> (D,) the columns of the recording, averaged over each of D sets of rows; nan where all cells are empty.

    Ids and directions are those of the first row; ids that are texts by their numbers in `Recording.labels`. A
    recording whose dwells were found by its scales also has the directions of approach, which rows of dwells alone
    could not tell.
    """
    columns = dict(recording.columns)
    if recording.point is None and recording.approach is not None:
        columns |= dict(zip(approach_columns(recording.approach.shape[1]), recording.approach.T, strict=True))
    averaged = {}
    for name, values in columns.items():
        if name in ID_COLUMNS or name.startswith("approach_"):
            averaged[name] = np.array([values[rows[0]] for rows in rows_of])
        else:
            averaged[name] = np.array([_mean(values[rows]) for rows in rows_of])
    return averaged


def _mean(values: FloatArray) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else np.nan


def _neither_time_nor_point(recording: Recording) -> Problem:
    return Problem(
        str(recording.path),
        "has neither `time_s` nor `point`, so rows at rest cannot be told from rows in motion",
        allowed="one of the two columns",
        next_step="where each row is a place at rest, number the places in a column `point`",
    )


def _no_dwell(recording: Recording) -> Problem:
    if recording.point is not None:
        return Problem(str(recording.path), "no row has an id in `point`", next_step="write one into rows at rest")
    return Problem(
        str(recording.path),
        "the machine stands still nowhere",
        allowed=f"{MIN_ROWS} rows and {MIN_S:g} s or more within {STILL_MM * 1e3:g} um on every scale",
        next_step="record faster, or dwell longer; where each row is a place at rest, say so with a column `point`",
    )


def _stretches_of_points(recording: Recording) -> list[tuple[IntArray, str]]:
    """Successive rows with the same point, visit and session, and the point's id as text."""
    assert recording.point is not None
    visit = None if recording.visit is None else recording.visit_in_file(recording.visit)
    ids = [recording.point] + [ids for ids in (visit, recording.session) if ids is not None]
    keys = np.column_stack(ids)
    changes = np.flatnonzero((keys[1:] != keys[:-1]).any(axis=1)) + 1
    stretches = []
    for rows in np.split(np.arange(recording.rows), changes):
        point = int(recording.point[rows[0]]) if len(rows) else -1
        kept = rows[~recording.excluded[rows] & _has_scales(recording)[rows]]
        if point >= 0 and len(kept):
            stretches.append((kept, recording.point_name(point)))
    return stretches


def _has_scales(recording: Recording) -> BoolArray:
    """(N,) rows with a value of every scale."""
    assert recording.motion_mm is not None
    return np.asarray(np.isfinite(recording.motion_mm).all(axis=1))


def _still_stretches(recording: Recording) -> list[tuple[IntArray, str]]:
    """Stretches in which no scale leaves the mean of the stretch so far by more than the limit."""
    assert recording.motion_mm is not None
    usable = np.flatnonzero(_has_scales(recording) & ~recording.excluded)
    scale_mm, time_s = recording.motion_mm[usable], recording.time_s[usable]
    limit_mm = _limits_mm(scale_mm)
    stretches = []
    first = 0
    while first < len(usable):
        kept = _stretch_from(first, scale_mm, limit_mm)
        if len(kept) >= MIN_ROWS and time_s[kept[-1]] - time_s[kept[0]] >= MIN_S:
            rows = _trimmed(kept, scale_mm, limit_mm)
            stretches.append((usable[rows], ""))
            first = kept[-1] + 1
        else:
            first += 1
    return stretches


def _stretch_from(first: int, scale_mm: FloatArray, limit_mm: FloatArray) -> IntArray:
    """Rows from `first` on that stay; up to _MAX_GAP_ROWS rows that leave and are followed by one that stays do not
    end the stretch."""
    kept, total_mm, away = [first], scale_mm[first].copy(), 0
    for row in range(first + 1, len(scale_mm)):
        if (np.abs(scale_mm[row] - total_mm / len(kept)) <= limit_mm).all():
            kept.append(row)
            total_mm += scale_mm[row]
            away = 0
        else:
            away += 1
            if away > _MAX_GAP_ROWS:
                break
    return np.array(kept)


def _trimmed(rows: IntArray, scale_mm: FloatArray, limit_mm: FloatArray) -> IntArray:
    """The rows without those at either end that still settle: farther from the median than a third of the limit."""
    near = (np.abs(scale_mm[rows] - np.median(scale_mm[rows], axis=0)) <= limit_mm / 3.0).all(axis=1)
    inner = np.flatnonzero(near)
    if len(inner) < MIN_ROWS:
        return rows
    return rows[inner[0] : inner[-1] + 1]


def _limits_mm(scale_mm: FloatArray) -> FloatArray:
    """(n,) largest deviation (mm) of each scale from its mean at rest.

    The noise is that of each row against the mean of its neighbours, whose variance is 3/2 sigma^2 at rest. The lower
    quartile of its absolute value is of rows at rest where a quarter of all rows or more are.
    """
    if len(scale_mm) < MIN_ROWS:
        return np.full(scale_mm.shape[1], STILL_MM)
    against_neighbours = np.abs(scale_mm[1:-1] - (scale_mm[2:] + scale_mm[:-2]) / 2.0)
    noise_mm = np.quantile(against_neighbours, 0.25, axis=0) / _QUARTER / np.sqrt(1.5)
    limits: FloatArray = np.clip(NOISE_SIGMAS * noise_mm, STILL_MM, MAX_LIMIT_MM)
    return limits
