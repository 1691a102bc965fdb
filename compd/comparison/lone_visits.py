"""Visits whose repeats agree, and that lie so far from all else that they measured something else.

Repeats confirm each other: what the model lacks there is to be explained. They do not confirm that the right point was
measured, or at the right moment. A visit, or a few of them, is lone where all its rows are far from what the model
says, the next visit is nearer by a large factor, and nothing that was recorded was different there from everywhere
else: a single visit under load shows what load does.
"""

from __future__ import annotations

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.criteria import ComparisonCriteria


def lone_distance(
    distance: FloatArray,
    use: BoolArray,
    visit: IntArray | None,
    conditions: FloatArray | None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
) -> float:
    """Beyond which a visit is lone; inf where none is.

    distance : (N,) of each row from what the model says, in robust standard deviations of all rows.
    use : (N,) rows that are known.  visit : (N,) number of the visit, negative for none.
    conditions : (N, K) what was recorded beside the reference; None where nothing is known of it.
    """
    if visit is None:
        return np.inf
    rows = np.flatnonzero(use & (visit >= 0))
    rows = rows[np.argsort(visit[rows], kind="stable")]
    begins = np.flatnonzero(np.diff(visit[rows], prepend=-1))
    counts = np.diff(np.append(begins, len(rows)))
    if len(begins) < criteria.fewest_visits or (counts < 2).all():
        return np.inf
    nearest = np.minimum.reduceat(distance[rows], begins)
    nearest[counts < 2] = 0.0  # a row without a repeat is judged alone
    order = np.argsort(-nearest)
    sizes = np.maximum(nearest[order], criteria.outlier_sigmas)
    most = max(1, int(criteria.max_lone_share * len(begins)))
    gaps = np.flatnonzero(sizes[:most] >= criteria.lone_ratio * sizes[1 : most + 1])
    if not len(gaps):
        return np.inf
    number = int(gaps[-1]) + 1
    lone = [rows[begins[v] : begins[v] + counts[v]] for v in order[:number]]
    if conditions is not None:
        others = use.copy()
        others[np.concatenate(lone)] = False
        if any(_is_distinguished(conditions, of_visit, others, criteria.outside_share) for of_visit in lone):
            return np.inf
    return float(np.sqrt(sizes[number - 1] * sizes[number]))


def _is_distinguished(conditions: FloatArray, rows: IntArray, others: BoolArray, outside_share: float) -> bool:
    """Whether some condition of these rows is one that no other row has."""
    for column in conditions.T:
        known, own = column[others], column[rows]
        known, own = known[np.isfinite(known)], own[np.isfinite(own)]
        if not len(known) or not len(own):
            continue
        low, high, value = known.min(), known.max(), np.median(own)
        beyond = outside_share * (high - low)
        if value < low - beyond or value > high + beyond:
            return True
    return False
