"""What any set of candidates leaves on rows left out, and what it is judged by."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.diagnosis.candidates.candidates import Candidate
from compd.diagnosis.candidates.plausibility import is_plausible, is_undetermined, with_slack
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.search.regression import NormalEquations, RegressionData, Regressors, normal_equations

# A loss is at least this share of what it was without any candidate: rounding.
MIN_LOSS = 1e-9


@dataclass(frozen=True)
class Subset:
    """Candidates by their place, rising, and the cross-validated loss that they leave.

    cv_loss : mean square per value on rows that were left out, in squares of the noise floor.
    """

    members: tuple[int, ...]
    cv_loss: float


class SubsetLosses:
    """Losses, scores and estimates of sets of candidates for one residual.

    A set S is judged by its score, which is to be small::

        score(S) = log max(L(S), phi) + sum_{k in S} price_k

    with L the mean square on rows left out, and phi = 1 where the noise is known, else 0: below the floor nothing is
    gained. The logarithm is, up to constants, -2 log likelihood per value of a normal error of unknown variance, which
    is not below the noise's: it asks for the same share of what is left far above the floor and at it.

    Example::

        losses = problem.losses(problem.candidates)
        losses.evaluate([(0,), (0, 3)])  # [Subset((0,), 5.2), Subset((0, 3), 1.03)]
    """

    def __init__(
        self,
        data: RegressionData,
        candidates: Sequence[Candidate],
        values: Sequence[FloatArray],
        criteria: Criteria,
        least_loss: float,
    ) -> None:
        """values : columns (R, m, P) of each candidate, whitened, on the rows of the data.  least_loss : phi."""
        self.data, self.candidates, self.values, self.criteria = data, tuple(candidates), tuple(values), criteria
        regressors = [Regressors(v, candidate.largest) for v, candidate in zip(values, candidates, strict=True)]
        self.equations: NormalEquations
        self.equations, self._indices = normal_equations(data, regressors)
        self._nuisance_index = np.arange(data.nuisance.values.shape[2])
        self._testable = np.array(
            [self.equations.testable_splits(index, criteria.most_in_one_fold) for index in self._indices]
        ).reshape(len(candidates), len(data.splits))
        self._prices = np.array([candidate.price(criteria) for candidate in candidates])
        self.floor_known = least_loss > 0
        self._least_loss = max(least_loss, MIN_LOSS * self.baseline)
        self._losses: dict[tuple[int, ...], float] = {(): self.baseline}
        self._by_row: dict[tuple[tuple[int, ...], bytes], FloatArray] = {}

    @property
    def baseline(self) -> float:
        """Cross-validated loss without any candidate, L(0)."""
        return self.equations.nuisance_cv_loss

    @cached_property
    def describes(self) -> bool:
        """Whether descriptions are among the candidates."""
        return any(candidate.kind in ("description", "change") for candidate in self.candidates)

    @cached_property
    def constant(self) -> int | None:
        """Place of the constant among the candidates; None where it is fitted along in any case."""
        return next((k for k, candidate in enumerate(self.candidates) if candidate.kind == "constant"), None)

    def described(self, members: Iterable[int]) -> tuple[int, ...]:
        """Those of some members that name no cause, but for the constant."""
        return tuple(k for k in members if self.candidates[k].kind not in ("effect", "constant"))

    def number_price(self, member: int) -> float:
        """The price of a member's numbers beyond its first."""
        return self.criteria.number_price * (self.candidates[member].parameter_count - 1)

    def name(self, member: int) -> str:
        """The id of a candidate's effect."""
        return self.candidates[member].name

    def evaluate(self, sets: Iterable[Iterable[int]]) -> list[Subset]:
        """Cross-validated losses; sets that no split can test are left out. Each set is computed once."""
        keys = list(dict.fromkeys(tuple(sorted(members)) for members in sets))
        new = [key for key in keys if key not in self._losses]
        if new:
            testable = np.array([self._testable[list(members)].all(axis=0) for members in new])
            losses = self.equations.cv_losses([self.index(members) for members in new], testable)
            self._losses.update(zip(new, losses.tolist(), strict=True))
        return [Subset(key, self._losses[key]) for key in keys if np.isfinite(self._losses[key])]

    def loss(self, members: Iterable[int]) -> float:
        """Cross-validated loss of one set; inf where no split can test it."""
        subsets = self.evaluate([members])
        return subsets[0].cv_loss if subsets else float("inf")

    def log_loss(self, loss: float) -> float:
        """Logarithm of a loss, not below the floor."""
        return float(np.log(max(loss, self._least_loss)))

    def score(self, subset: Subset) -> float:
        """The logarithm of the loss and the prices of the members: what the best set minimizes."""
        return self.log_loss(subset.cv_loss) + float(self._prices[list(subset.members)].sum())

    def price(self, member: int) -> float:
        """What the log loss must fall by for this member."""
        return float(self._prices[member])

    @property
    def scored(self) -> list[Subset]:
        """Every set that was evaluated so far, the best first."""
        subsets = [Subset(key, loss) for key, loss in self._losses.items() if np.isfinite(loss)]
        return sorted(subsets, key=self.score)

    @cached_property
    def best_variants(self) -> dict[str, Subset]:
        """By effect, its best choice of nonlinear constants, alone; the best effect first."""
        variants: dict[str, Subset] = {}
        alone = self.evaluate([(k,) for k in range(len(self.candidates))])
        for subset in sorted(alone, key=lambda subset: subset.cv_loss):
            variants.setdefault(self.name(subset.members[0]), subset)
        return variants

    def estimates(self, members: Sequence[int]) -> list[tuple[FloatArray, FloatArray]]:
        """Parameters (P,) and covariance (P, P) of each member, fitted together on all rows.

        The covariance is scaled by the mean square left where that is above the noise floor.
        """
        theta, covariance, left = self.equations.estimate(self.index(members))
        covariance = covariance * max(left, self._least_loss)
        estimates, begin = [], len(self._nuisance_index)
        for k in members:
            end = begin + len(self._indices[k])
            estimates.append((theta[begin:end], covariance[begin:end, begin:end]))
            begin = end
        return estimates

    def is_plausible(self, members: Sequence[int]) -> bool:
        """Whether every parameter of every effect is plausible, and at least one of each is determined.

        A cause may be weaker than is usual: plausible ranges reach to nought. Parameters that nearly cancel may be far
        outside together; they are plausible where parameters within the ranges leave little more.
        """
        within = True
        for k, (theta, covariance) in zip(members, self.estimates(members), strict=True):
            candidate = self.candidates[k]
            if candidate.kind not in ("effect", "proxy", "change"):
                continue
            std = np.sqrt(np.diag(covariance))
            allowed = candidate.allowed(self.criteria.rough_factor)
            for (low, high), value, error in zip(allowed, theta, std, strict=True):
                limits = (min(low, 0.0), max(high, 0.0))
                within &= is_plausible(limits, float(value), float(error), self.criteria)
            if is_undetermined(candidate.limits, std):
                return False
        return (within or self._fits_within(members)) and not self._has_twins(members)

    def _has_twins(self, members: Sequence[int]) -> bool:
        """Whether two effects do the same with opposite signs and nearly cancel: they are one cause, or none."""
        kinds = [self.candidates[k].kind for k in members]
        if kinds.count("effect") < 2:
            return False
        ordered = sorted(members, key=lambda k: self.candidates[k].kind == "effect")
        effects = [k for k in ordered if self.candidates[k].kind == "effect"]
        products = self.equations.products_beside(self.index(ordered), [len(self._indices[k]) for k in effects])
        size = np.sqrt(np.maximum(np.diag(products), 1e-300))
        together = size**2 + (size**2)[:, None] + 2 * products
        opposite = products < -self.criteria.twin_cosine * np.outer(size, size)
        return bool((opposite & (together < self.criteria.twin_share * np.minimum.outer(size, size) ** 2)).any())

    def _fits_within(self, members: Sequence[int]) -> bool:
        """Whether parameters within the ranges of several effects leave hardly more than those without limits."""
        if len(members) < 2:
            return False
        index = self.index(members)
        nothing_known = np.tile([-np.inf, np.inf], (len(self._nuisance_index), 1))
        limits = [self.candidates[k].allowed(self.criteria.rough_factor) for k in members]
        bounded = self.equations.bounded_loss(
            index, np.concatenate([nothing_known, *(with_slack(limit, self.criteria) for limit in limits)])
        )
        _, _, left = self.equations.estimate(index)
        return self.log_loss(bounded) - self.log_loss(left) <= self.criteria.bounded_price

    def gain(self, members: Sequence[int], without: Sequence[int]) -> tuple[float, float]:
        """How much less a set leaves than another on rows left out, and the standard error of that; per value.

        The standard error is from sums over the B blocks of rows, within which residuals may be correlated::

            std = sqrt(B / (B - 1) sum_b (d_b - mean d)^2),  d_b = sum of the differences in block b
        """
        more, less = self._block_losses(members, without)
        by_block = less - more
        count = len(by_block)
        spread = float(np.sqrt(count / max(count - 1, 1) * ((by_block - by_block.mean()) ** 2).sum()))
        return float(by_block.sum()) / self.data.value_count, spread / self.data.value_count

    def is_sure(self, members: Sequence[int], without: Sequence[int]) -> bool:
        """Whether a set leaves less than another by more than may be chance: in squares, or as a share in most blocks.

        Where one block holds most of the squares, as the start of a warm-up does, squares say nothing of the others.
        The share of block b is log(L_b' / L_b) of its losses, neither below the floor, with the standard error of its
        mean over the blocks.
        """
        gain, std = self.gain(members, without)
        if gain >= self.criteria.least_sigmas * std:
            return True
        more, less = self._block_losses(members, without)
        least = self._least_loss * np.bincount(self.data.block) * self.data.y.shape[1]
        share = np.log(np.maximum(less, least) / np.maximum(more, least))
        std = float(share.std(ddof=1)) / np.sqrt(len(share)) if len(share) > 1 else np.inf
        return gain > 0 and float(share.mean()) >= self.criteria.least_sigmas * std

    def lead(self, members: Sequence[int], other: Sequence[int]) -> tuple[float, float]:
        """By how much a set scores below another on rows left out, and the standard error of that.

        The difference of the logarithms is linear in the blocks' sums for small changes of these, and its standard
        error that of `gain`: what noise does to a loss below the floor changes no score.
        """
        own, others = self._block_losses(members, other)
        values = np.bincount(self.data.block) * self.data.y.shape[1]
        difference, by_block = 0.0, np.zeros(len(own))
        for sign, squares in ((1.0, others), (-1.0, own)):
            loss = float(squares.sum()) / self.data.value_count
            difference += sign * self.log_loss(loss)
            if loss > self._least_loss:
                by_block += sign * (squares / loss - values) / self.data.value_count
        prices = float(self._prices[list(other)].sum() - self._prices[list(members)].sum())
        count = len(by_block)
        spread = np.sqrt(count / max(count - 1, 1) * ((by_block - by_block.mean()) ** 2).sum())
        return difference + prices, float(spread)

    def fold_losses(self, members: Sequence[int]) -> FloatArray:
        """(F,) mean square per value in each fold of the first split, by parameters learned without it; empty where it
        cannot test the set."""
        if not self._testable[list(members), 0].all():
            return np.zeros(0)
        squares = self.equations.fold_losses(self.index(members)[None])[0][self.data.split_of_fold == 0]
        return np.asarray(squares / (np.bincount(self.data.splits[0]) * self.data.y.shape[1]))

    def _block_losses(self, members: Sequence[int], without: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """(B,) sums of squares that two sets leave in each block of rows, in the splits that test both."""
        testable: BoolArray = np.asarray(self._testable[[*members, *without]].all(axis=0))
        block = self.data.block
        of_set = [
            np.bincount(block, self._row_losses(each, testable)).astype(np.float64) for each in (members, without)
        ]
        return of_set[0], of_set[1]

    def nuisance_with(self, members: Iterable[int]) -> Regressors:
        """The nuisance columns and those of some candidates."""
        nuisance = self.data.nuisance
        values = [nuisance.values, *(self.values[k] for k in members)]
        largest = [nuisance.largest, *(self.candidates[k].largest for k in members)]
        return Regressors(np.concatenate(values, axis=2), np.concatenate(largest))

    def index(self, members: Iterable[int]) -> IntArray:
        """Columns of a set among the normal equations, the nuisance columns first."""
        return np.concatenate([self._nuisance_index, *(self._indices[k] for k in members)]).astype(np.int64)

    def _row_losses(self, members: Sequence[int], testable: BoolArray) -> FloatArray:
        """(R,) squares left in each row by parameters learned without its fold, averaged over some splits (splits,)."""
        members = tuple(sorted(members))
        key = members, testable.tobytes()
        if key in self._by_row:
            return self._by_row[key]
        index = self.index(members)
        columns = np.concatenate([self.data.nuisance.values, *(self.values[k] for k in members)], axis=2)
        losses = np.zeros(len(self.data.y))
        for split, fold in enumerate(self.data.splits):
            if not testable[split]:
                continue
            theta = self.equations.theta_by_fold(index, split)
            left = self.data.y - np.einsum("rmp,rp->rm", columns, theta[fold])
            losses += (left**2).sum(axis=1)
        self._by_row[key] = losses / max(int(testable.sum()), 1)
        return self._by_row[key]
