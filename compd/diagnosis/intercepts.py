"""Intercepts: where an effect that grows with a quantity is named, what remains at its zero is tried, too."""

from __future__ import annotations

from compd.diagnosis.search.subset_losses import SubsetLosses


def with_intercepts(losses: SubsetLosses, members: tuple[int, ...]) -> tuple[int, ...]:
    """The members, and the intercepts of effects among them that an effect with more numbers took along.

    A gain counts from where the scale reads 0, and where that is nobody knows better than the machine was made: a slope
    is fitted with its intercept (the principle of marginality: Nelder, J. R. Stat. Soc. A 140 (1977) 48; Peixoto, Am.
    Stat. 44 (1990) 26). A search judges each member beside all others, and an intercept is seldom worth its price
    beside an effect that nearly contains it: joints that move along their links are zeros. It is named, before that
    effect, where

    - it is worth its price in that effect's place, and the effect is worth its own beside it;
    - with both, rows left out are predicted as well as without it, to a standard error.

    At the floor nothing more is looked for.
    """
    if losses.floor_known and losses.loss(members) <= losses.criteria.most_at_floor:
        return members
    names = {losses.name(k) for k in members}
    for slope in members:
        wanted = losses.candidates[slope].effect.intercept
        if wanted and wanted not in names and losses.candidates[slope].kind == "effect":
            members = _with_intercept(losses, members, slope, wanted)
            names = {losses.name(k) for k in members}
    return members


def beside(losses: SubsetLosses, members: tuple[int, ...], member: int) -> tuple[int, ...]:
    """The members beside which one of them is judged: the others; of an intercept those that may not contain it."""
    others = tuple(k for k in members if k != member)
    slopes = [k for k in others if losses.candidates[k].effect.intercept == losses.name(member)]
    if not slopes:
        return others
    return tuple(k for k in others if k in slopes or not _may_contain(losses, k, member))


def _with_intercept(losses: SubsetLosses, members: tuple[int, ...], slope: int, wanted: str) -> tuple[int, ...]:
    intercept = next((k for k, candidate in enumerate(losses.candidates) if candidate.name == wanted), None)
    if intercept is None or not losses.is_plausible((*members, intercept)):
        return members
    more, std = losses.gain(members, (*members, intercept))
    if more > std:
        return members
    for place, other in enumerate(members):
        if other == slope or not _may_contain(losses, other, intercept):
            continue
        rest = tuple(k for k in members if k != other)
        if _is_worth(losses, rest, intercept) and _is_worth(losses, (*rest, intercept), other):
            return (*members[:place], intercept, *members[place:])
    return members


def _may_contain(losses: SubsetLosses, member: int, intercept: int) -> bool:
    """Whether an effect has more numbers than an intercept."""
    candidate = losses.candidates[member]
    return candidate.kind == "effect" and candidate.parameter_count > losses.candidates[intercept].parameter_count


def _is_worth(losses: SubsetLosses, members: tuple[int, ...], new: int) -> bool:
    """Whether a candidate beside some members gains its price, and more than may be chance."""
    with_it = (*members, new)
    worth = losses.log_loss(losses.loss(members)) - losses.log_loss(losses.loss(with_it))
    return worth >= losses.price(new) and losses.is_sure(with_it, members)
