"""Best-subset selection: every candidate, every pair and the best triples, compared on rows that were left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.diagnosis.candidates import Candidate
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.regression import NormalEquations, RegressionData, Regressors, normal_equations
from compd.diagnosis.selection import is_plausible, is_undetermined, penalty

# Pairs that are extended to triples: all triples of 50 candidates would be 20,000.
BEST_PAIRS = 15


@dataclass(frozen=True)
class Subset:
    """Candidates by their place in the search, and the cross-validated loss that they leave.

    cv_loss : mean square per value on rows that were left out, in squares of the noise floor.
    """

    members: tuple[int, ...]
    cv_loss: float


class SubsetSearch:
    """Selects the few candidates that explain one residual.

    The best subset S minimizes the cross-validated loss and a penalty for each member::

        L(S) + sum_{k in S} penalty_k,    penalty_k = factor_k max(least_gain, form_error (L(0) - 1))

    among the subsets whose parameters are all plausible and whose members are all needed. Subsets of three and fewer
    are searched exhaustively, but for triples, which extend the best pairs alone. (Best-subset selection with a
    penalty on size: Hastie, Tibshirani, Friedman, The Elements of Statistical Learning, 2nd ed. (2009), 3.3.1, 7.10.)

    Example::

        search = SubsetSearch(data, pool.candidates, values, Criteria())
        [search.name(k) for k in search.best_subset().members]  # ["link_elasticity", "scale_expansion"]
    """

    def __init__(
        self,
        data: RegressionData,
        candidates: Sequence[Candidate],
        values: Sequence[FloatArray],
        criteria: Criteria,
    ) -> None:
        """values : columns (R, m, P) of each candidate, whitened, on the rows of the data."""
        self.data, self.candidates, self.values, self.criteria = data, tuple(candidates), tuple(values), criteria
        regressors = [Regressors(v, candidate.largest) for v, candidate in zip(values, candidates, strict=True)]
        self.equations: NormalEquations
        self.equations, self._indices = normal_equations(data, regressors)
        self._nuisance_index = np.arange(data.nuisance.values.shape[2])
        self._testable = np.array(
            [self.equations.testable_splits(index, criteria.most_in_one_fold) for index in self._indices]
        ).reshape(len(candidates), len(data.splits))

    @property
    def baseline(self) -> float:
        """Cross-validated loss without any candidate, L(0)."""
        return self.equations.nuisance_cv_loss

    def name(self, member: int) -> str:
        """The id of a candidate's effect."""
        return self.candidates[member].name

    def evaluate(self, subsets: Sequence[tuple[int, ...]]) -> list[Subset]:
        """Cross-validated losses; subsets that no split can test are left out."""
        if not subsets:
            return []
        testable = np.array([self._testable[list(members)].all(axis=0) for members in subsets])  # of no member: all
        losses = self.equations.cv_losses([self._index(members) for members in subsets], testable)
        return [
            Subset(members, float(loss)) for members, loss in zip(subsets, losses, strict=True) if np.isfinite(loss)
        ]

    @cached_property
    def singles(self) -> list[Subset]:
        """Every candidate alone, the best first."""
        return sorted(self.evaluate([(k,) for k in range(len(self.candidates))]), key=lambda subset: subset.cv_loss)

    @cached_property
    def best_variants(self) -> dict[str, Subset]:
        """By effect, its best choice of nonlinear constants, alone."""
        variants: dict[str, Subset] = {}
        for subset in self.singles:
            variants.setdefault(self.name(subset.members[0]), subset)
        return variants

    @cached_property
    def subsets(self) -> list[Subset]:
        """Singles, pairs, and triples that extend the best pairs."""
        singles = [subset.members[0] for subset in self.singles]
        pairs = self.evaluate([(a, b) for a, b in combinations(singles, 2) if self.name(a) != self.name(b)])
        pairs.sort(key=lambda subset: subset.cv_loss)
        triples = {
            tuple(sorted((*pair.members, k)))
            for pair in pairs[:BEST_PAIRS]
            for k in singles
            if self.name(k) not in [self.name(member) for member in pair.members]
        }
        return [*self.singles, *pairs, *self.evaluate(sorted(triples))]

    def penalized_loss(self, subset: Subset) -> float:
        """The subset's loss and its members' penalties: what the best subset minimizes."""
        explained = max(self.baseline - 1.0, 0.0)
        return subset.cv_loss + sum(
            penalty(explained, self.criteria, self.candidates[k].penalty_factor(self.criteria)) for k in subset.members
        )

    def best_subset(self) -> Subset:
        """The best plausible subset of which every member is needed; the empty one where none is worth its penalty."""
        empty = Subset((), self.baseline)
        ranked = sorted([empty, *self.subsets], key=self.penalized_loss)
        acceptable = (
            subset for subset in ranked if self.is_plausible(subset.members) and self._needs_every_member(subset)
        )
        return next(acceptable, empty)

    def _needs_every_member(self, subset: Subset) -> bool:
        """Whether each member takes away most of what is above the floor without it.

        An effect of a wrong form leaves a rest that flexible effects reduce a little; the cause itself removes it.
        Beside others, an effect must also gain a penalty times the root of its number of parameters.
        """
        rests = self.evaluate([tuple(k for k in subset.members if k != member) for member in subset.members])
        losses = np.array([rest.cv_loss for rest in rests])
        if len(losses) < len(subset.members):
            return False
        excess = max(subset.cv_loss - 1.0, 0.0)
        if (losses - 1.0 < excess / (1 - self.criteria.least_removed)).any():
            return False
        parameter_counts = np.array([self.candidates[k].parameter_count for k in subset.members])
        needed_gain = penalty(self.baseline - 1.0, self.criteria) * np.sqrt(parameter_counts)
        return len(losses) < 2 or bool((losses - subset.cv_loss >= needed_gain).all())

    def estimates(self, members: tuple[int, ...]) -> list[tuple[FloatArray, FloatArray]]:
        """Parameters (P,) and covariance (P, P) of each member, fitted together on all rows.

        The covariance is scaled by the mean square left where that is above the noise floor.
        """
        theta, covariance, left = self.equations.estimate(self._index(members))
        covariance = covariance * max(left, 1.0)
        estimates, begin = [], len(self._nuisance_index)
        for k in members:
            end = begin + len(self._indices[k])
            estimates.append((theta[begin:end], covariance[begin:end, begin:end]))
            begin = end
        return estimates

    def is_plausible(self, members: tuple[int, ...]) -> bool:
        """Whether every parameter is plausible, and at least one of each member's is determined."""
        for k, (theta, covariance) in zip(members, self.estimates(members), strict=True):
            candidate = self.candidates[k]
            if candidate.is_empirical:
                continue
            std = np.sqrt(np.diag(covariance))
            for limits, value, error in zip(candidate.limits, theta, std, strict=True):
                if not is_plausible(tuple(limits), float(value), float(error), self.criteria):
                    return False
            if is_undetermined(candidate.limits, std):
                return False
        return True

    def excess_loss(self, members: tuple[int, ...], than: tuple[int, ...]) -> tuple[float, float]:
        """By how much more a subset leaves than another on rows left out, and the standard error of that; per value.

        The standard error is from sums over the B blocks of rows, within which residuals may be correlated::

            std = sqrt(B / (B - 1) sum_b (d_b - mean d)^2),  d_b = sum of the differences in block b
        """
        difference = self._row_losses(members) - self._row_losses(than)
        by_block = np.bincount(self.data.block, difference)
        count = len(by_block)
        spread = float(np.sqrt(count / max(count - 1, 1) * ((by_block - by_block.mean()) ** 2).sum()))
        return float(by_block.sum()) / self.data.value_count, spread / self.data.value_count

    def nuisance_with(self, members: tuple[int, ...]) -> Regressors:
        """The nuisance columns and those of some candidates."""
        nuisance = self.data.nuisance
        values = [nuisance.values, *(self.values[k] for k in members)]
        largest = [nuisance.largest, *(self.candidates[k].largest for k in members)]
        return Regressors(np.concatenate(values, axis=2), np.concatenate(largest))

    def _index(self, members: tuple[int, ...]) -> IntArray:
        """Columns of a subset among the normal equations, the nuisance columns first."""
        return np.concatenate([self._nuisance_index, *(self._indices[k] for k in members)]).astype(np.int64)

    def _row_losses(self, members: tuple[int, ...]) -> FloatArray:
        """(R,) squares left in each row by parameters learned without its fold, averaged over the splits that count."""
        index = self._index(members)
        columns = np.concatenate([self.data.nuisance.values, *(self.values[k] for k in members)], axis=2)
        losses = np.zeros(len(self.data.y))
        testable = np.asarray(self._testable[list(members)].all(axis=0))
        for split, fold in enumerate(self.data.splits):
            if not testable[split]:
                continue
            theta = self.equations.theta_by_fold(index, split)
            for k in range(int(fold.max()) + 1):
                rows = fold == k
                losses[rows] += ((self.data.y[rows] - columns[rows] @ theta[k]) ** 2).sum(axis=1)
        return losses / max(int(testable.sum()), 1)
