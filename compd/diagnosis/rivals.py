"""Rivals: effects that explain a recording as well as one that was found, and how collinear the two are."""

from __future__ import annotations

import numpy as np

from compd.diagnosis.findings import Rival
from compd.diagnosis.significance import OrthogonalComplement
from compd.diagnosis.subset_search import Subset, SubsetSearch


def simplify(search: SubsetSearch, subset: Subset) -> Subset:
    """The subset with each member replaced by one with fewer parameters that does as well; the order is kept.

    "As well" is the one-standard-error rule: the simpler subset may leave more by one standard error of the
    difference, or by `gain_per_parameter` for each parameter that it saves (Breiman, Friedman, Olshen, Stone,
    Classification and Regression Trees (1984), 3.4.3).
    """
    criteria = search.criteria
    members = subset.members
    for place, member in enumerate(members):
        for other in _substitutions(search, members, place):
            substitute = search.candidates[other.members[place]]
            saved = search.candidates[member].parameter_count - substitute.parameter_count
            if saved <= 0:
                continue
            if other.cv_loss - subset.cv_loss > criteria.rival_share * (search.baseline - subset.cv_loss):
                break
            excess, std = search.excess_loss(other.members, members)
            allowed = max(criteria.simpler_sigmas * std, criteria.gain_per_parameter * saved)
            if excess <= allowed and search.is_plausible(other.members):
                members = other.members
                break
    return Subset(members, search.evaluate([members])[0].cv_loss) if members else subset


def find_rivals(search: SubsetSearch, members: tuple[int, ...], place: int) -> tuple[Rival, ...]:
    """Effects that would explain as much at one place of a subset, the best first.

    With the loss L, on rows left out, of the subset as it is, without the member, and with another effect in its
    place, the other is a rival where its parameters are plausible and::

        L_other - L <= rival_share (L_without - L)
        L_other - L <= max(rival_sigmas std(L_other - L), rival_loss)

    An effect with more parameters that contains the member as a special case is bound to do about as well; for it
    `rival_loss` is no excuse.
    """
    criteria = search.criteria
    without = tuple(k for position, k in enumerate(members) if position != place)
    loss_without = search.evaluate([without])[0].cv_loss if without else search.baseline
    loss = search.evaluate([members])[0].cv_loss
    rivals: list[Rival] = []
    for other in _substitutions(search, members, place):
        k = other.members[place]
        if search.name(k) in [rival.name for rival in rivals]:
            continue
        if other.cv_loss - loss > criteria.rival_share * (loss_without - loss):
            continue
        excess, std = search.excess_loss(other.members, members)
        more_general = search.candidates[k].parameter_count > search.candidates[members[place]].parameter_count
        allowed = max(criteria.rival_sigmas * std, 0.0 if more_general else criteria.rival_loss)
        if excess > allowed or not search.is_plausible(other.members):
            continue
        rivals.append(Rival(k, search.name(k), collinearity(search, members, place, k), excess, std))
    return tuple(rivals)


def collinearity(search: SubsetSearch, members: tuple[int, ...], place: int, other: int) -> float:
    """Cosine between what a member of a subset does and the nearest that another candidate could do, 0 to 1.

    With e = A theta what the member does, and Q an orthonormal basis of the other candidate's columns, both
    orthogonal to the nuisance columns and the rest of the subset, it is |Q^T e| / |e|: the cosine of the principal
    angle between a line and a subspace (Bjorck and Golub, Mathematics of Computation 27 (1973) 579).
    """
    rest = tuple(k for position, k in enumerate(members) if position != place)
    complement = OrthogonalComplement(search.nuisance_with(rest).values)
    theta, _ = search.estimates(members)[place]
    effect = complement(search.values[members[place]] @ theta).ravel()
    columns = complement(search.values[other])
    q, _ = np.linalg.qr(columns.reshape(len(effect), -1))
    size = float(np.linalg.norm(effect))
    return min(float(np.linalg.norm(q.T @ effect)) / size, 1.0) if size > 0 else 0.0


def _substitutions(search: SubsetSearch, members: tuple[int, ...], place: int) -> list[Subset]:
    """Subsets with another effect of the library at one place, the best first."""
    names = {search.name(k) for k in members}
    subsets = [
        (*members[:place], k, *members[place + 1 :])
        for k, candidate in enumerate(search.candidates)
        if candidate.name not in names and not candidate.is_empirical
    ]
    return sorted(search.evaluate(subsets), key=lambda subset: subset.cv_loss)
