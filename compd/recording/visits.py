"""Visits: rows that follow each other in one session at one place, under one number of the column `visit`.

A logger that is started again counts from 1 again, and a table of points has one number for each return. Rows with
another session, another visit or another place between them are therefore no repeats. Where several reflectors are
measured in turn at one pose, the rows of each follow each other.
"""

from __future__ import annotations

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


def unique_visits(
    number: IntArray, session: IntArray | None, place_mm: FloatArray | None, target_mm: FloatArray | None
) -> tuple[IntArray, int]:
    """(N,) visit of each row, the file's number where it comes first, -1 for none; how many numbers come back.

    number : (N,) of the file, -1 for none.  session : (N,).
    place_mm : (N, d) of the machine, nan where it is not known.  target_mm : (N, 3) place of the row's reflector.
    """
    rows = len(number)
    if not rows:
        return number, 0
    session = np.zeros(rows, dtype=np.int64) if session is None else session
    place_mm = np.zeros((rows, 0)) if place_mm is None else place_mm
    target_mm = np.zeros((rows, 1)) if target_mm is None else np.nan_to_num(target_mm, nan=np.inf)
    targets, of_target = np.unique(target_mm, axis=0, return_inverse=True)
    indices = [np.flatnonzero(of_target.ravel() == k) for k in range(len(targets))]
    begins = np.zeros(rows, dtype=bool)
    for index in indices:
        begins[index] = _begins(number[index], session[index], place_mm[index])
    begin = np.flatnonzero(begins)
    visit_of_run, again = _numbered(number[begin])
    visit = np.empty(rows, dtype=np.int64)
    for index in indices:
        runs = np.searchsorted(begin, index[begins[index]])
        visit[index] = visit_of_run[runs][np.cumsum(begins[index]) - 1]
    return visit, again


def _numbered(number: IntArray) -> tuple[IntArray, int]:
    """(R,) visit of runs with these numbers; how many numbers come back."""
    visit = number.copy()
    highest = -1
    again: dict[int, int] = {}
    for k, own in enumerate(number.tolist()):
        if own > highest:
            highest = own
        elif own >= 0:
            again[own] = again.get(own, 0) + 1
            visit[k] = own + again[own] * _AGAIN
    return visit, len(again)


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
