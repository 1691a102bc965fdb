"""How rows are divided for cross-validation: by whole sessions, and by whole sectors of the workspace."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.recording.recording import BLOCKS

# With fewer sessions blocks of time are left out in their place: of two, one would have to predict the other.
FEWEST_SESSIONS = 3
# Sectors about the vertical into which the workspace is divided: a fifth left out leaves four fifths to learn from.
SECTORS = 5


def row_splits(aligned: AlignedRecording) -> tuple[IntArray, ...]:
    """Splits of the N rows, each (N,) the fold of each row, numbered from 0.

    By session (or time), and by sector where nominal points are known. Sessions that are left out test what an effect
    says of the weather, sectors what it says of the geometry. Repeats of one point never lie in two folds: they would
    let a fit predict its own noise (leakage; Roberts et al., Ecography 40 (2017) 913: block cross-validation).
    """
    splits = [_split_by_session(aligned)]
    by_sector = _split_by_sector(aligned)
    if by_sector is not None:
        splits.append(by_sector)
    return tuple(splits)


def _split_by_session(aligned: AlignedRecording) -> IntArray:
    """(N,) sessions; with too few of them, blocks of time, repeats of one visit in the same."""
    recording = aligned.recording
    fold = recording.fold
    if len(np.unique(fold[fold >= 0])) < FEWEST_SESSIONS:
        fold = np.arange(recording.rows, dtype=np.int64) * BLOCKS // recording.rows
        if recording.visit is not None:
            _, first_row, visit = np.unique(recording.visit, return_index=True, return_inverse=True)
            fold = np.where(recording.visit >= 0, fold[first_row][visit], fold)
    return np.asarray(np.unique(fold, return_inverse=True)[1], dtype=np.int64)


def _split_by_sector(aligned: AlignedRecording) -> IntArray | None:
    """(N,) sectors about the vertical through the middle of the workspace, with equally many points each.

    None where the tip or its nominal points are not known, or where there are fewer than two points per sector.
    """
    point, tip_M_mm = aligned.recording.point, aligned.rows.tip_M_mm
    known = np.isfinite(tip_M_mm).all(axis=1)
    if point is None or not known.any():
        return None
    points, index = np.unique(point, return_inverse=True)
    if len(points) < 2 * SECTORS:
        return None
    middle = tip_M_mm[known].mean(axis=0)
    azimuth_rad = np.array([_azimuth_rad(tip_M_mm[known & (index == k)] - middle) for k in range(len(points))])
    sector = np.empty(len(points), dtype=np.int64)
    sector[np.argsort(azimuth_rad, kind="stable")] = np.arange(len(points)) * SECTORS // len(points)
    return sector[index]


def _azimuth_rad(from_middle_mm: FloatArray) -> float:
    """Mean azimuth of one point's rows (R, 3), -pi to pi; of a point without rows 0."""
    if not len(from_middle_mm):
        return 0.0
    x, y, _ = from_middle_mm.mean(axis=0)
    return float(np.arctan2(y, x))
