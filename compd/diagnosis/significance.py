"""How probable a candidate's score is by noise alone: max-T test with a wild (sign-flip) bootstrap over blocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compd.arrays import FloatArray, IntArray

# Resamples: 1 / (SIGN_FLIPS + 1) is the smallest p-value that can be stated.
SIGN_FLIPS = 999
SEED = 20260


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


def p_values(families: Sequence[Sequence[FloatArray]], y: FloatArray, noise: FloatArray, block: IntArray) -> FloatArray:
    """(K,) probability that noise alone lets the best of all K families score as high as each family does.

    The score of a candidate A (R, m, P) is the sum of squares that it explains, |A A^+ y|^2, that of a family its
    best variant's. Its distribution under noise is sampled by flipping the signs of whole blocks of the noise, by
    which rows that are correlated stay together (wild cluster bootstrap: Cameron, Gelbach, Miller, Review of Economics
    and Statistics 90 (2008) 414). Scores are standardized by that distribution, and each is compared with the maximum
    over all families in the same resample::

        t_k = (score_k - mean_b score_kb) / std_b score_kb
        p_k = (1 + #{b : max_j t_jb >= t_k}) / (SIGN_FLIPS + 1)

    which controls the probability of even one false finding among all that were tried, nonlinear constants included
    (max-T: Westfall and Young, Resampling-Based Multiple Testing (1993); Romano and Wolf, Econometrica 73 (2005)
    1237).

    families : each a list of variants of one candidate, (R, m, P), orthogonal to the nuisance columns.
    y : (R, m) whitened residual, orthogonal likewise.
    noise : (R, m) what the best explanation leaves of y. It is flipped in place of y, so that an effect which acts in
        few blocks can still be proven.
    block : (R,) block of each row, numbered from 0.

    For example, of two candidates of which the first is in the residual::

        p_values([[first], [second]], y, OrthogonalComplement(first)(y), block)  # array([0.001, 0.6])
    """
    if not families:
        return np.zeros(0)
    rng = np.random.default_rng(SEED)
    signs = rng.choice((-1.0, 1.0), (SIGN_FLIPS, int(block.max()) + 1))
    scores = np.empty((SIGN_FLIPS + 1, len(families)))
    for k, variants in enumerate(families):
        scores[:, k] = np.max([_scores(columns, y, noise, block, signs) for columns in variants], axis=0)
    by_noise = scores[1:]
    spread = np.maximum(by_noise.std(axis=0), 1e-12)
    standardized = (scores - by_noise.mean(axis=0)) / spread
    largest = standardized[1:].max(axis=1)
    return np.asarray((1 + (largest[:, None] >= standardized[0]).sum(axis=0)) / (SIGN_FLIPS + 1))


def _scores(columns: FloatArray, y: FloatArray, noise: FloatArray, block: IntArray, signs: FloatArray) -> FloatArray:
    """(SIGN_FLIPS + 1,) sum of squares explained of y, then of the noise with the signs of its blocks flipped."""
    flat = columns.reshape(-1, columns.shape[2])
    values, vectors = np.linalg.eigh(flat.T @ flat)
    determined = values > 1e-9 * max(float(values.max()), 1e-300)
    if not determined.any():
        return np.zeros(len(signs) + 1)
    orthonormal = columns @ (vectors[:, determined] / np.sqrt(values[determined]))
    by_row = np.einsum("rmp,rm->rp", orthonormal, noise)
    by_block = np.stack([np.bincount(block, column, minlength=signs.shape[1]) for column in by_row.T], axis=1)
    score = np.einsum("rmp,rm->p", orthonormal, y)
    return np.concatenate([[float(score @ score)], ((signs @ by_block) ** 2).sum(axis=1)])
