"""What the rows say for and against a set of candidates: whitened least squares, fitted here and tested there.

Everything is linear in the fitted numbers to within 1e-5 (the effects are small), so that sums of products over each
fold answer every question about any set; the real forward model is asked again when numbers are stated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray

# A fold that holds more than this share of what a candidate does cannot be predicted from the others.
MOST_IN_ONE_FOLD = 0.9
# For numbers of which nothing is known: in units of the column's own size, next to nothing.
LEAST_RIDGE = 1e-9
# Sets are solved together in batches of about so many numbers of normal equations.
BATCH = 2_000_000


@dataclass(frozen=True, eq=False)
class Block:
    """Some columns, whitened: values (R, m, P) in standard deviations of the noise, largest (P,) as in a Candidate."""

    values: FloatArray
    largest: FloatArray

    @cached_property
    def ridge(self) -> FloatArray:
        """(P,) what a plausible range says: one measurement of nought with the range as its standard deviation.

        It bounds what the rows do not determine and is felt nowhere else.
        """
        size = (self.values**2).sum(axis=(0, 1))
        return np.asarray(1.0 / self.largest**2 + LEAST_RIDGE * size + 1e-300)


@dataclass(frozen=True, eq=False)
class Evidence:
    """R rows of m coordinates, whitened: the residual in standard deviations of the noise.

    y : (R, m).  folds : schemes, each (R,) numbered from 0.  group : (R,) neighbouring rows that may hang together.
    always : what every fit holds: the model's own numbers, and the instrument's frame.
    """

    y: FloatArray
    folds: tuple[IntArray, ...]
    group: IntArray
    always: Block

    @property
    def numbers(self) -> int:
        """Measured values."""
        return int(self.y.size)

    def sums(self, columns: FloatArray, others: FloatArray) -> FloatArray:
        """(F, P, Q) products of columns (R, m, P) and (R, m, Q), summed over each fold of each scheme in turn."""
        found = []
        for fold in self.folds:
            for k in range(int(fold.max()) + 1):
                rows = fold == k
                found.append(columns[rows].reshape(-1, columns.shape[2]).T @ others[rows].reshape(-1, others.shape[2]))
        return np.stack(found)

    @cached_property
    def scheme(self) -> IntArray:
        """(F,) the scheme of each fold, in the order of `sums`."""
        return np.concatenate([np.full(int(fold.max()) + 1, k) for k, fold in enumerate(self.folds)])

    @cached_property
    def squares(self) -> FloatArray:
        """(F,) the residual's squares in each fold."""
        return self.sums(self.y[:, :, None], self.y[:, :, None])[:, 0, 0]


