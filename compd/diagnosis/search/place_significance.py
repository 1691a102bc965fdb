"""How probable the gain of something that is a matter of place is by chance, where places are measured again.

What is uneven from place to place comes again with every visit: N rows at C places say of a function of place what C
values say. Its gain is compared with what is left from place to place (the test of a model against its lack of fit;
G. E. P. Box, N. R. Draper, Empirical Model-Building and Response Surfaces (1987), 3.9).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import fdtrc

from compd.arrays import FloatArray, IntArray
from compd.diagnosis.search_criteria import SearchCriteria

# Singular values below this share of the largest are rounding.
RANK_CUT = 1e-9


def place_p_value(
    y: FloatArray,
    nuisance: FloatArray,
    variants: Sequence[FloatArray],
    tried: int,
    place: IntArray,
    criteria: SearchCriteria = SearchCriteria(),
) -> float:
    """Probability that places which are uneven by chance let the best of some variants gain as much; 0 where they
    change within places, of which unevenness says nothing.

    y : (R, m).  nuisance : (R, m, Q) what is fitted beside them.  variants : each (R, m, P).
    tried : for how many tries, unlike one another, the best variant counts (Sidak, J. Am. Stat. Assoc. 62 (1967) 626).
    place : (R,) of each row, numbered from 0.

    For example, ten rows at each of three places::

        place = np.repeat(np.arange(3), 10)
        place_p_value(y, np.ones((30, 1, 1)), [x_mm[:, None, None]], 1, place)  # one degree of freedom is left
    """
    of_place = [variant for variant in variants if _between(variant, place) >= criteria.place_share]
    if len(of_place) < len(variants):
        return 0.0
    y_at = _means(y[:, :, None], place)[:, 0]
    beside = _basis(_means(nuisance, place))
    y_at = y_at - beside @ (beside.T @ y_at)
    chances = [1.0]
    for variant in variants:
        columns = _means(variant, place)
        own = _basis(columns - beside @ (beside.T @ columns))
        dof = len(y_at) - beside.shape[1] - own.shape[1]
        if dof < 1 or not own.shape[1]:
            continue
        gained = float(np.sum((own.T @ y_at) ** 2))
        left = max(float(y_at @ y_at) - gained, 1e-300)
        chances.append(float(fdtrc(own.shape[1], dof, gained / own.shape[1] / (left / dof))))
    least = min(chances)
    return float(-np.expm1(tried * np.log1p(-least))) if least < 1.0 else 1.0


def _between(columns: FloatArray, place: IntArray) -> float:
    """Share of the variance of columns (R, m, P) that is between places."""
    centred = columns - columns.mean(axis=0)
    total = float((centred**2).sum())
    within = columns - _by_place(columns, place)[place]
    return 1.0 - float((within**2).sum()) / total if total else 0.0


def _by_place(columns: FloatArray, place: IntArray) -> FloatArray:
    """(C, m, P) mean of columns (R, m, P) at each place."""
    count = np.bincount(place)
    sums = np.zeros((len(count), *columns.shape[1:]))
    np.add.at(sums, place, columns)
    return np.asarray(sums / count[:, None, None])


def _means(columns: FloatArray, place: IntArray) -> FloatArray:
    """(C m, P) of columns (R, m, P)."""
    by_place = _by_place(columns, place)
    return by_place.reshape(by_place.shape[0] * by_place.shape[1], columns.shape[2])


def _basis(columns: FloatArray) -> FloatArray:
    """(K, rank) orthonormal columns of the space of columns (K, P)."""
    if not columns.size:
        return np.zeros((len(columns), 0))
    u, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(u[:, values > RANK_CUT * max(float(values[0]), 1e-300)])
