"""Rivals: effects that explain a recording as well as one that was found, and how collinear the two are."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from compd.diagnosis.findings import Rival
from compd.diagnosis.search.significance import OrthogonalComplement
from compd.diagnosis.search.subset_losses import SubsetLosses


def find_rivals(losses: SubsetLosses, members: tuple[int, ...], member: int) -> tuple[Rival, ...]:
    """Effects that would explain as much in the place of one member of a set, the best first.

    With the log loss l of the set as it is, of the set without the member, and with another effect in its place, the
    other is a rival where its parameters are plausible, it takes most of what the member takes, and the difference is
    below an effect's price or may be chance::

        L_other - min(L, L_both) <= rival_share (L_without - L)
        l_other - l <= effect_price   or   L_other - L <= least_sigmas std(L_other - L)

    L_both is the loss with the member beside the other: where that still gains, the other takes another part of the
    error, however large, and none of the member's.

    All sets have the constant wherever the member is worth its price beside it, so that rivals are the same
    whether or not one was added to the measured values: a constant tells no effects apart.

    Where the set is at the floor and the noise known, what may be chance has to be at the floor too.

    An effect with more parameters that contains the member as a special case is bound to do about as well; for it the
    price is no excuse. It is one for the constant, which names no cause: whatever can make it may have made it.

    Effects that on these rows do the same are always rivals, however far above the floor.
    """
    criteria = losses.criteria
    members = (*members, *_constant_beside(losses, members, member))
    rest = tuple(k for k in members if k != member)
    loss, without = losses.loss(members), losses.loss(rest)
    sets = {tuple(sorted((*rest, k))): k for k in _substitutes(losses, rest, member)}
    names_cause = losses.candidates[member].kind != "constant"
    rivals: list[Rival] = []
    for subset in sorted(losses.evaluate(sets), key=losses.score):
        key, k = subset.members, sets[subset.members]
        name = losses.candidates[k].effect.id
        if name in [rival.name for rival in rivals]:
            continue
        missed = subset.cv_loss - min(loss, losses.loss((*key, member)))
        if missed > criteria.rival_share * (without - loss):
            continue
        more_general = names_cause and losses.candidates[k].parameter_count > losses.candidates[member].parameter_count
        excess, std = losses.gain(members, key)
        near = losses.log_loss(subset.cv_loss) - losses.log_loss(loss) <= criteria.effect_price and not more_general
        below = subset.cv_loss <= criteria.most_at_floor or loss > criteria.most_at_floor or not losses.floor_known
        if (near or (below and excess <= criteria.least_sigmas * std)) and losses.is_plausible(key):
            rivals.append(Rival(k, name, collinearity(losses, rest, member, k), excess, std))
    return tuple(rivals)


def _constant_beside(losses: SubsetLosses, members: tuple[int, ...], member: int) -> tuple[int, ...]:
    """The constant, where it is a candidate, not in the set, and the member is worth its price beside it."""
    constant = losses.constant
    if constant is None or constant in members:
        return ()
    rest = (constant, *(k for k in members if k != member))
    worth = losses.log_loss(losses.loss(rest)) - losses.log_loss(losses.loss((*rest, member)))
    return (constant,) if worth >= losses.price(member) else ()


def collinearity(losses: SubsetLosses, rest: tuple[int, ...], member: int, other: int) -> float:
    """Cosine between what a member of a set does and the nearest that another candidate could do, 0 to 1.

    With e = A theta what the member does, and Q an orthonormal basis of the other candidate's columns, both
    orthogonal to the nuisance columns and the rest of the set, it is |Q^T e| / |e|: the cosine of the principal
    angle between a line and a subspace (Bjorck and Golub, Mathematics of Computation 27 (1973) 579).
    """
    complement = OrthogonalComplement(losses.nuisance_with(rest).values)
    theta, _ = losses.estimates((member, *rest))[0]
    effect = complement(losses.values[member] @ theta).ravel()
    columns = complement(losses.values[other])
    q, _ = np.linalg.qr(columns.reshape(len(effect), -1))
    size = float(np.linalg.norm(effect))
    return min(float(np.linalg.norm(q.T @ effect)) / size, 1.0) if size > 0 else 0.0


def _substitutes(losses: SubsetLosses, rest: Collection[int], member: int) -> list[int]:
    """Effects of the library that are not in the set."""
    names = {losses.name(k) for k in (*rest, member)}
    return [
        k
        for k, candidate in enumerate(losses.candidates)
        if candidate.name not in names and candidate.kind in ("effect", "proxy")
    ]
