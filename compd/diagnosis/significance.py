"""By chance? Every candidate's score beside the scores that noise with the same coherence would have got."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compd.arrays import FloatArray, IntArray

# 1 / (FLIPS + 1) is the smallest chance that can be stated.
FLIPS = 999
SEED = 20260


class Projection:
    """Takes from columns what others (R, m, Q) explain."""

    def __init__(self, others: FloatArray) -> None:
        self._q, _ = np.linalg.qr(others.reshape(others.shape[0] * others.shape[1], others.shape[2]))

    def __call__(self, columns: FloatArray) -> FloatArray:
        """(R, m, P), or (R, m)."""
        flat = columns.reshape(len(self._q), -1)
        return np.asarray((flat - self._q @ (self._q.T @ flat)).reshape(columns.shape))


def chances(families: Sequence[Sequence[FloatArray]], y: FloatArray, left: FloatArray, group: IntArray) -> FloatArray:
    """(K,) chance that noise alone would let the best of all families look as good as each does; searches included.

    families : K lists of a candidate's variants, each (R, m, P), projected on what every fit holds.
    y : (R, m) whitened residual, projected likewise.  left : what the best fit leaves of it: flipped is the noise,
    not the effect, so that an effect that acts in few blocks can be proven.  group : (R,) blocks that are flipped
    whole, by which rows that hang together stay together.
    Max-T: each family's best variant, in standard deviations of its own chance distribution, against the maximum over
    all families. (Wild bootstrap: Cameron, Gelbach, Miller 2008; maximum: Westfall and Young 1993.)
    """
    if not families:
        return np.zeros(0)
    rng = np.random.default_rng(SEED)
    blocks = int(group.max()) + 1
    signs = rng.choice((-1.0, 1.0), (FLIPS, blocks))
    found = np.empty((FLIPS + 1, len(families)))
    for k, variants in enumerate(families):
        found[:, k] = np.max([_scores(columns, y, left, group, signs) for columns in variants], axis=0)
    by_chance = found[1:]
    spread = np.maximum(by_chance.std(axis=0), 1e-12)
    standing = (found - by_chance.mean(axis=0)) / spread
    largest = standing[1:].max(axis=1)
    return np.asarray((1 + (largest[:, None] >= standing[0]).sum(axis=0)) / (FLIPS + 1))


def _scores(columns: FloatArray, y: FloatArray, left: FloatArray, group: IntArray, signs: FloatArray) -> FloatArray:
    """(FLIPS + 1,) squares explained of y, then of `left` with its blocks' signs flipped."""
    flat = columns.reshape(-1, columns.shape[2])
    values, vectors = np.linalg.eigh(flat.T @ flat)
    good = values > 1e-9 * max(float(values.max()), 1e-300)
    if not good.any():
        return np.zeros(len(signs) + 1)
    unit = columns @ (vectors[:, good] / np.sqrt(values[good]))
    rows = np.einsum("rmp,rm->rp", unit, left)
    by_block = np.stack([np.bincount(group, column, minlength=signs.shape[1]) for column in rows.T], axis=1)
    score = np.einsum("rmp,rm->p", unit, y)
    return np.concatenate([[float(score @ score)], ((signs @ by_block) ** 2).sum(axis=1)])
