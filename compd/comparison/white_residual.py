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
from scipy.special import ndtr

from compd.arrays import FloatArray
from compd.columns import ROW_ORDER
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.comparison import Comparison
from compd.comparison.covariate import Covariate
from compd.comparison.noise_floor import Units, from_differences
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


def counted_by_neighbours(comparison: Comparison) -> Comparison | None:
    """The comparison with what neighbouring rows show as its noise, where the residual is not white although it is no
    larger than a declaration; None where it is white, or where repeats show the noise."""
    if comparison.floor.source != "declared":
        return None
    found = _structure(comparison)
    if found is None:
        return None
    aligned, floor, used = comparison.aligned, comparison.floor, comparison.used
    orders = tuple(order[used] for order in row_orders(aligned).values())
    estimate = from_differences(comparison.residual_um[used], orders, floor.digit_um, "no visit is repeated")
    units = Units(aligned.unit, floor.angles)
    remark = (
        f"{found.label} follows {found.order} ({percent_text(found.share)} of its scatter), although the declared "
        f"noise of {units.text(floor.by_axis_um)} is no smaller; neighbouring rows scatter by "
        f"{units.text(estimate.by_axis_um)}: check `{sigma_key(aligned.unit)}`"
    )
    how = "an estimate, from differences of neighbouring rows: the residual is not white, as noise is"
    floor = replace(estimate, how=how, contradiction=remark, angles=floor.angles, digit_um=floor.digit_um)
    return replace(comparison, floor=floor)


def _structure(comparison: Comparison) -> Structure | None:
    """What the residual follows most surely; None where that may be chance, or is too little to matter."""
    aligned, criteria = comparison.aligned, comparison.aligned.criteria
    rows = np.flatnonzero(comparison.used)
    found: list[Structure] = []
    orders = row_orders(aligned)
    tests = len(orders) * len(aligned.labels)
    for name, order in orders.items():
        known = rows[np.isfinite(order[rows])]
        if len(known) < criteria.min_trend_rows or np.ptp(order[known]) == 0:
            continue
        residual = comparison.residual_um[known[np.argsort(order[known], kind="stable")]]
        for label, share, p_value in zip(aligned.labels, *_shares(residual), strict=True):
            found.append(Structure(label, name, share, min(1.0, p_value * tests)))
    sure = [each for each in found if each.p_value < criteria.trend_p_value and each.share > criteria.white_share]
    return min(sure, key=lambda each: (each.p_value, -each.share), default=None)


def _shares(residual: FloatArray) -> tuple[list[float], list[float]]:
    """Of each coordinate of a sorted residual (R, m) the share that follows the order, and its one-sided p-value."""
    count = len(residual)
    squares = np.maximum(((residual - residual.mean(axis=0)) ** 2).sum(axis=0), 1e-300)
    eta = (np.diff(residual, axis=0) ** 2).sum(axis=0) / squares
    std = 2.0 * np.sqrt((count - 2) / (count**2 - 1))
    return (1.0 - eta / 2.0).tolist(), ndtr((eta - 2.0) / std).tolist()
