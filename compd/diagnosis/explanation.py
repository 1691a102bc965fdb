"""The best explanation of a residual: effects of the library against descriptions of what it follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from compd.diagnosis.empirical_search import EmpiricalFit, Everything, by_covariate, held_out_losses
from compd.diagnosis.problem import DiagnosisProblem
from compd.diagnosis.regression import Block
from compd.diagnosis.rivals import simplest
from compd.diagnosis.selection import at_floor
from compd.diagnosis.subset_search import Contest, Members

# Descriptions that compete with the library's effects: of the best so many covariates, beside each basis.
COMPETING = 4

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Explanation:
    """The best set of candidates.

    contest : library and descriptions together.  members : the set.  effects : the library's among them, the one
    that explains most first.  searched : descriptions at their best beside the effects, the promising ones.
    """

    contest: Contest
    members: Members
    effects: Members
    searched: tuple[EmpiricalFit, ...]

    @property
    def described(self) -> bool:
        """Whether it takes a description: then something acts that the library does not have."""
        return len(self.effects) < len(self.members)


def explain(bench: DiagnosisProblem, progress: Progress) -> Explanation:
    """Effects alone first; then effects and descriptions on equal terms, but for what a description costs."""
    progress("every effect, every pair, the best triples, on rows left out")
    library = Contest(bench.evidence, bench.pool.candidates, bench.values)
    chosen = library.best()
    if not chosen.members and at_floor(library.base):
        return Explanation(library, (), (), ())
    progress("every covariate, lag, direction and time")
    everything = Everything(bench.whiten)
    competing: dict[object, EmpiricalFit] = {}
    searched: list[EmpiricalFit] = []
    for basis in dict.fromkeys([(), chosen.members[:1], chosen.members]):
        held = held_block(library, basis)
        searched = everything.best(bench.evidence.y, held.values)
        losses = held_out_losses(bench.evidence, held, searched)
        for k in by_covariate(losses, searched, library.base)[:COMPETING]:
            about = searched[k].description
            competing[about.covariate, about.form, about.port, about.per_link] = searched[k]
    descriptions = list(competing.values())
    columns_um = [bench.whiten.columns_um(one.description, one.effect, one.constant) for one in descriptions]
    progress("effects against descriptions")
    contest = Contest(
        bench.evidence,
        [*bench.pool.candidates, *(one.candidate(um) for one, um in zip(descriptions, columns_um, strict=True))],
        [*bench.values, *(one.values for one in descriptions)],
    )
    best = contest.best()
    if not any(contest.candidates[k].described for k in best.members):
        best = simplest(contest, best)
    effects = tuple(k for k in best.members if not contest.candidates[k].described)
    return Explanation(contest, best.members, _by_weight(contest, effects), tuple(searched))


def held_block(contest: Contest, members: Members) -> Block:
    """What every fit holds, and some candidates, as one block."""
    always = contest.evidence.always
    values = [always.values, *(contest.values[k] for k in members)]
    largest = [always.largest, *(contest.candidates[k].largest for k in members)]
    return Block(np.concatenate(values, axis=2), np.concatenate(largest))


def _by_weight(contest: Contest, members: Members) -> Members:
    """The one first that alone leaves least, then the one that beside it leaves least."""
    order: Members = ()
    while len(order) < len(members):
        rest = [k for k in members if k not in order]
        order = min(contest.entries([(*order, k) for k in rest]), key=lambda one: one.loss).members
    return order
