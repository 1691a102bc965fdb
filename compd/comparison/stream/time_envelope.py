"""The envelope of a long recording's residual over time: smallest, mean and largest value of each short time."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray

# About as many as a page is wide in pixels.
TIMES = 2000


class TimeEnvelope:
    """Smallest, mean and largest of m coordinates in TIMES equal times.

    middle_s : (TIMES,) the middle of each.
    """

    def __init__(self, begin_s: float, end_s: float, coordinates: int) -> None:
        self._begin_s, self._length_s = begin_s, max(end_s - begin_s, np.finfo(float).tiny) / TIMES
        self.middle_s = begin_s + (np.arange(TIMES) + 0.5) * self._length_s
        self._count = np.zeros(TIMES, dtype=np.int64)
        self._sum = np.zeros((TIMES, coordinates))
        self._smallest = np.full((TIMES, coordinates), np.inf)
        self._largest = np.full((TIMES, coordinates), -np.inf)

    def add(self, time_s: FloatArray, values: FloatArray) -> None:
        """time_s : (N,), rising.  values : (N, m), finite."""
        if not len(time_s):
            return
        place = ((time_s - self._begin_s) / self._length_s).astype(np.int64).clip(0, TIMES - 1)
        begins = np.flatnonzero(np.diff(place, prepend=-1))
        at = place[begins]
        self._count[at] += np.diff(np.append(begins, len(place)))
        self._sum[at] += np.add.reduceat(values, begins, axis=0)
        self._smallest[at] = np.minimum(self._smallest[at], np.minimum.reduceat(values, begins, axis=0))
        self._largest[at] = np.maximum(self._largest[at], np.maximum.reduceat(values, begins, axis=0))

    @property
    def smallest(self) -> FloatArray:
        """(TIMES, m), nan where there was no row."""
        return self._known(self._smallest)

    @property
    def mean(self) -> FloatArray:
        """(TIMES, m), nan where there was no row."""
        return self._known(self._sum / np.maximum(self._count, 1)[:, None])

    @property
    def largest(self) -> FloatArray:
        """(TIMES, m), nan where there was no row."""
        return self._known(self._largest)

    def _known(self, values: FloatArray) -> FloatArray:
        return np.where(self._count[:, None] > 0, values, np.nan)
