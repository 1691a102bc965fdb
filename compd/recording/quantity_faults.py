"""Cells of a measured quantity that are no measurement: single wild values, what stands for no reading, a gauge that
hangs."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.data_fault import DataFault
from compd.recording.fault_criteria import LIMITS
from compd.statistics import last_digit_um, trimmed_scale
from compd.text import join_words
from compd.units import unit_of

# What changes little from row to row, by its name or its unit: a jump there and back is none of theirs.
_SLOW = re.compile(r"(?:temperature|pressure|humidity)_\w+|\w+_(?:degC|hPa)")
# Loads may be put on for a single row.
_LOADS = frozenset({"N", "mN", "kN", "kgf", "kg", "g", "Nm"})
# Numbers that devices and people write where nothing was read.
_SENTINELS = frozenset({85.0, -127.0, 127.0, 32767.0, -32768.0, 65535.0, 3276.7, -3276.8, 6553.5, 327.67, -327.68})
_NINES = re.compile(r"-?9{3,}(?:\.9+)?|-?9{2,}\.9+")
MIN_ABSURD = 1e9
_SHOWN_VALUES = 3


def quantity_faults(quantities: Mapping[str, FloatArray], row: IntArray) -> list[DataFault]:
    """Faults of quantities in rows in the order of time.

    quantities : name -> (N,), nan where a cell is empty.  row : (N,) their numbers.
    """
    faults: list[DataFault] = []
    for name, values in quantities.items():
        known = np.flatnonzero(np.isfinite(values))
        if len(known) < LIMITS.min_values or np.ptp(values[known]) == 0:
            continue
        slow = _SLOW.fullmatch(name) is not None
        of_known, sure = _sentinels(values[known], slow, unit_of(name) in _LOADS)
        if not of_known.any() and slow:
            of_known, sure = _jumps_back(values[known]), True
        if of_known.any():
            others = values[known][~of_known]
            shown = list(dict.fromkeys(f"{value:.10g}" for value in values[known][of_known]))
            shown = [*shown[:_SHOWN_VALUES], *(["..."] if len(shown) > _SHOWN_VALUES else [])]
            what = f"is {join_words(shown)}, where all others are {others.min():.6g} to {others.max():.6g}"
            rows = tuple(sorted(row[known[of_known]].tolist()))
            faults.append(DataFault(f"a wild value of {name}", rows, (name,), what, "cells empty" if sure else "used"))
        elif slow and (hanging := _hanging(values[known])).any():
            value = f"{values[known][hanging][0]:.10g}"
            what = f"is {value} all the time, where else it changes from row to row: does the gauge hang?"
            rows = tuple(sorted(row[known[hanging]].tolist()))
            faults.append(DataFault(f"{name} hangs", rows, (name,), what, "used"))
    return faults


def hanging_reference(columns: Mapping[str, FloatArray], row: IntArray, told: Sequence[DataFault]) -> list[DataFault]:
    """Columns of the reference that hang while the machine may stand: asked about.

    told : faults of the reference that were found already; their rows are not told twice.
    """
    rows_told = {r for fault in told for r in fault.rows}
    faults: list[DataFault] = []
    for name, values in columns.items():
        known = np.flatnonzero(np.isfinite(values) & ~np.isin(row, list(rows_told)))
        if not re.fullmatch(r"reference_(?:[xyz]|link_\d+|distance)_\w+", name) or len(known) < LIMITS.min_values:
            continue
        if (hanging := _hanging(values[known])).any():
            what = f"is {values[known][hanging][0]:.10g} all the time, where else it changes: does the instrument hang?"
            rows = tuple(sorted(row[known[hanging]].tolist()))
            faults.append(DataFault(f"{name} hangs", rows, (name,), what, "used"))
    return faults


def without_wild(name: str, values: FloatArray, row: IntArray, faults: list[DataFault]) -> FloatArray:
    """(N,) the values of a quantity, nan in cells that some faults take as empty."""
    rows = [r for fault in faults if fault.consequence == "cells empty" and name in fault.columns for r in fault.rows]
    return np.where(np.isin(row, rows), np.nan, values) if rows else values


def _sentinels(values: FloatArray, slow: bool, load: bool) -> tuple[BoolArray, bool]:
    """(K,) values that stand for no reading, and whether that is sure.

    The farthest value from the median, with all that have its digits; then the next.
    """
    wild, sure = np.zeros(len(values), dtype=bool), True
    for _ in range(_SHOWN_VALUES):
        rest = values[~wild]
        far = rest[np.argmax(np.abs(rest - np.median(rest)))]
        new = values == far
        others = values[~wild & ~new]
        if len(others) < LIMITS.min_values or (wild | new).mean() > LIMITS.max_sentinel_share:
            break
        low, high = float(others.min()), float(others.max())
        gap = low - far if far < low else far - high
        different = len(np.unique(others))
        if different < max(LIMITS.min_different, LIMITS.min_different_share * len(others)) or high == low:
            break
        special = far in _SENTINELS or _NINES.fullmatch(f"{far:.10g}") is not None or abs(far) >= MIN_ABSURD
        if gap <= (LIMITS.min_ranges_slow if slow or special else LIMITS.min_ranges) * (high - low):
            break
        wild |= new
        sure = sure and (not load or special or new.sum() > 1)
    return wild, sure


def _jumps_back(values: FloatArray) -> BoolArray:
    """(K,) at most two values in a row of something slow that lie far from those before and after."""
    steps = np.diff(values)
    digit = float(last_digit_um(values[:, None])[0])
    scale = max(float(trimmed_scale(steps[:, None])[0]) / np.sqrt(2.0), digit)
    low, high = np.quantile(values, [0.05, 0.95])
    limit = max(LIMITS.min_step_sigmas * scale, LIMITS.min_range_share * float(high - low))
    if limit == 0:
        return np.zeros(len(values), dtype=bool)
    wild: BoolArray = np.abs(values - _of_neighbours(values)) > limit
    for begin, end in _stretches(wild):
        # a value that something leads up to, or away from, is on its way
        steps_there = [abs(steps[edge]) for edge in (begin - 1, end - 1) if 0 <= edge < len(steps)]
        beyond = [abs(steps[edge]) for edge in (begin - 2, end) if 0 <= edge < len(steps)]
        if end - begin > 2 or min(steps_there) <= max(limit, LIMITS.min_jump * max(beyond)):
            wild[begin:end] = False
    return wild if 0 < wild.sum() <= max(2.0, LIMITS.max_wild_share * len(values)) else np.zeros_like(wild)


def _of_neighbours(values: FloatArray) -> FloatArray:
    """(K,) median of the values around each."""
    around = np.pad(values, LIMITS.neighbours // 2, mode="reflect")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(around, LIMITS.neighbours), axis=1))


def _hanging(values: FloatArray) -> BoolArray:
    """(K,) the longest stretch with the same digits, where chance cannot have made it."""
    same = np.diff(values) == 0
    stretches = sorted(_stretches(same), key=lambda stretch: stretch[0] - stretch[1])
    nothing = np.zeros(len(values), dtype=bool)
    if not stretches:
        return nothing
    begin, end = stretches[0]
    rest = np.delete(same, np.arange(begin, end))
    if end - begin < LIMITS.min_hanging_rows or len(rest) < LIMITS.min_hanging_rows:
        return nothing
    changing = 1.0 - float(rest.mean())
    second = stretches[1][1] - stretches[1][0] if len(stretches) > 1 else 0
    if changing < LIMITS.min_changing or end - begin < 3 * second:
        return nothing
    if (1.0 - min(changing, 0.99)) ** (end - begin) > LIMITS.max_hanging_chance:
        return nothing
    if end < len(same):
        # what stands while a slow thing turns, or is held, goes on without a jump
        usual = float(np.quantile(np.abs(np.delete(np.diff(values), np.arange(begin, min(end + 1, len(same))))), 0.95))
        if abs(values[end + 1] - values[end]) <= LIMITS.min_jump * usual:
            return nothing
    elif values[end] == round(values[end]):
        return nothing  # a temperature that is held shows the number at which it is set
    nothing[begin : end + 1] = True
    return nothing


def _stretches(flags: BoolArray) -> list[tuple[int, int]]:
    """Begin and end of each stretch of true flags (K,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
