"""The blocks of neighbouring rows that standard errors rest on, of a recording that comes in parts.

They are those of `compd.comparison.neighbour_block`, but that a visit is looked for in neighbouring parts alone.
"""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np

from compd.arrays import IntArray
from compd.comparison.stream.sample import Sample
from compd.recording import BLOCKS as FOLDS
from compd.recording import Recording


class RowClusters:
    """Numbers the clusters of parts of a recording, given in their order."""

    def __init__(self, sample: Sample) -> None:
        rows, blocks = sample.rows, sample.aligned.criteria.blocks
        if sample.aligned.recording.session is not None:
            self._lengths = dict(sorted(sample.rows_of_session.items()))
        else:
            # fold k has the rows i with i * FOLDS // rows = k
            ends = [-(-k * rows // FOLDS) for k in range(FOLDS + 1)]
            self._lengths = {k: end - begin for k, (begin, end) in enumerate(pairwise(ends)) if end > begin}
        self._place = {number: k for k, number in enumerate(self._lengths)}
        self._of_sessions = len(self._lengths) >= blocks
        self._per_session = 1 if self._of_sessions else -(-blocks // len(self._lengths))
        self._rows_before: Counter[int] = Counter()
        self._rows = rows
        self._row = 0
        self._visits: dict[int, int] = {}

    def number(self, part: Recording) -> IntArray:
        """(N,) cluster of each row of the next part."""
        count = part.rows
        index = self._row + np.arange(count)
        self._row += count
        session = index * FOLDS // self._rows if part.session is None else part.session
        cluster = np.zeros(count, dtype=np.int64)
        for number in np.unique(session).tolist():
            rows = np.flatnonzero(session == number)
            within = self._rows_before[number] + np.arange(len(rows))
            place = self._place[number] * self._per_session
            cluster[rows] = place + within * self._per_session // self._lengths[number]
            self._rows_before[number] += len(rows)
        return cluster if self._of_sessions else self._with_visits(cluster, part.visit)

    def _with_visits(self, cluster: IntArray, visit: IntArray | None) -> IntArray:
        """A visit that goes over into the next cluster stays in its first one."""
        if visit is None:
            return cluster
        visits, first, inverse = np.unique(visit, return_index=True, return_inverse=True)
        begun = cluster[first]
        for k in np.flatnonzero(np.isin(visits, list(self._visits))):
            begun[k] = self._visits[int(visits[k])]
        together = begun[inverse]
        self._visits = dict(zip(visits.tolist(), begun.tolist(), strict=True))
        # a visit as long as a cluster would take all of it
        stays = (visit >= 0) & (cluster - together == 1)
        return np.where(stays, together, cluster)
