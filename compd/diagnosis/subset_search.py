"""Which few candidates explain the residual: every one, every pair, the best triples, each on rows left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.diagnosis.candidates import Candidate
from compd.diagnosis.regression import Block, Evidence, Sums, sums
from compd.diagnosis.selection import cost, plausible, untestable

# Pairs that are extended to triples, and sets that are looked at for a plausible one.
BEST_PAIRS = 15

# What a member must take away of the error that is above the floor without it.
LEAST_REMOVED = 0.6

Members = tuple[int, ...]


@dataclass(frozen=True)
class Entry:
    """A set of candidates: loss, the mean square it leaves in left-out rows, in squares of the floor."""

    members: Members
    loss: float


class Contest:
    """Candidates against each other on one residual."""

    def __init__(self, evidence: Evidence, candidates: Sequence[Candidate], values: Sequence[FloatArray]) -> None:
        """values : each candidate's columns (R, m, P), whitened, on the evidence's rows."""
        self.evidence, self.candidates, self.values = evidence, tuple(candidates), tuple(values)
        blocks = [Block(v, c.largest) for v, c in zip(values, candidates, strict=True)]
        self.sums: Sums
        self.sums, self._places = sums(evidence, blocks)
        self._held = np.arange(evidence.always.values.shape[2])
        self._learnable = np.array([self.sums.learnable(place) for place in self._places]).reshape(
            len(candidates), len(evidence.folds)
        )

    @property
    def base(self) -> float:
        """Mean square left by no candidate."""
        return self.sums.base

    def index(self, members: Members) -> IntArray:
        """Columns of a set among the sums."""
        return np.concatenate([self._held, *(self._places[k] for k in members)]).astype(np.int64)

    def entries(self, sets: Sequence[Members]) -> list[Entry]:
        """Sets that can be tested, with their losses."""
        if not sets:
            return []
        counts = np.array([self._learnable[list(one)].all(axis=0) for one in sets])  # of no member: all
        losses = self.sums.held_out([self.index(one) for one in sets], counts)
        return [Entry(one, float(loss)) for one, loss in zip(sets, losses, strict=True) if np.isfinite(loss)]

    @cached_property
    def singles(self) -> list[Entry]:
        """Every candidate alone, the best first."""
        found = self.entries([(k,) for k in range(len(self.candidates))])
        return sorted(found, key=lambda one: one.loss)

    @cached_property
    def best_variant(self) -> dict[str, Entry]:
        """Each effect's best choice of shape constants, alone."""
        found: dict[str, Entry] = {}
        for one in self.singles:
            found.setdefault(self.name(one.members[0]), one)
        return found

    def name(self, member: int) -> str:
        """The effect's id."""
        return self.candidates[member].name

    @cached_property
    def sets(self) -> list[Entry]:
        """Singles, pairs, and triples that extend the best pairs."""
        everyone = [entry.members[0] for entry in self.singles]
        pairs = self.entries([(a, b) for a, b in combinations(everyone, 2) if self.name(a) != self.name(b)])
        pairs.sort(key=lambda one: one.loss)
        triples = {
            tuple(sorted((*pair.members, k)))
            for pair in pairs[:BEST_PAIRS]
            for k in everyone
            if self.name(k) not in [self.name(one) for one in pair.members]
        }
        return [*self.singles, *pairs, *self.entries(sorted(triples))]

    def score(self, entry: Entry) -> float:
        """What it leaves and what its members cost; least is best."""
        explained = max(self.base - 1.0, 0.0)
        return entry.loss + sum(cost(explained, self.candidates[k].price) for k in entry.members)

    def best(self) -> Entry:
        """The best plausible set of which every member is needed; the empty one where nothing is worth its cost."""
        nothing = Entry((), self.base)
        ranked = sorted([nothing, *self.sets], key=self.score)
        return next((one for one in ranked if self.is_plausible(one.members) and self._needs_all(one)), nothing)

    def _needs_all(self, entry: Entry) -> bool:
        """Whether each member takes away most of what is above the floor without it.

        A wrong form leaves a rest that flexible effects nibble at; a cause that is really there removes it.
        """
        without = [tuple(one for one in entry.members if one != k) for k in entry.members]
        losses = np.array([one.loss for one in self.entries(without)])
        if len(losses) < len(without):
            return False
        excess = max(entry.loss - 1.0, 0.0)
        if (losses - 1.0 < excess / (1 - LEAST_REMOVED)).any():
            return False
        numbers = np.array([self.candidates[k].numbers for k in entry.members])
        enough = losses - entry.loss >= cost(self.base - 1.0) * np.sqrt(numbers)
        return len(losses) < 2 or bool(enough.all())

    def fitted(self, members: Members) -> list[tuple[FloatArray, FloatArray]]:
        """Each member's numbers and covariance, fitted together on all rows."""
        index = self.index(members)
        theta, covariance, left = self.sums.fitted(index)
        covariance = covariance * max(left, 1.0)
        found, begin = [], len(self._held)
        for k in members:
            end = begin + len(self._places[k])
            found.append((theta[begin:end], covariance[begin:end, begin:end]))
            begin = end
        return found

    def is_plausible(self, members: Members) -> bool:
        """Whether every number is plausible, and at least one of each member's is known."""
        for k, (theta, covariance) in zip(members, self.fitted(members), strict=True):
            candidate = self.candidates[k]
            if candidate.described:
                continue
            limits = candidate.limits
            std = np.sqrt(np.diag(covariance))
            if not all(plausible(tuple(one), float(t), float(s)) for one, t, s in zip(limits, theta, std, strict=True)):
                return False
            if untestable(limits, std):
                return False
        return True

    def row_losses(self, members: Members) -> FloatArray:
        """(R,) squares left in each row by numbers learned without its fold, averaged over the schemes."""
        index = self.index(members)
        columns = np.concatenate([self.evidence.always.values, *(self.values[k] for k in members)], axis=2)
        found = np.zeros(len(self.evidence.y))
        counts = np.asarray(self._learnable[list(members)].all(axis=0))
        for scheme, fold in enumerate(self.evidence.folds):
            theta = self.sums.theta_by_fold(index, scheme)
            for k in range(int(fold.max()) + 1):
                rows = fold == k
                if counts[scheme]:
                    found[rows] += ((self.evidence.y[rows] - columns[rows] @ theta[k]) ** 2).sum(axis=1)
        return found / max(int(counts.sum()), 1)

    def excess(self, members: Members, than: Members) -> tuple[float, float]:
        """By how much more a set leaves than another, and its standard error, from blocks of rows; per number."""
        difference = self.row_losses(members) - self.row_losses(than)
        blocks = np.bincount(self.evidence.group, difference)
        count = len(blocks)
        spread = float(np.sqrt(count / max(count - 1, 1) * ((blocks - blocks.mean()) ** 2).sum()))
        return float(blocks.sum()) / self.evidence.numbers, spread / self.evidence.numbers
