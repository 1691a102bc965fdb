"""Forward search: the set of candidates that predicts rows left out best for its price, member by member."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from compd.diagnosis.search.subset_losses import Subset, SubsetLosses


def forward_search(losses: SubsetLosses, start: Collection[int] = ()) -> Subset:
    """The set with the best score of which every member is needed and every number plausible.

    Sets are seen by `extend` from `start`; of all that were seen the best one counts that is plausible.

    start : places of candidates to begin with; the empty set is always among those that are compared.
    """
    extend(losses, start)
    return best_acceptable(losses)


def extend(losses: SubsetLosses, start: Collection[int] = (), among: Collection[int] | None = None) -> Subset:
    """The set with the best score that is met on the way from a set to larger ones.

    From `start` the candidate is added with which the set scores best; then each member is exchanged for any other
    candidate as long as that gains; then the next is added. (Forward stepwise selection with exchange: Miller, Subset
    Selection in Regression (2002), chapter 3; the loss by cross-validation: Hastie, Tibshirani, Friedman, The Elements
    of Statistical Learning, 2nd ed. (2009), 3.3.2 and 7.10.)

    among : places of the candidates that may be added; None for all.
    """
    allowed = range(len(losses.candidates)) if among is None else among
    current = best = _best(losses, [tuple(start)]) or Subset((), losses.baseline)
    criteria = losses.criteria.search
    stale = 0
    while len(current.members) < criteria.max_members and stale < criteria.further_members:
        grown = _best(losses, ((*current.members, k) for k in _others(losses, current.members, allowed)))
        if grown is None:
            break
        current = _exchanged(losses, grown, allowed)
        stale = 0 if losses.score(current) < losses.score(best) else stale + 1
        best = min(best, current, key=losses.score)
    return best


def best_acceptable(losses: SubsetLosses) -> Subset:
    """Of all sets that were evaluated the best plausible one, without the members that it does not need.

    A description is no cause where effects do about as well: of the sets that score within an effect's price of the
    best one, that with the fewest descriptions counts. In a set with descriptions, in turn, an effect is no cause where
    a description does better in its place, at the same price and by more than may be chance, or where it is seen only
    beside a description; and in any set an effect with many numbers is none where the constant does about as well.
    """
    best: Subset | None = None
    least_score = float("inf")
    ranked: dict[frozenset[str], Subset] = {}
    for subset in losses.scored:
        ranked.setdefault(frozenset(losses.name(k) for k in subset.members), subset)
        if len(ranked) >= losses.criteria.search.max_ranked:
            break
    for subset in ranked.values():
        if losses.score(subset) > least_score + losses.criteria.effect_price:
            break
        if best is not None and len(losses.described(subset.members)) >= len(losses.described(best.members)):
            continue
        needed = _pruned(losses, subset) if losses.is_plausible(subset.members) else None
        if needed is None or not losses.is_plausible(needed.members):
            continue
        best = needed
        least_score = min(least_score, losses.score(needed))
        if not losses.described(best.members):
            return _with_constant(losses, best)
    return (
        _with_constant(losses, _standing_alone(losses, _proven(losses, best))) if best else Subset((), losses.baseline)
    )


def right_alone(losses: SubsetLosses, subset: Subset) -> Subset:
    """The set with its effects exchanged where, without its descriptions, as many other effects leave less.

    A description of much of the error lets an effect look needed that alone is worse than another. The descriptions are
    sought anew beside those that are exchanged. What changed at a moment stays: it is no other effect's to explain.
    """
    named = tuple(k for k in subset.members if losses.candidates[k].kind in ("effect", "constant", "change"))
    if len(named) == len(subset.members) or not any(losses.candidates[k].kind == "effect" for k in named):
        return subset
    effects = [k for k, candidate in enumerate(losses.candidates) if candidate.kind in ("effect", "constant")]
    alone = Subset(named, losses.loss(named))
    other = _exchanged(losses, alone, effects)
    better = losses.score(other) < losses.score(alone) - losses.criteria.effect_price
    if not better or not losses.is_sure(other.members, alone.members) or not losses.is_plausible(other.members):
        return subset
    described = extend(losses, other.members, losses.described(range(len(losses.candidates))))
    return _standing_alone(losses, _pruned(losses, described))


def _standing_alone(losses: SubsetLosses, subset: Subset) -> Subset:
    """The set without the effects that are worth their price only beside a description: these are not named.

    What changed at a moment stays, as in `right_alone`.
    """
    unseen = True
    while unseen and losses.described(subset.members):
        unseen = False
        alone = tuple(k for k in subset.members if losses.candidates[k].kind in ("effect", "constant", "change"))
        for member in (k for k in alone if losses.candidates[k].kind != "change"):
            without = losses.loss(k for k in alone if k != member)
            if losses.log_loss(without) - losses.log_loss(losses.loss(alone)) < losses.price(member):
                subset, unseen = Subset(*_rest(losses, subset, member)), True
                break
    return subset


def _with_constant(losses: SubsetLosses, subset: Subset) -> Subset:
    """The set with the constant in place of an effect that has more numbers and is not an effect's price better.

    Such an effect contains a constant, beside which its other numbers describe what is too small to be named.
    """
    constant = losses.constant
    if constant is None or constant in subset.members:
        return subset
    numbers = losses.candidates[constant].parameter_count
    large = [
        k
        for k in subset.members
        if losses.candidates[k].kind == "effect" and losses.candidates[k].parameter_count > numbers
    ]
    other = _best(losses, ((*(other for other in subset.members if other != k), constant) for k in large))
    if other is None or losses.score(other) > losses.score(subset) + losses.criteria.effect_price:
        return subset
    simple = _pruned(losses, other)
    # where the constant alone is not worth its price, it is not what the effect contains
    return simple if constant in simple.members else subset


def _proven(losses: SubsetLosses, subset: Subset) -> Subset:
    """The set with each effect replaced by a description that does better in its place."""
    substitutes = losses.described(range(len(losses.candidates)))

    def worth(member: int, loss: float) -> float:
        """Score of a set but for the prices of kinds."""
        return losses.log_loss(loss) + losses.number_price(member)

    replaced = True
    while replaced:
        replaced = False
        for member in subset.members:
            if losses.candidates[member].kind != "effect":
                continue
            rest = tuple(k for k in subset.members if k != member)
            names = {losses.name(k) for k in rest}
            sets = {tuple(sorted((*rest, k))): k for k in substitutes if losses.name(k) not in names}
            others = [(worth(sets[other.members], other.cv_loss), other) for other in losses.evaluate(sets)]
            best_worth, best = min(others, key=lambda pair: pair[0], default=(float("inf"), subset))
            least = losses.criteria.number_price  # a twin differs by the ridge of the range
            if best_worth >= worth(member, subset.cv_loss) - least or not losses.is_plausible(best.members):
                continue
            gain, std = losses.gain(best.members, subset.members)
            if gain >= losses.criteria.least_sigmas * std:
                subset, replaced = _pruned(losses, best), True
                break
    return subset


def _exchanged(losses: SubsetLosses, subset: Subset, allowed: Collection[int]) -> Subset:
    """The set after exchanging members one by one while that lowers the score."""
    gained = True
    while gained:
        gained = False
        for member in subset.members:
            rest = tuple(k for k in subset.members if k != member)
            other = _best(losses, ((*rest, k) for k in _others(losses, rest, allowed) if k != member))
            if other is not None and losses.score(other) < losses.score(subset) - 1e-9:
                subset, gained = other, True
                break
    return subset


def _pruned(losses: SubsetLosses, subset: Subset) -> Subset:
    """The set without the members of which the gain is not worth their price or may be chance, the weakest first."""
    while subset.members:
        weakest: tuple[float, Subset] | None = None
        for member in subset.members:
            rest = Subset(*_rest(losses, subset, member))
            worth = losses.log_loss(rest.cv_loss) - losses.log_loss(subset.cv_loss) - losses.price(member)
            needed = worth >= 0 and losses.is_sure(subset.members, rest.members)
            if not needed and (weakest is None or worth < weakest[0]):
                weakest = worth, rest
        if weakest is None:
            break
        subset = weakest[1]
    return subset


def _rest(losses: SubsetLosses, subset: Subset, member: int) -> tuple[tuple[int, ...], float]:
    rest = tuple(k for k in subset.members if k != member)
    return rest, losses.loss(rest)


def _others(losses: SubsetLosses, members: Collection[int], allowed: Collection[int]) -> list[int]:
    """Candidates that can be added: no two choices of one effect's constants."""
    names = {losses.name(k) for k in members}
    return [k for k in allowed if losses.name(k) not in names]


def _best(losses: SubsetLosses, sets: Iterable[tuple[int, ...]]) -> Subset | None:
    subsets = losses.evaluate(sets)
    return min(subsets, key=losses.score) if subsets else None
