"""Rows whose reference is no measurement: an instrument that repeats itself, or that had no reading."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.data_fault import DataFault
from compd.recording.fault_criteria import LIMITS
from compd.statistics import trimmed_scale


class _Pair(NamedTuple):
    """Reference and machine's own position in every row, (N, m) and (N, k).

    aligned : whether both are along the same axes, so that their difference says something.
    """

    reference: tuple[str, ...]
    own: tuple[str, ...]
    reference_mm: FloatArray
    own_mm: FloatArray
    aligned: bool


def reference_faults(columns: Mapping[str, FloatArray], row: IntArray, same_frame: bool) -> list[DataFault]:
    """Faults of the reference in rows in the order of time.

    columns : name -> (N,).  row : (N,) their numbers.  same_frame : whether reference and model are in one frame.
    """
    faults: list[DataFault] = []
    wrong = np.zeros(len(row), dtype=bool)
    for pair in _pairs(columns, same_frame):
        empty = _no_reading(pair) & ~wrong
        if empty.any():
            value = f"{pair.reference_mm[np.flatnonzero(empty)[0]][0]:.10g}"
            what = f"is {value}{' on all axes' if len(pair.reference) > 1 else ''}: the instrument had no reading"
            faults.append(_left_out("no reading of the reference", row[empty], pair.reference, what))
            wrong |= empty
        frozen, places, first = _frozen(pair, ~wrong)
        if frozen.any():
            what = (
                f"holds the digits of row {row[first]} at {places} different places of the machine: the instrument "
                "repeats itself"
            )
            faults.append(_left_out("the reference repeats itself", row[frozen], pair.reference, what))
            wrong |= frozen
        standing, first = _unfollowed(pair, ~wrong)
        if standing.any():
            what = (
                f"holds the digits of row {row[first]} while the reference moves by "
                f"{_moved_mm(pair, standing):.3g} mm: the machine's own position was not recorded"
            )
            faults.append(_left_out("the machine's own position repeats itself", row[standing], pair.own, what))
            wrong |= standing
    return faults


def _left_out(reason: str, rows: IntArray, columns: tuple[str, ...], what: str) -> DataFault:
    return DataFault(reason, tuple(sorted(rows.tolist())), columns, what, "rows left out")


def _pairs(columns: Mapping[str, FloatArray], same_frame: bool) -> Iterable[_Pair]:
    """The reference as a whole with the machine's position, links with their scales, then each axis alone."""
    names = list(columns)
    # another reflector at the same pose is another place
    scales = tuple(name for name in names if re.fullmatch(r"scale_\d+_mm|commanded_[xyz]_mm|reflector", name))
    references = {m[1]: name for name in names if (m := re.fullmatch(r"reference_([xyz])_(?!rad)\w+", name))}
    models = {m[1]: name for name in names if (m := re.fullmatch(r"model_([xyz])_(?!rad)\w+", name))}
    axes = [axis for axis in "xyz" if axis in references]

    def pair(reference: Iterable[str], own: Iterable[str], aligned: bool) -> _Pair:
        reference, own = tuple(reference), tuple(own)
        reference_mm, own_mm = (np.column_stack([columns[name] for name in each]) for each in (reference, own))
        return _Pair(reference, own, reference_mm, own_mm, aligned)

    modelled = [axis for axis in axes if axis in models]
    if len(axes) > 1 and (modelled or scales):
        whole = modelled == axes
        yield pair(
            [references[axis] for axis in axes],
            [models[axis] for axis in modelled] or scales,
            whole and same_frame,
        )
    for name in names:
        if match := re.fullmatch(r"reference_link_(\d+)_(\w+)", name):
            own = f"model_link_{match[1]}_{match[2]}", f"scale_{match[1]}_mm"
            if present := [other for other in own if other in columns]:
                yield pair([name], present[:1], True)
    if same_frame:
        for axis in modelled:
            yield pair([references[axis]], [models[axis]], True)


def _missed(pair: _Pair) -> tuple[FloatArray, FloatArray]:
    """What the model misses of the reference, (N, m), from its median; and its robust standard deviation (m,)."""
    missed = pair.reference_mm - pair.own_mm
    known = np.isfinite(missed).all(axis=1)
    if known.sum() < 2:
        return np.full_like(missed, np.nan), np.full(missed.shape[1], np.inf)
    missed = missed - np.median(missed[known], axis=0)
    return missed, trimmed_scale(missed[known])


def _place_mm(pair: _Pair) -> float:
    """How far apart places are that the reference must tell apart."""
    return max(LIMITS.place_mm, LIMITS.min_digits * max(map(_last_digit_mm, pair.reference_mm.T)))


def _last_digit_mm(values_mm: FloatArray) -> float:
    """The step of which all differences of values (N,) are multiples; 0 where there is none."""
    different = np.unique(values_mm[np.isfinite(values_mm)])
    if len(different) < 2:
        return 0.0
    step = float(np.diff(different).min())
    counts = (different - different[0]) / step
    return step if (np.abs(counts - np.round(counts)) < 1e-3).all() else 0.0


