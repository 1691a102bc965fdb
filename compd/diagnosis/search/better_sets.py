"""How many of the sets that were seen may be better than the one that is named."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import ndtr

from compd.diagnosis.search.significance import OrthogonalComplement
from compd.diagnosis.search.subset_losses import Subset, SubsetLosses

# A probability below this is nought.
LEAST = 1e-4


def better_sets(losses: SubsetLosses, members: tuple[int, ...]) -> float:
    """Expected number of sets that name something else and score better than a set, on rows like these.

    Of all sets that were seen, and of those in which one effect is left out, added or exchanged, each that names other
    effects counts once, at its best. With d by how much its score is above that of the set, and s the standard error of
    d over blocks of rows, it is the better one with the probability Phi(-d / s), the normal distribution::

        sum_j Phi(-d_j / s_j)

    (d and s of held-out scores: Vehtari, Gelman and Gabry, Statistics and Computing 27 (2017) 1413, 5.) Effects that
    make a constant on these rows count as one, as none can be told from another.
    """
    _see_neighbours(losses, members)
    names = _Names(losses)
    own = names.of(members)
    best: dict[frozenset[str], Subset] = {}
    for subset in losses.scored:
        if (named := names.of(subset.members)) != own:
            best.setdefault(named, subset)
        if len(best) >= losses.criteria.probability.max_compared:
            break
    return float(sum(_is_better(losses, subset.members, members) for subset in best.values()))


def _see_neighbours(losses: SubsetLosses, members: tuple[int, ...]) -> None:
    """Evaluate the sets in which one effect is left out, added or exchanged."""
    kinds = [candidate.kind for candidate in losses.candidates]
    effects = [k for k, kind in enumerate(kinds) if kind == "effect"]
    rests = [tuple(k for k in members if k != member) for member in members]
    losses.evaluate([rest for rest, member in zip(rests, members, strict=True) if kinds[member] == "effect"])
    for begin in (members, *rests):
        names = {losses.name(k) for k in begin}
        losses.evaluate((*begin, k) for k in effects if losses.name(k) not in names)


def _is_better(losses: SubsetLosses, other: tuple[int, ...], members: tuple[int, ...]) -> float:
    """Probability that another set scores better; 0 where a number of it is implausible."""
    lead, std = losses.lead(members, other)
    # two scores below the floor differ by their prices alone
    std = float(np.hypot(std, losses.criteria.number_price))
    probability = float(ndtr(-lead / std))
    return probability if probability > LEAST and losses.is_plausible(other) else 0.0


class _Names:
    """What sets name: ids of effects, those that make a constant under one name."""

    def __init__(self, losses: SubsetLosses) -> None:
        self._losses = losses
        self._name_of: dict[int, str] = {}

    def of(self, members: tuple[int, ...]) -> frozenset[str]:
        """What a set names."""
        return frozenset(self._named(members))

    def _named(self, members: tuple[int, ...]) -> Iterator[str]:
        for k in members:
            kind = self._losses.candidates[k].kind
            if kind == "effect" and k not in self._name_of:
                self._name_of[k] = "constant" if self._makes_a_constant(k) else self._losses.name(k)
            if kind in ("effect", "constant"):
                yield self._name_of.get(k, "constant")

    def _makes_a_constant(self, member: int) -> bool:
        """Whether nearly all that an effect may do on these rows, each number at its largest, is a constant."""
        constant = self._losses.constant
        if constant is None:
            return False
        columns = self._losses.values[member] * self._losses.candidates[member].largest
        varying = OrthogonalComplement(self._losses.values[constant])(columns)
        share = 1.0 - float((varying**2).sum()) / max(float((columns**2).sum()), 1e-300)
        return share >= self._losses.criteria.probability.constant_share
