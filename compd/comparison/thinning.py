"""A recording of many rows, thinned evenly: what a search needs, at a cost that does not grow with the rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from compd.arrays import IntArray
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.recording import Recording

# The choice within each stretch is drawn, so that it does not keep step with a motion that repeats; the same each time.
SEED = 1


def thinned(aligned: AlignedRecording, most_rows: int) -> AlignedRecording:
    """The recording with about `most_rows` of its rows; itself where it has no more.

    Rows of one visit stay together. Of every so many visits, or rows without one, one is kept, drawn at random.
    """
    if len(aligned.rows) <= most_rows:
        return aligned
    index = _evenly_drawn(aligned.recording, most_rows)
    starts = np.zeros(len(index), dtype=bool)
    starts[:1] = True
    # a session whose first row was not kept starts with the next one
    session = np.cumsum(aligned.rows.session_start)[index]
    starts[1:] = session[1:] != session[:-1]
    chosen = aligned.select(index)
    return replace(chosen, rows=replace(chosen.rows, session_start=starts))


def _evenly_drawn(recording: Recording, most_rows: int) -> IntArray:
    """(R,) rows, rising."""
    count = recording.rows
    group = np.arange(count)
    if recording.visit is not None:
        _, first, inverse = np.unique(recording.visit, return_index=True, return_inverse=True)
        group = np.where(recording.visit >= 0, first[inverse], group)
    groups = np.unique(group)
    stretches = np.array_split(groups, max(1, int(len(groups) * most_rows / count)))
    rng = np.random.default_rng(SEED)
    kept = np.array([rng.choice(stretch) for stretch in stretches])
    return np.flatnonzero(np.isin(group, kept))
