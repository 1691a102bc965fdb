"""What is wrong with rows that no noise explains, in words: a visit of something else, a repeat that disagrees."""

from __future__ import annotations

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.data_fault import DataFault
from compd.display_unit import format_error
from compd.recording import Recording

# Why a row does not count of which nothing more is known.
OUTLIER = "beyond all noise"
# Repeats that lie this share of their distance from one another, or less, agree.
_AGREE_SHARE = 0.1


def outlier_faults(
    row: IntArray, visit: IntArray | None, residual_um: FloatArray, outlier: BoolArray, used: BoolArray, unit: str
) -> list[DataFault]:
    """Rows that do not count, by what is wrong with them.

    row : (N,) their numbers.  visit : (N,) negative for none.  residual_um : (N, m), lengths in `unit`.
    outlier, used : (N,) rows that do not count, and rows that do.
    """
    faults: list[DataFault] = []
    if not outlier.any() or not used.any():
        return faults
    away_um = residual_um - np.median(residual_um[used], axis=0)
    left = outlier.copy()
    in_visit = np.zeros(len(row), dtype=np.int64) - 1 if visit is None else visit
    lone: list[int] = []
    for number in np.unique(in_visit[outlier & (in_visit >= 0)]).tolist():
        rows = outlier & (in_visit == number)
        if rows.sum() < 2 or used[in_visit == number].any():
            continue
        if np.ptp(away_um[rows], axis=0).max() <= _AGREE_SHARE * np.abs(away_um[rows]).max():
            lone.append(number)
    if lone:
        rows = outlier & np.isin(in_visit, lone)
        size = format_error(float(np.abs(away_um[rows]).max()), unit)
        number = Recording.visit_in_file(np.array(lone))[0]
        what = (
            f"the {rows.sum()} repeats of visit {number} agree and lie {size} from all else"
            if len(lone) == 1
            else f"{len(lone)} visits, of which the repeats agree, lie up to {size} from all else"
        )
        what += ": another point, or another moment, was measured"
        faults.append(_left_out("visits that lie far from all else", row[rows], what))
        left &= ~rows
    beside = left & np.isin(in_visit, in_visit[used & (in_visit >= 0)])
    if beside.any():
        size_um = max(
            np.abs(away_um[k] - np.median(away_um[used & (in_visit == in_visit[k])], axis=0)).max()
            for k in np.flatnonzero(beside)
        )
        what = f"up to {format_error(size_um, unit)} from other repeats of the same visit"
        faults.append(_left_out("repeats that disagree with others of their visit", row[beside], what))
        left &= ~beside
    if left.any():
        size_um = np.nanmax(np.abs(away_um[left]))
        what = f"up to {format_error(size_um, unit)} from all else, which no noise explains"
        faults.append(_left_out(OUTLIER, row[left], what))
    return faults


def disagreeing_visits(
    row: IntArray,
    visit: IntArray | None,
    residual_um: FloatArray,
    used: BoolArray,
    noise_um: FloatArray,
    unit: str,
    *,
    min_sigmas: float,
    max_share: float,
) -> list[DataFault]:
    """Visits whose repeats differ by far more than those of all others, and still count.

    noise_um : (m,) scatter of repeats.  min_sigmas : of the difference of two repeats.
    max_share : more of the visits differ so for a reason, such as a direction of approach.
    """
    if visit is None:
        return []
    rows = np.flatnonzero(used & (visit >= 0))
    rows = rows[np.argsort(visit[rows], kind="stable")]
    if not len(rows):
        return []
    begins = np.flatnonzero(np.diff(visit[rows], prepend=-1))
    spread_um = np.maximum.reduceat(residual_um[rows], begins) - np.minimum.reduceat(residual_um[rows], begins)
    wide = np.flatnonzero((spread_um > min_sigmas * np.sqrt(2.0) * noise_um).any(axis=1))
    counts = np.diff(np.append(begins, len(rows)))
    repeated = counts > 1
    if not 0 < len(wide) <= max(1, max_share * repeated.sum()):
        return []
    faults = []
    for v in wide:
        of_visit = rows[begins[v] : begins[v] + counts[v]]
        usual_um = float(np.median(spread_um[repeated].max(axis=1)))
        what = (
            f"the repeats of visit {Recording.visit_in_file(visit)[of_visit[0]]} differ by "
            f"{format_error(spread_um[v].max(), unit)}, those of others by {format_error(usual_um, unit)}"
        )
        faults.append(DataFault("repeats that differ", tuple(sorted(row[of_visit].tolist())), (), what, "used"))
    return faults


def _left_out(reason: str, rows: IntArray, what: str) -> DataFault:
    return DataFault(reason, tuple(sorted(rows.tolist())), (), what, "rows left out")
