"""Naming: which of several effects that explain a recording alike is named; the others are its rivals."""

from __future__ import annotations

from compd.diagnosis.search.rivals import find_rivals
from compd.diagnosis.search.subset_losses import SubsetLosses


def named_members(losses: SubsetLosses, members: tuple[int, ...]) -> tuple[int, ...]:
    """The members of the best set, a lone constant and effects with needlessly many numbers replaced by a rival.

    Where nothing but a constant was found, the effect that makes it best is named in its place: beside effects that
    vary, a constant is told on a line of its own; alone, it is what is wrong with the machine.
    """
    if len(members) == 1 and losses.candidates[members[0]].kind == "constant":
        family = find_rivals(losses, members, members[0])
        members = (family[0].member,) if family else members
    return with_fewest_numbers(losses, members)


def with_fewest_numbers(losses: SubsetLosses, members: tuple[int, ...]) -> tuple[int, ...]:
    """Each effect replaced by the rival with the fewest numbers that leaves no more than a standard error above it.

    Nine free numbers describe small disturbances besides, and so they explain a little more than the three that caused
    the error. (One-standard-error rule: Breiman, Friedman, Olshen and Stone, Classification and Regression Trees
    (1984), 3.4.3; Hastie, Tibshirani and Friedman, The Elements of Statistical Learning, 2nd ed. (2009), 7.10.)

    Rivals are compared beside the constant. A rival that is as good only with it takes the constant along, if both
    together have fewer numbers than the effect.
    """
    candidates = losses.candidates
    for member in members:
        if candidates[member].kind != "effect":
            continue
        simpler = [
            rival
            for rival in find_rivals(losses, members, member)
            if candidates[rival.member].kind == "effect"
            and candidates[rival.member].parameter_count < candidates[member].parameter_count
            and rival.excess <= rival.std
        ]
        if simpler:
            simplest = min(simpler, key=lambda rival: (candidates[rival.member].parameter_count, rival.excess))
            members = _with_constant_where_needed(losses, members, member, simplest.member)
    return members


def _with_constant_where_needed(
    losses: SubsetLosses, members: tuple[int, ...], member: int, rival: int
) -> tuple[int, ...]:
    """The members with a rival in the place of one, and the constant if it is worth its price then."""
    candidates, constant = losses.candidates, losses.constant
    others = tuple(rival if k == member else k for k in members)
    if constant is None or constant in others:
        return others
    effects = tuple(k for k in others if candidates[k].kind == "effect")
    both = (*effects, constant, *(k for k in others if k not in effects))
    if losses.log_loss(losses.loss(others)) - losses.log_loss(losses.loss(both)) < losses.price(constant):
        return others
    numbers = candidates[rival].parameter_count + candidates[constant].parameter_count
    return both if numbers < candidates[member].parameter_count else members