@dataclass(frozen=True, eq=False)
class Sums:
    """Everything about some columns that least squares needs, by fold: gram (F, C, C), score (F, C), ridge (C,)."""

    evidence: Evidence
    gram: FloatArray
    score: FloatArray
    ridge: FloatArray

    def held_out(self, sets: Sequence[IntArray], counts: BoolArray) -> FloatArray:
        """(S,) mean square left in rows that were left out, in squares of the noise, for sets of columns.

        counts : (S, schemes) whether a scheme counts for a set; nan where none does. What is compared is the gain
        over no candidate, so that schemes that do not count do no harm.
        """
        found = np.full(len(sets), np.nan)
        size = np.array([len(one) for one in sets])
        for p in np.unique(size):
            members = np.flatnonzero(size == p)
            step = max(1, BATCH // (len(self.gram) * max(int(p), 1) ** 2))
            for begin in range(0, len(members), step):
                part = members[begin : begin + step]
                found[part] = self._held_out(np.stack([sets[k] for k in part]), counts[part])
        return found

    def learnable(self, index: IntArray) -> BoolArray:
        """(schemes,) whether the columns' work is spread over the folds, so that each can be predicted from others."""
        work = (self.gram[:, index, index] / self.ridge[index]).sum(axis=1)
        scheme = self.evidence.scheme
        shares = [work[scheme == k].max() / max(work[scheme == k].sum(), 1e-300) for k in range(scheme.max() + 1)]
        return np.array(shares) <= MOST_IN_ONE_FOLD

    def fold_losses(self, index: IntArray) -> FloatArray:
        """(S, F) squares left in each fold by the numbers learned from the scheme's other folds; index (S, p)."""
        evidence = self.evidence
        gram = self.gram[:, index[:, :, None], index[:, None, :]].swapaxes(0, 1)  # (S, F, p, p)
        score = self.score[:, index].swapaxes(0, 1)
        found = np.empty(gram.shape[:2])
        for k in range(len(evidence.folds)):
            folds = evidence.scheme == k
            normal = gram[:, folds].sum(axis=1, keepdims=True) - gram[:, folds]
            right = score[:, folds].sum(axis=1, keepdims=True) - score[:, folds]
            theta = solve(normal, right, self.ridge[index][:, None])
            left = evidence.squares[folds] - 2 * (theta * score[:, folds]).sum(axis=2)
            found[:, folds] = left + np.einsum("sfp,sfpq,sfq->sf", theta, gram[:, folds], theta)
        return found

    def theta_by_fold(self, index: IntArray, scheme: int) -> FloatArray:
        """(folds of the scheme, p) numbers learned from the scheme's other folds."""
        folds = self.evidence.scheme == scheme
        gram = self.gram[folds][:, index[:, None], index]
        score = self.score[folds][:, index]
        return solve(
            gram.sum(axis=0) - gram, score.sum(axis=0) - score, np.broadcast_to(self.ridge[index], score.shape)
        )

    def _held_out(self, index: IntArray, counts: BoolArray) -> FloatArray:
        saved = self.base_losses - self.fold_losses(index)
        scheme = self.evidence.scheme
        gain = np.stack([saved[:, scheme == k].sum(axis=1) for k in range(scheme.max() + 1)], axis=1)
        mean = np.where(counts, gain, 0.0).sum(axis=1) / np.maximum(counts.sum(axis=1), 1) / self.evidence.numbers
        return np.asarray(np.where(counts.any(axis=1), self.base - mean, np.nan))

    @cached_property
    def base_losses(self) -> FloatArray:
        """(F,) what is left in each fold without any candidate."""
        return np.asarray(self.fold_losses(np.arange(self.evidence.always.values.shape[2])[None])[0])

    @property
    def base(self) -> float:
        """Mean square left without any candidate, held out, averaged over the schemes."""
        return float(self.base_losses.sum()) / (len(self.evidence.folds) * self.evidence.numbers)

    def fitted(self, index: IntArray) -> tuple[FloatArray, FloatArray, float]:
        """Numbers (p,), their covariance (p, p) at unit noise, and the mean square left, on all rows."""
        scheme = self.evidence.scheme == 0
        normal = self.gram[scheme][:, index[:, None], index].sum(axis=0)
        score = self.score[scheme][:, index].sum(axis=0)
        inverse = _inverse(normal, self.ridge[index])
        theta = inverse @ score
        left = float(self.evidence.squares[scheme].sum()) - 2 * float(theta @ score) + float(theta @ normal @ theta)
        return theta, inverse, left / self.evidence.numbers


def sums(evidence: Evidence, blocks: Sequence[Block]) -> tuple[Sums, list[IntArray]]:
    """The sums of `always` and the blocks, and where each block's columns are among them."""
    every = [evidence.always, *blocks]
    columns = np.concatenate([block.values for block in every], axis=2)
    ends = np.cumsum([block.values.shape[2] for block in every])
    places = [np.arange(a, b) for a, b in pairwise(ends)]
    found = Sums(
        evidence,
        evidence.sums(columns, columns),
        evidence.sums(columns, evidence.y[:, :, None])[:, :, 0],
        np.concatenate([block.ridge for block in every]),
    )
    return found, places


def solve(normal: FloatArray, right: FloatArray, ridge: FloatArray) -> FloatArray:
    """(..., p) ridge least squares from normal equations (..., p, p), (..., p), ridge (..., p)."""
    p = normal.shape[-1]
    if p == 0:
        return right
    held = normal + ridge[..., None] * np.eye(p)
    size = np.sqrt(np.diagonal(held, axis1=-2, axis2=-1))
    scaled = held / (size[..., :, None] * size[..., None, :]) + 1e-11 * np.eye(p)
    return np.asarray(np.linalg.solve(scaled, (right / size)[..., None])[..., 0] / size)


def _inverse(normal: FloatArray, ridge: FloatArray) -> FloatArray:
    p = len(normal)
    held = normal + ridge * np.eye(p)
    size = np.sqrt(np.diagonal(held))
    scaled = held / np.outer(size, size) + 1e-11 * np.eye(p)
    return np.asarray(np.linalg.inv(scaled) / np.outer(size, size))
