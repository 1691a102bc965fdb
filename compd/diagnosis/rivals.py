"""Candidates that these rows cannot tell apart, and how alike they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compd.diagnosis.selection import PER_NUMBER
from compd.diagnosis.significance import Projection
from compd.diagnosis.subset_search import Contest, Entry, Members

# Losses closer than so many standard errors of their difference are the same.
SAME = 2.0
# Fewer numbers win where the difference is within this many (Breiman's rule), or within PER_NUMBER.
SIMPLER = 1.0
# Nor are losses that differ by less than this, in squares of the floor: that much the two disturbances of a fifth of it
# that a machine always has can add on either side, and the form of an effect.
ALIKE = 0.1
# A candidate that misses more than this share of what another explains is no rival, whatever the errors.
FAR = 0.3


@dataclass(frozen=True)
class Rival:
    """Another effect in the place of one of a set: its cosine with it on these rows, and by how much more it leaves.

    excess : per number, in squares of the floor; std : its standard error.
    """

    member: int
    name: str
    cosine: float
    excess: float
    std: float


def simplest(contest: Contest, chosen: Entry) -> Entry:
    """The set with each member replaced by a simpler one that does as well; its order is kept."""
    members = chosen.members
    for place, k in enumerate(members):
        for other in _instead(contest, members, place):
            saved = contest.candidates[k].numbers - contest.candidates[other.members[place]].numbers
            if saved <= 0:
                continue
            if other.loss - chosen.loss > FAR * (contest.base - chosen.loss):
                break
            excess, std = contest.excess(other.members, members)
            if excess <= max(SIMPLER * std, PER_NUMBER * saved) and contest.is_plausible(other.members):
                members = other.members
                break
    return Entry(members, contest.entries([members])[0].loss) if members else chosen


def rivals(contest: Contest, members: Members, place: int) -> tuple[Rival, ...]:
    """Effects that would do as well in one place of a set, the best first."""
    without = tuple(k for i, k in enumerate(members) if i != place)
    worth = contest.entries([without])[0].loss if without else contest.base
    own = contest.entries([members])[0].loss
    found: list[Rival] = []
    for other in _instead(contest, members, place):
        k = other.members[place]
        if contest.name(k) in [one.name for one in found] or other.loss - own > FAR * (worth - own):
            continue
        excess, std = contest.excess(other.members, members)
        cosine = likeness(contest, members, place, k)
        # one with more numbers is bound to do about as well where it holds the other as a special case
        general = contest.candidates[k].numbers > contest.candidates[members[place]].numbers
        if excess > max(SAME * std, 0.0 if general else ALIKE) or not contest.is_plausible(other.members):
            continue
        found.append(Rival(k, contest.name(k), cosine, excess, std))
    return tuple(found)


def likeness(contest: Contest, members: Members, place: int, other: int) -> float:
    """Cosine between what a member of a set does and the nearest that another candidate could do, 0 to 1.

    Both without what the rest of the set explains: the cosine of the principal angle to the fitted direction.
    """
    rest = [contest.values[k] for i, k in enumerate(members) if i != place]
    held = np.concatenate([contest.evidence.always.values, *rest], axis=2)
    theta, _ = contest.fitted(members)[place]
    beside = Projection(held)
    effect = beside(contest.values[members[place]] @ theta).ravel()
    columns = beside(contest.values[other])
    q, _ = np.linalg.qr(columns.reshape(len(effect), -1))
    size = float(np.linalg.norm(effect))
    return min(float(np.linalg.norm(q.T @ effect)) / size, 1.0) if size > 0 else 0.0


def _instead(contest: Contest, members: Members, place: int) -> list[Entry]:
    """Sets with another library effect in one place, the best first."""
    taken = {contest.name(k) for k in members}
    sets = [
        (*members[:place], k, *members[place + 1 :])
        for k, candidate in enumerate(contest.candidates)
        if candidate.name not in taken and not candidate.described
    ]
    return sorted(contest.entries(sets), key=lambda one: one.loss)
