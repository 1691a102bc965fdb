"""How rows are divided for cross-validation: by whole sessions, whole sectors of the workspace, or a named column.

Rows that are left out must be like the rows that a model will meet, not like their neighbours: a row beside one that
was fitted lets a fit predict its own noise (leakage; Roberts et al., Ecography 40 (2017) 913: block cross-validation).
"""

from __future__ import annotations

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison import AlignedRecording
from compd.diagnosis.descriptions.search_covariates import kind_of
from compd.diagnosis.search_criteria import FoldCriteria
from compd.errors import Problem, RecordingError
from compd.recording import PLACE, TIME


def row_splits(aligned: AlignedRecording, criteria: FoldCriteria = FoldCriteria()) -> tuple[IntArray, ...]:
    """Splits of the N rows, each (N,) the fold of each row, numbered from 0.

    By what the sidecar's `folds:` names; without it by time, and by place where it is known:

    time : sessions, or blocks of time. What is left out tests what an effect says of the weather. Where each of them
        has a place or a setting of its own, as of a machine that is measured height by height, every one that is left
        out lies beyond the others; then each fold has a part of every block (`_balanced`).
    place : sectors about the middle of the first two axes along which the tip moves, with equally many places each.
        They test what an effect says of the geometry. The tip is the model's prediction: x, y, z of a known machine,
        the columns `model_...` of an external one.
    a column : each of its values; of a quantity with many values, classes of about equally many rows.

    Rows of one visit are always in one fold, and rows of one `point` in one sector.

    Raises RecordingError where the sidecar names what does not divide the rows.
    """
    recording = aligned.recording
    if not recording.sidecar.folds:
        by_place = _split_by_place(aligned, criteria)
        by_time = _split_by_time(aligned, criteria)
        if _is_confounded(aligned, by_time, criteria):
            by_time = _balanced(aligned, by_time, criteria)
        return (by_time,) if by_place is None else (by_time, by_place)
    splits: list[IntArray] = []
    problems: list[Problem] = []
    for name in recording.sidecar.folds:
        if name == TIME:
            split: IntArray | None = _split_by_time(aligned, criteria)
        elif name == PLACE:
            split = _split_by_place(aligned, criteria)
        else:
            split = _split_by_values(aligned, recording.columns[name], criteria)
        if split is None or split.max() == 0:
            problems.append(_undivided(aligned, name, criteria))
        else:
            splits.append(split)
    if problems:
        raise RecordingError(problems)
    return tuple(splits)


def _undivided(aligned: AlignedRecording, name: str, criteria: FoldCriteria) -> Problem:
    by_place = f"the tip moves along two axes, and {2 * criteria.sectors} places were measured"
    return Problem(
        f"{aligned.recording.sidecar.path} folds",
        "does not divide the rows",
        value=name,
        allowed=by_place if name == PLACE else "a column with two values or more, `time` or `place`",
        next_step="name another column, or delete `folds:`",
    )


