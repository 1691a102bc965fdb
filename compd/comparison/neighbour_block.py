"""Blocks of neighbouring rows, within which residuals may be correlated."""

from __future__ import annotations

import numpy as np

from compd.arrays import IntArray
from compd.comparison.criteria import ComparisonCriteria
from compd.recording import Recording


def neighbour_blocks(recording: Recording, blocks: int = ComparisonCriteria.blocks) -> IntArray:
    """(N,) number of each row's block: rows within which residuals may be correlated.

    Blocks are the recording's sessions (`Recording.fold`) where there are `blocks` or more of them; else each session
    is cut into parts of neighbouring rows, so that there are at least `blocks` in all. Rows of one visit stay together,
    unless visits are longer than blocks.
    """
    sessions, session = np.unique(recording.fold, return_inverse=True)
    if len(sessions) >= blocks:
        return np.asarray(session, dtype=np.int64)
    per_session = -(-blocks // len(sessions))
    block = np.zeros(len(session), dtype=np.int64)
    for k in range(len(sessions)):
        rows = np.flatnonzero(session == k)
        block[rows] = k * per_session + np.arange(len(rows)) * per_session // len(rows)
    together = recording.first_of_visit(block)
    return together if len(np.unique(together)) == len(np.unique(block)) else block
