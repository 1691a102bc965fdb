"""Whitened least squares with a ridge from plausible ranges, and losses on folds that the fit has not seen.

The prediction is linear in the parameters to within 1e-5, the effects being small. All questions about any set of
candidates are therefore answered from sums of products over each fold (normal equations), without another pass over
the rows; the forward model itself is fitted again only for the effects that are named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.statistics import DIAGONAL_GUARD, ridge_inverse, solve_ridge

# Ridge of a parameter without a plausible range, as a share of its column's sum of squares: conditioning alone.
MIN_RIDGE = 1e-9
# Approximate number of elements of normal equations in a batch of sets of columns.
BATCH = 2_000_000


@dataclass(frozen=True, eq=False)
class Regressors:
    """Columns of a linear model on R rows with m coordinates each.

    values : (R, m, P) by how many standard deviations of the noise each parameter moves the prediction.
    largest : (P,) largest plausible size of each parameter; inf where nothing is known of it.
    """

    values: FloatArray
    largest: FloatArray

    @cached_property
    def ridge(self) -> FloatArray:
        """(P,) ridge of each parameter: 1 / largest^2 + MIN_RIDGE |column|^2.

        The plausible range counts as one measurement of zero with the range as its standard deviation. It bounds what
        the rows do not determine, and is negligible against what they do.
        """
        sum_of_squares = (self.values**2).sum(axis=(0, 1))
        return np.asarray(1.0 / self.largest**2 + MIN_RIDGE * sum_of_squares + 1e-300)


@dataclass(frozen=True, eq=False)
class RegressionData:
    """The residual that candidates are to explain, whitened, and how its rows are divided.

    y : (R, m) residual in standard deviations of the noise.
    splits : each (R,), the fold of each row, numbered from 0.
    block : (R,) block of neighbouring rows within which residuals may be correlated, numbered from 0.
    nuisance : columns of what every fit contains: the effects of the model, and the instrument's frame.
    place : (R,) where the tip was in each row, numbered from 0.
    """

    y: FloatArray
    splits: tuple[IntArray, ...]
    block: IntArray
    nuisance: Regressors
    place: IntArray

    @property
    def value_count(self) -> int:
        """Number of measured values, R m."""
        return int(self.y.size)

    @cached_property
    def split_of_fold(self) -> IntArray:
        """(F,) to which split each fold belongs; the folds of all splits one after the other."""
        return np.concatenate([np.full(int(fold.max()) + 1, number) for number, fold in enumerate(self.splits)])

    @cached_property
    def squares(self) -> FloatArray:
        """(F,) sum of squares of the residual in each fold."""
        return self.products(self.y[:, :, None], self.y[:, :, None])[:, 0, 0]

    def products(self, columns: FloatArray, others: FloatArray) -> FloatArray:
        """(F, P, Q) products of columns (R, m, P) and others (R, m, Q), summed over the rows of each fold."""
        sums = []
        for fold in self.splits:
            for k in range(int(fold.max()) + 1):
                rows = fold == k
                sums.append(columns[rows].reshape(-1, columns.shape[2]).T @ others[rows].reshape(-1, others.shape[2]))
        return np.stack(sums)


class _Scaled(NamedTuple):
    """Normal equations of columns of length 1.

    gram : (F, C, C).  score : (F, C).  held : of each split the sum over its folds (C, C), with the ridge.
    """

    gram: FloatArray
    score: FloatArray
    held: list[FloatArray]


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations of C columns on each of F folds: all that least squares on any of the columns needs.

    gram : (F, C, C) A_f^T A_f.  score : (F, C) A_f^T y_f.  ridge : (C,) lambda, once per fit.

    Without fold f of a split, the parameters are::

        theta_f = (sum_{g != f} A_g^T A_g + diag(lambda))^-1  sum_{g != f} A_g^T y_g

    and the loss on the fold that was left out is |y_f - A_f theta_f|^2, which the sums give as::

        y_f^T y_f - 2 theta_f^T A_f^T y_f + theta_f^T A_f^T A_f theta_f

    (Hastie, Tibshirani, Friedman, The Elements of Statistical Learning, 2nd ed. (2009), 3.4.1 ridge regression and
    7.10 cross-validation.) An example, one column without noise, four rows in two folds::

        nothing = Regressors(np.zeros((4, 1, 0)), np.zeros(0))
        data = RegressionData(y, (np.array([0, 0, 1, 1]),), np.arange(4), nothing, np.arange(4))
        equations, (index,) = normal_equations(data, [Regressors(column, np.array([np.inf]))])
        equations.cv_losses([index], np.array([[True]]))  # about 0.0: each fold predicts the other
    """

    data: RegressionData
    gram: FloatArray
    score: FloatArray
    ridge: FloatArray

    def testable_splits(self, index: IntArray, most_in_one_fold: float) -> BoolArray:
        """(splits,) whether no fold of a split holds more than a share of the columns' sum of squares.

        What acts in one fold alone cannot be learned from the others. Each column counts in units of its ridge.
        """
        size = (self.gram[:, index, index] / self.ridge[index]).sum(axis=1)
        split = self.data.split_of_fold
        shares = [size[split == k].max() / max(size[split == k].sum(), 1e-300) for k in range(split.max() + 1)]
        return np.array(shares) <= most_in_one_fold

    def cv_losses(self, sets: Sequence[IntArray], testable: BoolArray) -> FloatArray:
        """(S,) cross-validated loss of each set of columns: mean square per value on rows that were left out.

        testable : (S, splits) which splits count for a set. The loss is that of the nuisance columns, averaged over
        all splits, times the share that the set leaves of it in the splits that count; nan where none counts.
        """
        losses = np.full(len(sets), np.nan)
        sizes = np.array([len(index) for index in sets])
        for size in np.unique(sizes):
            indices = np.flatnonzero(sizes == size)
            step = max(1, BATCH // (len(self.gram) * max(int(size), 1) ** 2))
            for begin in range(0, len(indices), step):
                batch = indices[begin : begin + step]
                losses[batch] = self._cv_losses_of_one_size(np.stack([sets[k] for k in batch]), testable[batch])
        return losses

    def _cv_losses_of_one_size(self, index: IntArray, testable: BoolArray) -> FloatArray:
        by_fold, split = self.fold_losses(index), self.data.split_of_fold
        left = np.stack([by_fold[:, split == k].sum(axis=1) for k in range(split.max() + 1)], axis=1)
        before = np.array([self.nuisance_fold_losses[split == k].sum() for k in range(split.max() + 1)])
        counted = np.where(testable, before, 0.0).sum(axis=1)
        share = np.where(testable, left, 0.0).sum(axis=1) / np.maximum(counted, 1e-300)
        return np.asarray(np.where(testable.any(axis=1), self.nuisance_cv_loss * share, np.nan))

    def fold_losses(self, index: IntArray) -> FloatArray:
        """(S, F) sum of squares left in each fold by parameters learned from the split's other folds; index (S, p)."""
        scaled = self._scaled
        gram = scaled.gram[:, index[:, :, None], index[:, None, :]]  # (F, S, p, p)
        score = scaled.score[:, index]
        losses = np.empty((len(index), len(gram)))
        for k in range(len(self.data.splits)):
            folds = self.data.split_of_fold == k
            normal = scaled.held[k][index[:, :, None], index[:, None, :]] - gram[folds]
            right = score[folds].sum(axis=0) - score[folds]
            theta = np.linalg.solve(normal, right[..., None])[..., 0]
            left = self.data.squares[folds][:, None] - 2 * (theta * score[folds]).sum(axis=2)
            left += ((gram[folds] @ theta[..., None])[..., 0] * theta).sum(axis=2)
            losses[:, folds] = left.T
        return losses

    @cached_property
    def _scaled(self) -> _Scaled:
        """The equations of columns of length 1, so that many small systems are solved as they are."""
        first = self.data.split_of_fold == 0
        norms = np.sqrt(np.einsum("fcc->c", self.gram[first]) + self.ridge)
        gram = self.gram / (norms[:, None] * norms)
        diagonal = np.diag(self.ridge / norms**2 + DIAGONAL_GUARD)
        held = [gram[self.data.split_of_fold == k].sum(axis=0) + diagonal for k in range(len(self.data.splits))]
        return _Scaled(gram, self.score / norms, held)

    def theta_by_fold(self, index: IntArray, split: int) -> FloatArray:
        """(folds of the split, p) parameters learned from the split's other folds."""
        folds = np.flatnonzero(self.data.split_of_fold == split)
        gram = self.gram[np.ix_(folds, index, index)]
        score = self.score[np.ix_(folds, index)]
        return solve_ridge(
            gram.sum(axis=0) - gram, score.sum(axis=0) - score, np.broadcast_to(self.ridge[index], score.shape)
        )

    @cached_property
    def nuisance_fold_losses(self) -> FloatArray:
        """(F,) sum of squares left in each fold by the nuisance columns alone."""
        return np.asarray(self.fold_losses(np.arange(self.data.nuisance.values.shape[2])[None])[0])

    @property
    def nuisance_cv_loss(self) -> float:
        """Cross-validated loss of the nuisance columns alone, averaged over the splits."""
        return float(self.nuisance_fold_losses.sum()) / (len(self.data.splits) * self.data.value_count)

    def estimate(self, index: IntArray) -> tuple[FloatArray, FloatArray, float]:
        """Parameters (p,) fitted on all rows, their covariance (p, p) at unit noise, and the mean square left."""
        folds = np.flatnonzero(self.data.split_of_fold == 0)
        normal = self.gram[np.ix_(folds, index, index)].sum(axis=0)
        score = self.score[np.ix_(folds, index)].sum(axis=0)
        covariance = ridge_inverse(normal, self.ridge[index])
        theta = covariance @ score
        left = float(self.data.squares[folds].sum()) - 2 * float(theta @ score) + float(theta @ normal @ theta)
        return theta, covariance, left / self.data.value_count

    def products_beside(self, index: IntArray, sizes: Sequence[int]) -> FloatArray:
        """(G, G) products of what the last groups of parameters do, by their sizes, beside all columns before them.

        A diagonal element is the sum of squares of what a group does with the parameters that fit all rows best, an
        element beside it the product of what two groups do.
        """
        folds = self.data.split_of_fold == 0
        normal = self.gram[folds][:, index[:, None], index].sum(axis=0)
        theta, _, _ = self.estimate(index)
        first = len(index) - sum(sizes)
        held = normal[:first, :first] + np.diag(self.ridge[index][:first])
        beside = normal[first:, first:] - normal[first:, :first] @ np.linalg.solve(held, normal[:first, first:])
        group = np.repeat(np.arange(len(sizes)), sizes)
        own = np.equal.outer(np.arange(len(sizes)), group) * theta[first:]
        return np.asarray(own @ beside @ own.T)

    def bounded_loss(self, index: IntArray, limits: FloatArray) -> float:
        """Mean square left by the parameters within limits (p, 2) that fit all rows best."""
        folds = np.flatnonzero(self.data.split_of_fold == 0)
        normal = self.gram[np.ix_(folds, index, index)].sum(axis=0)
        score = self.score[np.ix_(folds, index)].sum(axis=0)
        root = np.linalg.cholesky(normal + np.diag(self.ridge[index])).T
        theta = lsq_linear(root, np.linalg.solve(root.T, score), (limits[:, 0], limits[:, 1])).x
        left = float(self.data.squares[folds].sum()) - 2 * float(theta @ score) + float(theta @ normal @ theta)
        return left / self.data.value_count


def normal_equations(data: RegressionData, candidates: Sequence[Regressors]) -> tuple[NormalEquations, list[IntArray]]:
    """Normal equations of the nuisance columns and all candidates, and the index of each candidate's columns."""
    blocks = [data.nuisance, *candidates]
    columns = np.concatenate([block.values for block in blocks], axis=2)
    ends = np.cumsum([block.values.shape[2] for block in blocks])
    indices = [np.arange(begin, end) for begin, end in pairwise(ends)]
    equations = NormalEquations(
        data,
        data.products(columns, columns),
        data.products(columns, data.y[:, :, None])[:, :, 0],
        np.concatenate([block.ridge for block in blocks]),
    )
    return equations, indices