def _split_by_time(aligned: AlignedRecording, criteria: FoldCriteria) -> IntArray:
    """(N,) sessions; with too few of them blocks of time, with many of them neighbouring sessions together."""
    recording = aligned.recording
    fold = recording.session
    if fold is None or len(np.unique(fold[fold >= 0])) < criteria.min_sessions:
        fold = recording.first_of_visit(np.arange(recording.rows, dtype=np.int64) * criteria.blocks // recording.rows)
    number = _numbered(fold)
    count = int(number.max()) + 1
    return number * criteria.max_folds // count if count > criteria.max_folds else number


def _is_confounded(aligned: AlignedRecording, fold: IntArray, criteria: FoldCriteria) -> bool:
    """Whether a coordinate of the tip, an angle or a setting changes with the folds (N,) and hardly within them.

    What warms, cools or loads the machine may change with time: what it does then is what folds of time test.
    """
    usable = aligned.usable.mask
    quantities = aligned.rows.quantities
    settings = [values for name, values in quantities.items() if kind_of(name) in ("workspace", "place", "angle")]
    count = int(fold.max()) + 1
    for values in (*aligned.rows.tip_M_mm.T, *settings):
        known = usable & np.isfinite(values)
        if known.sum() <= count or np.ptp(values[known]) == 0:
            continue
        of_fold, rows = fold[known], np.maximum(np.bincount(fold[known], minlength=count), 1)
        means = np.bincount(of_fold, values[known], minlength=count) / rows
        within = float(np.mean((values[known] - means[of_fold]) ** 2))
        if within < criteria.confounded_share * float(np.var(values[known])):
            return True
    return False


def _balanced(aligned: AlignedRecording, fold: IntArray, criteria: FoldCriteria) -> IntArray:
    """(N,) folds that each have a part of every one of some folds (N,): the first parts, the second, and so on.

    A part is a run of neighbouring rows, so that few rows have a neighbour in another fold.
    """
    part = np.zeros(len(fold), dtype=np.int64)
    for k in range(int(fold.max()) + 1):
        rows = np.flatnonzero(fold == k)
        part[rows] = np.arange(len(rows)) * criteria.blocks // max(len(rows), 1)
    return _numbered(aligned.recording.first_of_visit(part))


def _split_by_values(aligned: AlignedRecording, values: FloatArray, criteria: FoldCriteria) -> IntArray:
    """(N,) each value of a column, or classes of about equally many rows; empty cells are a fold of their own."""
    known = values[np.isfinite(values)]
    if len(np.unique(known)) > criteria.max_values:
        edges = np.unique(np.quantile(known, np.arange(1, criteria.blocks) / criteria.blocks))
        values = np.where(np.isfinite(values), np.searchsorted(edges, values), np.nan)
    # nan sorts behind every number, and all of them are one value
    return _numbered(aligned.recording.first_of_visit(np.unique(values, return_inverse=True)[1]))


def _split_by_place(aligned: AlignedRecording, criteria: FoldCriteria) -> IntArray | None:
    """(N,) sectors with equally many places each; None with fewer than two axes, or two places per sector."""
    axes, _ = _workspace(aligned, criteria)
    place = row_places(aligned, criteria)
    count = int(place.max()) + 1
    if len(axes) < 2 or count < 2 * criteria.sectors:
        return None
    at_mm = aligned.rows.tip_M_mm[:, axes[:2]]
    known: BoolArray = np.asarray(np.isfinite(at_mm).all(axis=1))
    middle_mm = at_mm[known].mean(axis=0)
    azimuth_rad = np.array([_azimuth_rad(at_mm[known & (place == k)] - middle_mm) for k in range(count)])
    sector = np.empty(count, dtype=np.int64)
    sector[np.argsort(azimuth_rad, kind="stable")] = np.arange(count) * criteria.sectors // count
    return sector[place]


def _workspace(aligned: AlignedRecording, criteria: FoldCriteria) -> tuple[IntArray, FloatArray]:
    """The axes along which the tip moves, and by how much, mm."""
    tip_mm = aligned.rows.tip_M_mm
    extent_mm = np.array([np.ptp(axis[np.isfinite(axis)]) if np.isfinite(axis).any() else 0.0 for axis in tip_mm.T])
    axes = np.flatnonzero(extent_mm > criteria.same_place_share * extent_mm.max())
    return axes, extent_mm[axes]


def row_places(aligned: AlignedRecording, criteria: FoldCriteria = FoldCriteria()) -> IntArray:
    """(N,) number of each row's place, from 0: its `point`; where there is none, its cell, of a visit's first row.

    Rows without a prediction count nowhere, and are one place.
    """
    axes, extent_mm = _workspace(aligned, criteria)
    at_mm = aligned.rows.tip_M_mm[:, axes]
    known: BoolArray = np.asarray(np.isfinite(at_mm).all(axis=1))
    cell = np.where(known[:, None], np.rint(at_mm / (criteria.same_place_share * extent_mm)), np.inf)
    number = aligned.recording.first_of_visit(np.unique(cell, axis=0, return_inverse=True)[1].ravel())
    point = aligned.recording.point
    if point is not None:
        number = np.where(point >= 0, point, number + point.max() + 1)
    return _numbered(number)


def _numbered(fold: IntArray) -> IntArray:
    """(N,) folds as numbers from 0 without gaps."""
    return np.asarray(np.unique(fold, return_inverse=True)[1], dtype=np.int64)


def _azimuth_rad(from_middle_mm: FloatArray) -> float:
    """Mean azimuth of one place's rows (R, 2), -pi to pi; of a place without rows 0."""
    if not len(from_middle_mm):
        return 0.0
    x, y = from_middle_mm.mean(axis=0)
    return float(np.arctan2(y, x))
