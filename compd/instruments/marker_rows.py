"""Rows in which nothing was measured, and a number stands for that: -9999, 99999.999, or 0, 0, 0 of a lost beam.

Such a row is told by its digits and by its place: it is far from all the others. Digits are nines, or zeros in every
column; other numbers mark a row where two or more rows have the very same digits.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from compd.arrays import BoolArray, FloatArray

# Numbers of three or more nines only: -9999, 99999.999, 9.99e+37.
_NINES = re.compile(r"[-+]?(?=(?:\.?9){3})9*\.?9*(?:[eE][-+]?\d+)?")
_ZERO = re.compile(r"[-+]?0*\.?0*(?:[eE][-+]?\d+)?")
# Least distance from the others, as a share of the longest side of their bounding box.
_FAR = 0.5
# Fewest other rows for judging a distance from them.
_MIN_OTHERS = 3


def marker_rows(cells: Sequence[Sequence[str]], values: FloatArray) -> BoolArray:
    """(N,) whether a row is a marker.

    cells : of the columns x, y, z or the length, as they are written. values : (N, d) what they are worth; nan where
    one is empty.
    """
    outlying = np.flatnonzero(_is_outlying(values)).tolist()
    row = {i: tuple(column[i] for column in cells) for i in outlying}
    nines = np.zeros(len(values), dtype=bool)
    nines[[i for i in outlying if any(map(_NINES.fullmatch, row[i]))]] = True
    markers = nines & _is_far(values, nines)
    groups: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for i in outlying:
        if len(cells) > 1 and not markers[i]:
            groups[row[i]].append(i)
    for digits, places in groups.items():
        if len(places) > 1 or all(map(_ZERO.fullmatch, digits)):
            candidates = np.zeros(len(values), dtype=bool)
            candidates[places] = True
            markers |= candidates & _is_far(values, markers | candidates)
    return markers


def _is_outlying(values: FloatArray) -> BoolArray:
    """(N,) which rows are outside of the middle of the values, so that the others need not be looked at."""
    filled = values[np.isfinite(values).all(axis=1)]
    if not len(filled):
        return np.zeros(len(values), dtype=bool)
    low, middle, high = np.quantile(filled, (0.25, 0.5, 0.75), axis=0)
    with np.errstate(invalid="ignore"):
        outlying: BoolArray = (np.abs(values - middle) > _FAR * float((high - low).max())).any(axis=1)
    return outlying


def _is_far(values: FloatArray, candidates: BoolArray) -> BoolArray:
    """(N,) which rows are far beyond the box around those that are no candidates."""
    others = values[~candidates & np.isfinite(values).all(axis=1)]
    if len(others) < _MIN_OTHERS or not candidates.any():
        return np.zeros(len(values), dtype=bool)
    low, high = others.min(axis=0), others.max(axis=0)
    with np.errstate(invalid="ignore"):
        beyond = np.maximum(low - values, values - high)
        far: BoolArray = (beyond > _FAR * float((high - low).max())).any(axis=1)
    return far
