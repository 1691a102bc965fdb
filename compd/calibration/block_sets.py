"""The numbers of a machine averaged over which of its blocks are off at all.

A machine whose joints were drilled elsewhere may have scales as drawn. To fit every block costs precision there; to
drop each that seems of little use costs it where all are off. So each set s of blocks is fitted, its numbers with their
tolerances as prior and the others at the drawing, and the results are averaged with the probability of the set given
the poses (Hoeting, Madigan, Raftery, Volinsky, Statist. Sci. 14 (1999) 382):

    p_s ~ prior_s evidence_s,  ln evidence_s = (b_s^T C_s b_s + ln |C_s| - ln |S_s|) / 2,

with A, b, C, S of `prior_fit`. The evidence is the probability of all poses, each predicted from those before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.calibration.criteria import CalibrationCriteria
from compd.calibration.parameters import Block
from compd.calibration.prior_fit import Normal, PriorFit


class BlockSets(NamedTuple):
    """Sets of blocks that may be off, beside the others as drawn.

    inside : (K, B).  log_prior : (K,).  scale : (B,) of the tolerances.  block_of : (P,) of the numbers.
    refused : (B,) blocks that these poses cannot test: in no set. Their tolerance counts in the covariance, by what
    their error would do to the numbers that are fitted (S. F. Schmidt, Adv. Control Systems 3 (1966) 293).
    """

    inside: BoolArray
    log_prior: FloatArray
    scale: FloatArray
    block_of: IntArray
    refused: BoolArray

    @property
    def free(self) -> BoolArray:
        """(P,) numbers that are in any set."""
        inside: BoolArray = np.asarray(self.inside.any(axis=0))
        return np.asarray(inside[self.block_of])

    @property
    def none(self) -> BlockSets:
        """The empty set alone: the machine as drawn."""
        empty = ~self.inside.any(axis=1)
        return self._replace(inside=self.inside[empty], log_prior=self.log_prior[empty])

    @property
    def whole(self) -> BlockSets:
        """The largest set alone: every block that these poses can test is off."""
        largest = np.array([int(self.inside.sum(axis=1).argmax())])
        return self._replace(inside=self.inside[largest], log_prior=self.log_prior[largest])

    def averaged(self, normal: Normal) -> PriorFit:
        """Mean and covariance of the numbers."""
        weight, fits = self._fits(normal)
        x = np.zeros(len(normal.b))
        C = np.zeros_like(normal.A)
        for own, (numbers, values, covariance) in zip(weight, fits, strict=True):
            x[numbers] += own * values
            C[np.ix_(numbers, numbers)] += own * (covariance + np.outer(values, values))
        C -= np.outer(x, x)
        rest = self.refused[self.block_of]
        prior = self.scale[self.block_of[rest]] ** 2
        moved = C @ normal.A[:, rest]
        C = C + (moved * prior) @ moved.T
        C[:, rest] = -moved * prior
        C[rest] = C[:, rest].T
        C[np.ix_(rest, rest)] = np.diag(prior)
        return PriorFit(x, self.scale, C)

    def likely(self, normal: Normal) -> BlockSets:
        """Those sets that the poses leave likely."""
        weight, _ = self._fits(normal)
        kept = weight >= CalibrationCriteria.likely_share * weight.max()
        return self._replace(inside=self.inside[kept], log_prior=self.log_prior[kept])

    def _fits(self, normal: Normal) -> tuple[FloatArray, list[tuple[IntArray, FloatArray, FloatArray]]]:
        """(K,) probabilities; and of each set its numbers, their values and their covariance."""
        evidence = self.log_prior.copy()
        fits: list[tuple[IntArray, FloatArray, FloatArray]] = []
        for k, inside in enumerate(self.inside):
            numbers = np.flatnonzero(inside[self.block_of])
            prior = self.scale[self.block_of[numbers]] ** 2
            C = np.asarray(np.linalg.inv(normal.A[np.ix_(numbers, numbers)] + np.diag(1 / prior)), dtype=np.float64)
            values = np.asarray(C @ normal.b[numbers])
            evidence[k] += (normal.b[numbers] @ values + np.linalg.slogdet(C)[1] - np.log(prior).sum()) / 2
            fits.append((numbers, values, C))
        weight = np.exp(evidence - evidence.max())
        return np.asarray(weight / weight.sum()), fits


def block_sets(
    blocks: Sequence[Block], block_of: IntArray, scale: FloatArray, refused: Sequence[int] = ()
) -> BlockSets:
    """Every set of the blocks but those refused."""
    count = len(blocks)
    out = np.isin(np.arange(count), list(refused))
    inside = (np.arange(2**count)[:, None] >> np.arange(count) & 1).astype(bool)
    inside = inside[~inside[:, out].any(axis=1)]
    off = np.array([CalibrationCriteria.off if block.drawn else CalibrationCriteria.off_undrawn for block in blocks])
    log_prior = inside[:, ~out] @ np.log(off / (1 - off))[~out]
    return BlockSets(inside, log_prior, scale, block_of, out)
