"""Whether a residual is white: nothing but noise has no order in which neighbouring rows are alike.

A residual that is no larger than the noise that somebody declared may be a drift all the same. It is sorted by time, by
place and by everything that was measured; in each order von Neumann's ratio compares the differences of neighbours with
the whole scatter::

    eta = sum_i (r_{i+1} - r_i)^2 / sum_i (r_i - mean r)^2

Of independent values it has the mean 2 and the variance 4 (N - 2) / (N^2 - 1), and is nearly normal (J. von Neumann,
Ann. Math. Stat. 12 (1941) 367; B. I. Hart, ibid. 13 (1942) 207). It sees a step and a curve as well as a line, and
1 - eta / 2 is the share of the scatter that follows the order.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import fdtr, ndtr

from compd.arrays import BoolArray, FloatArray
from compd.columns import ROW_ORDER
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.comparison import Comparison
from compd.comparison.covariate import Covariate
from compd.comparison.noise_floor import (
    NoiseFloor,
    Units,
    contradicting_factor,
    from_differences,
    repeat_scatter,
)
from compd.recording import sigma_key
from compd.text import percent_text


class Structure(NamedTuple):
    """What a coordinate of a residual follows: its label, the order, the share of its scatter, and the p-value."""

    label: str
    order: str
    share: float
    p_value: float


def row_orders(aligned: AlignedRecording) -> dict[str, FloatArray]:
    """Quantities (N,) in whose order rows are neighbours: time, place, everything measured."""
    recording = aligned.recording
    places = {
        axis: column for axis, column in zip("xyz", aligned.rows.tip_M_mm.T, strict=True) if np.isfinite(column).any()
    }
    measured = {
        name: values
        for name, values in recording.quantities.items()
        if not Covariate.why_none(name, values[np.isfinite(values)])
    }
    return {"time" if recording.has_time else ROW_ORDER: recording.time_s, **places, **measured}


def counted_by_neighbours(comparison: Comparison, left_um: FloatArray | None = None) -> Comparison | None:
    """The comparison with what neighbouring rows show as its noise, where they contradict a declaration; None where
    they do not, or where repeats show the noise.

    left_um : (N, m) what an explanation leaves of the residual, where that is more than what is declared; nan in rows
        that do not count. None where the residual itself is no more.
    """
    if comparison.floor.source != "declared":
        return None
    return _not_white(comparison) if left_um is None else _white_and_larger(comparison, left_um)


def _not_white(comparison: Comparison) -> Comparison | None:
    """The comparison counted anew where the residual is not white although it is no larger than the declaration."""
    found = _follows(comparison.aligned, comparison.residual_um, comparison.used)
    if found is None:
        return None
    units = Units(comparison.aligned.unit, comparison.floor.angles)
    estimate = _estimate(comparison, comparison.residual_um, comparison.used)
    remark = (
        f"{found.label} follows {found.order} ({percent_text(found.share)} of its scatter), although the declared "
        f"noise of {units.text(comparison.floor.by_axis_um)} is no smaller; neighbouring rows scatter by "
        f"{units.text(estimate.by_axis_um)}: check `{sigma_key(units.unit)}`"
    )
    return _counted_by(comparison, estimate, "the residual is not white, as noise is", remark)


def _white_and_larger(comparison: Comparison, left_um: FloatArray) -> Comparison | None:
    """The comparison counted anew where neighbouring rows scatter by much more than the declaration, and most of what
    is left is white.

    What is white may be an effect that changes from row to row as well: the estimate proves nothing. Repeats that agree
    better than neighbours, however few, show that it is one.
    """
    aligned, floor, criteria = comparison.aligned, comparison.floor, comparison.criteria
    used = comparison.used & np.isfinite(left_um).all(axis=1)
    if used.sum() < criteria.min_trend_rows:
        return None
    estimate = _estimate(comparison, left_um, used)
    factor = contradicting_factor(estimate.by_axis_um, estimate.dof, floor.by_axis_um, criteria)
    shares = [each.share for each in _structures(aligned, left_um, used)]
    if factor < criteria.declared_ratio or any(not 0 < share < criteria.neighbours_share for share in shares):
        return None
    repeats = repeat_scatter(left_um, used, aligned.recording.visit, criteria)
    if repeats is not None:
        ratio = float(np.mean((repeats.by_axis_um / estimate.by_axis_um) ** 2))
        if fdtr(repeats.dof * len(aligned.labels), estimate.dof, ratio) < criteria.contradiction_p_value / 2:
            return None
    units = Units(aligned.unit, floor.angles)
    remark = (
        f"neighbouring rows scatter by {units.text(estimate.by_axis_um)} in every order, and "
        f"{units.text(floor.by_axis_um)} is declared: check `{sigma_key(units.unit)}`, or something changes from row "
        "to row"
    )
    return _counted_by(comparison, estimate, "most of what is left is white, and the declared noise is smaller", remark)


def _estimate(comparison: Comparison, residual_um: FloatArray, used: BoolArray) -> NoiseFloor:
    """What neighbouring rows show in a residual (N, m), of which the rows `used` (N,) count."""
    orders = tuple(order[used] for order in row_orders(comparison.aligned).values())
    return from_differences(residual_um[used], orders, comparison.floor.digit_um, "no visit is repeated")


def _counted_by(comparison: Comparison, estimate: NoiseFloor, why: str, remark: str) -> Comparison:
    """The comparison with an estimate in place of its floor.  why : in words.  remark : what contradicts what."""
    floor = replace(
        estimate,
        how=f"an estimate, from differences of neighbouring rows: {why}",
        contradiction=remark,
        declared_um=comparison.floor.um,
        angles=comparison.floor.angles,
        digit_um=comparison.floor.digit_um,
    )
    return replace(comparison, floor=floor)


def _follows(aligned: AlignedRecording, residual_um: FloatArray, used: BoolArray) -> Structure | None:
    """What the residual follows most surely; None where that may be chance, or is too little to matter."""
    found = [each for each in _structures(aligned, residual_um, used) if each.share > 0]
    return min(found, key=lambda each: (each.p_value, -each.share), default=None)


def _structures(aligned: AlignedRecording, residual_um: FloatArray, used: BoolArray) -> list[Structure]:
    """In which orders neighbouring rows are surely more alike than others, or less: a share below 0 is of these."""
    criteria = aligned.criteria
    rows = np.flatnonzero(used)
    found: list[Structure] = []
    orders = row_orders(aligned)
    tests = len(orders) * len(aligned.labels)
    for name, order in orders.items():
        known = rows[np.isfinite(order[rows])]
        if len(known) < criteria.min_trend_rows or np.ptp(order[known]) == 0:
            continue
        residual = residual_um[known[np.argsort(order[known], kind="stable")]]
        for label, share, p_value in zip(aligned.labels, *_shares(residual), strict=True):
            found.append(Structure(label, name, share, min(1.0, p_value * tests)))
    return [each for each in found if each.p_value < criteria.trend_p_value and abs(each.share) > criteria.white_share]


def _shares(residual: FloatArray) -> tuple[list[float], list[float]]:
    """Of each coordinate of a sorted residual (R, m) the share that follows the order, and its one-sided p-value.

    Below 0 neighbours differ more than others; the p-value is of that, then.
    """
    count = len(residual)
    squares = np.maximum(((residual - residual.mean(axis=0)) ** 2).sum(axis=0), 1e-300)
    eta = (np.diff(residual, axis=0) ** 2).sum(axis=0) / squares
    std = 2.0 * np.sqrt((count - 2) / (count**2 - 1))
    return (1.0 - eta / 2.0).tolist(), ndtr(-np.abs(eta - 2.0) / std).tolist()
