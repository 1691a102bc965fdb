"""How probable a candidate's score is by noise alone: max-T test with a wild (sign-flip) bootstrap over blocks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc, fdtri

from compd.arrays import FloatArray, IntArray
from compd.diagnosis.search_criteria import SearchCriteria

SEED = 20260
# Scores that differ by less are equal: the same signs of all blocks, turned round.
ROUNDING = 1e-9


class OrthogonalComplement:
    """Projection on what `columns` (R, m, Q) do not explain, by least squares on all rows: I - Q Q^T.

    What is left of a residual and of a candidate's columns gives the candidate's part in a joint fit (Frisch, Waugh,
    Econometrica 1 (1933) 387; Lovell, J. Am. Stat. Assoc. 58 (1963) 993).
    """

    def __init__(self, columns: FloatArray) -> None:
        self._q, _ = np.linalg.qr(columns.reshape(columns.shape[0] * columns.shape[1], columns.shape[2]))

    def __call__(self, values: FloatArray) -> FloatArray:
        """The projection of (R, m, P) or (R, m)."""
        flat = values.reshape(len(self._q), -1)
        return np.asarray((flat - self._q @ (self._q.T @ flat)).reshape(values.shape))


class Family(NamedTuple):
    """Variants of one candidate, of which the best counts, and the residual that they are to explain.

    variants : each (R, m, P).  y : (R, m) whitened. Both are orthogonal to what is fitted beside them.
    best_of : among how many variants, unlike one another, y itself chose each; None where y chose none.
    """

    variants: Sequence[FloatArray]
    y: FloatArray
    best_of: Sequence[int] | None = None


def p_values(families: Sequence[Family], block: IntArray, sign_flips: int = SearchCriteria.sign_flips) -> FloatArray:
    """(K,) probability that noise alone lets the best of all K families score as high as each family does.

    With Q orthonormal columns of a variant, z_b = Q_b^T y_b its scores in each block b of rows, s = sum_b z_b, and
    r_b = z_b - Q_b^T Q_b s the scores of what it leaves, a variant's score is::

        t = (|s|^2 / sum_b |r_b|^2)^(1/3)

    what it explains over what it would explain by chance if only blocks were independent; the third root is nearly
    normal (Wilson and Hilferty, PNAS 17 (1931) 684), so that candidates with few and many numbers compare. Its
    distribution under noise is sampled by flipping the signs of whole blocks of y, by which rows that are correlated
    stay together (wild cluster bootstrap of a studentized score, the null hypothesis imposed: Cameron, Gelbach, Miller,
    Review of Economics and Statistics 90 (2008) 414). A family has the score of its best variant, standardized by that
    distribution, and each is compared with the maximum over all families in the same resample::

        t_k = (t_k - mean_i t_ki) / std_i t_ki
        p_k = (1 + #{i : max_j t_ji >= t_k}) / (sign_flips + 1)

    which controls the probability of even one false finding among all that were tried, nonlinear constants included
    (max-T: Westfall and Young, Resampling-Based Multiple Testing (1993); Romano and Wolf, Econometrica 73 (2005)
    1237). A variant that y itself chose, as a period is by its spectrum, is not chosen anew for each resample; in its
    place counts what the best of as many variants would have (`_as_best_of`). What acts in n blocks alone cannot have a
    p-value below 2^(1 - n): in so few, noise does the same.

    block : (R,) block of each row, numbered from 0.  sign_flips : resamples.

    For example, of two candidates of which the first is in the residual::

        p_values([Family([first], y), Family([second], y)], block)  # array([0.001, 0.6])
    """
    if not families:
        return np.zeros(0)
    rng = np.random.default_rng(SEED)
    signs = np.ones((sign_flips + 1, int(block.max()) + 1))
    signs[1:] = rng.choice((-1.0, 1.0), (sign_flips, signs.shape[1]))
    scores = np.empty((sign_flips + 1, len(families)))
    for k, family in enumerate(families):
        by_variant = []
        for columns, count in zip(family.variants, family.best_of or [1] * len(family.variants), strict=True):
            score = _scores(columns, family.y, block, signs)
            score[1:] = _as_best_of(score[1:], count, columns.shape[2], signs.shape[1])
            by_variant.append(score)
        scores[:, k] = np.max(by_variant, axis=0)
    by_noise = scores[1:]
    spread = np.maximum(by_noise.std(axis=0), ROUNDING)
    standardized = (scores - by_noise.mean(axis=0)) / spread
    largest = standardized[1:].max(axis=1)
    return np.asarray((1 + (largest[:, None] >= standardized[0] - ROUNDING).sum(axis=0)) / (sign_flips + 1))


def _scores(columns: FloatArray, y: FloatArray, block: IntArray, signs: FloatArray) -> FloatArray:
    """(F,) score of y with the signs (F, B) of its blocks."""
    flat = columns.reshape(-1, columns.shape[2])
    values, vectors = np.linalg.eigh(flat.T @ flat)
    determined = values > 1e-9 * max(float(values.max()), 1e-300)
    if not determined.any():
        return np.zeros(len(signs))
    Q = columns @ (vectors[:, determined] / np.sqrt(values[determined]))
    z = _sums(np.einsum("rmp,rm->rp", Q, y), block, signs.shape[1])
    G = _sums(np.einsum("rmp,rmq->rpq", Q, Q).reshape(len(Q), -1), block, len(z)).reshape(len(z), *[Q.shape[2]] * 2)
    s = signs @ z
    left = (z**2).sum() - 2 * ((signs @ np.einsum("bpq,bp->bq", G, z)) * s).sum(axis=1)
    left += np.einsum("fp,pq,fq->f", s, np.einsum("bpq,bpr->qr", G, G), s)
    return np.asarray(((s**2).sum(axis=1) / np.maximum(left, ROUNDING * max((z**2).sum(), 1e-300))) ** (1 / 3))


def _as_best_of(scores: FloatArray, count: int, numbers: int, blocks: int) -> FloatArray:
    """Scores (F,) that noise gives a variant of P `numbers`, raised to those of the best of `count` like it.

    Of a score with distribution D the best of n independent ones has D^n: t becomes the score at which D is D(t)^(1/n)
    (Sidak, J. Am. Stat. Assoc. 62 (1967) 626). Beyond the resamples D must be known: with B blocks t^3 nearly has the F
    distribution with P and P (B - 1) degrees of freedom, being a ratio of squares of as many scores.
    """
    if count <= 1:
        return scores
    dof = numbers, numbers * max(blocks - 1, 1)
    beyond = np.minimum(fdtrc(*dof, scores**3), 1.0 - ROUNDING)
    beyond = np.maximum(-np.expm1(np.log1p(-beyond) / count), ROUNDING)
    return np.asarray(np.maximum(scores, fdtri(*dof, 1.0 - beyond) ** (1 / 3)))


def _sums(by_row: FloatArray, block: IntArray, blocks: int) -> FloatArray:
    """(blocks, P) sums over the rows of each block, of values (R, P)."""
    return np.stack([np.bincount(block, column, minlength=blocks) for column in by_row.T], axis=1)
