"""Visits: rows that follow each other in one session at one place, under one number of the column `visit`.

A logger that is started again counts from 1 again, and a table of points has one number for each return. Rows with
another session, another visit or another place between them are therefore no repeats. Where several reflectors are
measured in turn at one pose, the rows of each follow each other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray

# Distance between two rows from which on they are at different places: ten times what a machine at rest may creep.
_SAME_PLACE_MM = 0.1
# Lever by which a turn counts as a distance.
_LEVER_MM = 100.0
# A number that comes back gets so much more each time, so that the file's number is the rest of a division by it.
_AGAIN = 1 << 40


def file_numbers(visit: IntArray) -> IntArray:
    """Numbers of visits in the file, -1 for none."""
    return np.where(visit < 0, visit, visit % _AGAIN)


def pose_mm(place_mm: FloatArray | None, rotation_rad: FloatArray | None) -> FloatArray | None:
    """(N, 3) or (N, 6) places, with turns by their lever."""
    if place_mm is None or rotation_rad is None:
        return place_mm
    return np.column_stack([place_mm, _LEVER_MM * rotation_rad])


class _Last(NamedTuple):
    """Of one reflector the last row so far."""

    number: int
    session: int
    place_mm: FloatArray
    visit: int


class VisitNumbers:
    """Numbers visits, one for each, over blocks of rows that follow each other."""

    def __init__(self) -> None:
        self._highest = -1
        self._again: dict[int, int] = {}
        self._last: dict[bytes, _Last] = {}

    @property
    def again(self) -> int:
        """How many numbers have come back for another visit."""
        return len(self._again)

    def of_block(
        self, number: IntArray, session: IntArray | None, place_mm: FloatArray | None, target_mm: FloatArray | None
    ) -> IntArray:
        """(N,) visit of each row: the file's number where it comes first, -1 for none.

        number : (N,) of the file, -1 for none.  session : (N,).
        place_mm : (N, d) of the machine, nan where it is not known.  target_mm : (N, 3) place of the row's reflector.
        """
        rows = len(number)
        if not rows:
            return number
        session = np.zeros(rows, dtype=np.int64) if session is None else session
        place_mm = np.zeros((rows, 0)) if place_mm is None else place_mm
        target_mm = np.zeros((rows, 1)) if target_mm is None else np.nan_to_num(target_mm, nan=np.inf)
        targets, of_target = np.unique(target_mm, axis=0, return_inverse=True)
        begins = np.zeros(rows, dtype=bool)
        known: dict[int, int] = {}
        for k, target in enumerate(targets):
            index = np.flatnonzero(of_target.ravel() == k)
            begins[index] = _begins(number[index], session[index], place_mm[index])
            last = self._last.get(target.tobytes())
            first = int(index[0])
            goes_on = last is not None and (last.number, last.session) == (number[first], session[first])
            if last is not None and goes_on and not _is_apart(place_mm[first] - last.place_mm):
                known[first] = last.visit
        begin = np.flatnonzero(begins)
        visit_of_run = self._numbered(number[begin], begin, known)
        visit = np.empty(rows, dtype=np.int64)
        for k, target in enumerate(targets):
            index = np.flatnonzero(of_target.ravel() == k)
            runs = np.searchsorted(begin, index[begins[index]])
            visit[index] = visit_of_run[runs][np.cumsum(begins[index]) - 1]
            i = index[-1]
            self._last[target.tobytes()] = _Last(int(number[i]), int(session[i]), place_mm[i], int(visit[i]))
        return visit

    def _numbered(self, number: IntArray, begin: IntArray, known: dict[int, int]) -> IntArray:
        """(R,) visit of runs with these numbers, which begin at these rows; known : visits that go on, by row."""
        visit = number.copy()
        if not known and len(number) and number[0] > self._highest and (np.diff(number) > 0).all():
            self._highest = int(number[-1])
            return visit
        for k, (own, row) in enumerate(zip(number.tolist(), begin.tolist(), strict=True)):
            if row in known:
                visit[k] = known[row]
            elif own > self._highest:
                self._highest = own
            elif own >= 0:
                self._again[own] = self._again.get(own, 0) + 1
                visit[k] = own + self._again[own] * _AGAIN
        return visit


def _is_apart(step_mm: FloatArray) -> BoolArray:
    return np.asarray(np.sqrt(np.nansum(step_mm**2, axis=-1)) > _SAME_PLACE_MM)


def _begins(number: IntArray, session: IntArray, place_mm: FloatArray) -> BoolArray:
    """(N,) rows with which a visit begins; each row of a visit that creeps over more than one place."""
    begins = np.ones(len(number), dtype=bool)
    begins[1:] = (np.diff(number) != 0) | (np.diff(session) != 0) | _is_apart(np.diff(place_mm, axis=0))
    if place_mm.shape[1]:
        at = np.flatnonzero(begins)
        widest_mm = np.fmax.reduceat(place_mm, at) - np.fmin.reduceat(place_mm, at)
        begins |= _is_apart(widest_mm)[np.cumsum(begins) - 1]
    return begins
