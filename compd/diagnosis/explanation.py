"""The best explanation of a residual: effects of the library in competition with empirical terms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from compd.diagnosis.empirical_search import EmpiricalFit, EmpiricalSearch, best_by_covariate, cv_losses_beside
from compd.diagnosis.problem import DiagnosisProblem
from compd.diagnosis.rivals import simplify
from compd.diagnosis.selection import is_at_floor
from compd.diagnosis.subset_search import SubsetSearch

# Empirical terms that compete with the library's effects: of so many covariates, the best beside each basis.
COMPETING = 4

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Explanation:
    """The best subset of candidates.

    search : the subset search in which it won, over the library and the competing terms.
    members : the subset.  effects : the library's effects in it, the one that explains most first.
    fits : the promising empirical terms beside the effects; empty where none was needed.
    """

    search: SubsetSearch
    members: tuple[int, ...]
    effects: tuple[int, ...]
    fits: tuple[EmpiricalFit, ...]

    @property
    def is_empirical(self) -> bool:
        """Whether it takes an empirical term: something acts that the library does not have."""
        return len(self.effects) < len(self.members)


def explain(problem: DiagnosisProblem, progress: Progress) -> Explanation:
    """Search the library alone; where that leaves more than the floor, the library together with empirical terms.

    A subset of effects and terms wins by the same criteria; terms have the larger penalty. Of an explanation by
    effects alone each is then replaced by a simpler one that does as well.
    """
    criteria, data = problem.criteria, problem.data
    progress("every effect, every pair, the best triples, on rows left out")
    library = SubsetSearch(data, problem.pool.candidates, problem.values, criteria)
    library_best = library.best_subset()
    if not library_best.members and is_at_floor(library.baseline, criteria):
        return Explanation(library, (), (), ())
    progress("every covariate, lag, direction and time")
    empirical = EmpiricalSearch(problem)
    competing: dict[tuple[str, str, str, bool], EmpiricalFit] = {}
    fits: list[EmpiricalFit] = []
    for basis in dict.fromkeys([(), library_best.members[:1], library_best.members]):
        nuisance = library.nuisance_with(basis)
        fits = empirical.best_fits(nuisance.values)
        losses = cv_losses_beside(nuisance, data, fits, criteria)
        for k in best_by_covariate(losses, fits, library.baseline, criteria)[:COMPETING]:
            term = fits[k].term
            competing[term.covariate, term.form, term.port, term.per_link] = fits[k]
    progress("effects against descriptions")
    competitors = [
        fit.candidate(fit.term.columns_um(problem.aligned, fit.effect, fit.constant)) for fit in competing.values()
    ]
    search = SubsetSearch(
        data,
        [*problem.pool.candidates, *competitors],
        [*problem.values, *(fit.values for fit in competing.values())],
        criteria,
    )
    best = search.best_subset()
    if not any(search.candidates[k].is_empirical for k in best.members):
        best = simplify(search, best)
    effects = tuple(k for k in best.members if not search.candidates[k].is_empirical)
    return Explanation(search, best.members, _order_by_gain(search, effects), tuple(fits))


def _order_by_gain(search: SubsetSearch, members: tuple[int, ...]) -> tuple[int, ...]:
    """First the one that alone leaves least, then the one that beside it leaves least (forward selection)."""
    order: tuple[int, ...] = ()
    while len(order) < len(members):
        extended = search.evaluate([(*order, k) for k in members if k not in order])
        order = min(extended, key=lambda subset: subset.cv_loss).members
    return order