def _no_reading(pair: _Pair) -> BoolArray:
    """(N,) rows in which all coordinates are 0, or the same number of nines, and the machine is elsewhere."""
    values = pair.reference_mm
    # what stands for no reading: 0, and numbers such as -999, 9999 and -99999
    number = np.abs(values[:, 0])
    nines = (number >= 99) & np.isin(number, 10.0 ** np.arange(2, 13) - 1)
    suspicious = (values == values[:, :1]).all(axis=1) & ((number == 0) | nines)
    if not suspicious.any() or suspicious.mean() > LIMITS.max_share:
        return np.zeros(len(values), dtype=bool)
    good = values[~suspicious & np.isfinite(values).all(axis=1)]
    if len(good) < 2:
        return np.zeros(len(values), dtype=bool)
    if pair.aligned:
        others = pair._replace(reference_mm=np.where(suspicious[:, None], np.nan, values))
        _, scale = _missed(others)
        usual = np.nanmedian(others.reference_mm - others.own_mm, axis=0)
        far = np.abs(values - pair.own_mm - usual) > np.maximum(LIMITS.min_sigmas * scale, _place_mm(others))
        return np.asarray(suspicious & far.any(axis=1))
    if values.shape[1] < 2:
        return np.zeros(len(values), dtype=bool)
    low, high = good.min(axis=0), good.max(axis=0)
    size = np.maximum(high - low, _place_mm(pair))
    return np.asarray(suspicious & ((values < low - size) | (values > high + size)).any(axis=1))


def _runs(digits: FloatArray, use: BoolArray) -> list[tuple[int, int]]:
    """First row and end of each stretch of rows with the same digits (N, m)."""
    same = np.concatenate([[False], (digits[1:] == digits[:-1]).all(axis=1) & use[1:] & use[:-1], [False]])
    begins, ends = np.flatnonzero(~same[:-1] & same[1:]), np.flatnonzero(same[:-1] & ~same[1:]) + 1
    return list(zip(begins.tolist(), ends.tolist(), strict=True))


def _frozen(pair: _Pair, use: BoolArray) -> tuple[BoolArray, int, int]:
    """(N,) rows that repeat the digits of the one before while the machine is at another place; the number of places;
    and the row that is repeated first.

    Of two or three axes together the digits never repeat. A single axis may stand while the others move: there the
    model must miss the frozen rows by far more than the others.
    """
    frozen, places, first = np.zeros(len(use), dtype=bool), 0, -1
    place_mm = _place_mm(pair)
    for begin, end in _runs(pair.reference_mm, use):
        number = _different_places(pair.own_mm[begin:end], place_mm)
        if number < 2 or end - begin > LIMITS.max_share * len(use):
            continue
        if len(pair.reference) == 1 and not _is_missed(pair, begin, end, place_mm):
            continue
        frozen[begin + 1 : end] = True
        places += number
        first = begin if first < 0 else first
    return frozen, places, first


def _is_missed(pair: _Pair, begin: int, end: int, place_mm: float) -> bool:
    """Whether in a run of one axis the model moves by far more than it misses elsewhere."""
    if end - begin < LIMITS.min_run:
        return False
    rest = np.ones(len(pair.own_mm), dtype=bool)
    rest[begin:end] = False
    missed = (pair.reference_mm - pair.own_mm)[rest]
    missed = missed[np.isfinite(missed)]
    if len(missed) < 2 or np.ptp(pair.reference_mm[rest][np.isfinite(pair.reference_mm[rest])]) == 0:
        return False
    scale = float(trimmed_scale((missed - np.median(missed))[:, None])[0])
    return bool(
        np.nanmax(pair.own_mm[begin:end]) - np.nanmin(pair.own_mm[begin:end]) > max(LIMITS.min_sigmas * scale, place_mm)
    )


def _unfollowed(pair: _Pair, use: BoolArray) -> tuple[BoolArray, int]:
    """(N,) rows that repeat the digits of the machine's own position while the reference goes from place to place;
    and the row that is repeated first."""
    standing, first = np.zeros(len(use), dtype=bool), -1
    if len(pair.reference) == 1:
        return standing, first
    limit_mm = LIMITS.min_unfollowed_mm
    if pair.aligned:
        limit_mm = max(limit_mm, LIMITS.min_sigmas * float(np.max(_missed(pair)[1])))
    for begin, end in _runs(pair.own_mm, use):
        if end - begin < LIMITS.min_run or end - begin > LIMITS.max_share * len(use):
            continue
        reference_mm = pair.reference_mm[begin:end]
        reference_mm = reference_mm[np.isfinite(reference_mm).all(axis=1)]
        if len(reference_mm) < LIMITS.min_run:
            continue
        away = np.abs(reference_mm - np.median(reference_mm, axis=0)).max(axis=1)
        if np.mean(away > limit_mm) > 1 / 2 and _different_places(reference_mm, limit_mm) > 2:
            standing[begin + 1 : end] = True
            first = begin if first < 0 else first
    return standing, first


def _moved_mm(pair: _Pair, rows: BoolArray) -> float:
    return float(np.ptp(pair.reference_mm[rows], axis=0).max())


def _different_places(where_mm: FloatArray, place_mm: float) -> int:
    """Number of cells of a grid of `place_mm` with these rows (N, d); 1 if all are within one cell's width.

    Rows with an empty cell say nothing of where they are.
    """
    known = where_mm[np.isfinite(where_mm).all(axis=1)]
    if len(known) < 2 or np.ptp(known, axis=0).max(initial=0) <= place_mm:
        return 1
    return len(np.unique(np.round(known / place_mm), axis=0))
