"""What cross-validation leaves out: whole sessions, and whole sectors of the workspace; never half a point."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.recording.recording import BLOCKS

# Fewer sessions than this leave too little to learn from when one is left out: blocks of time instead.
FEWEST_SESSIONS = 3
# Sectors of the workspace, about the vertical through its middle; rows of one point stay together.
SECTORS = 5


def schemes(aligned: AlignedRecording) -> tuple[IntArray, ...]:
    """Ways to divide the rows, each (N,) numbered from 0: by session (or time), and by place where points are known.

    An effect has to prove itself in each: left-out sessions test its weather, left-out sectors its geometry, which
    neighbouring points would praise wrongly (they leak).
    """
    found = [_by_session(aligned)]
    by_place = _by_sector(aligned)
    if by_place is not None:
        found.append(by_place)
    return tuple(found)


def _by_session(aligned: AlignedRecording) -> IntArray:
    recording = aligned.recording
    fold = recording.fold
    if len(np.unique(fold[fold >= 0])) < FEWEST_SESSIONS:
        fold = np.arange(recording.rows, dtype=np.int64) * BLOCKS // recording.rows
        if recording.visit is not None:
            # repeats of one visit stay together
            first = np.unique(recording.visit, return_index=True, return_inverse=True)
            fold = np.where(recording.visit >= 0, fold[first[1]][first[2]], fold)
    return np.asarray(np.unique(fold, return_inverse=True)[1], dtype=np.int64)


def _by_sector(aligned: AlignedRecording) -> IntArray | None:
    """Sectors with equally many points; None where the tip or its points are not known or too few."""
    point, tip = aligned.recording.point, aligned.rows.tip_M_mm
    known = np.isfinite(tip).all(axis=1)
    if point is None or not known.any():
        return None
    names, inverse = np.unique(point, return_inverse=True)
    if len(names) < 2 * SECTORS:
        return None
    middle = tip[known].mean(axis=0)
    azimuth_rad = np.array([_azimuth(tip[known & (inverse == k)] - middle) for k in range(len(names))])
    sector = np.empty(len(names), dtype=np.int64)
    sector[np.argsort(azimuth_rad, kind="stable")] = np.arange(len(names)) * SECTORS // len(names)
    return sector[inverse]


def _azimuth(from_middle_mm: FloatArray) -> float:
    """Of one point's rows, -pi to pi; that of a point without a place is 0."""
    if not len(from_middle_mm):
        return 0.0
    x, y, _ = from_middle_mm.mean(axis=0)
    return float(np.arctan2(y, x))
