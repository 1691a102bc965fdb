"""The best explanation of a residual: effects of the library first, then in competition with descriptions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from compd.arrays import FloatArray
from compd.diagnosis.candidates import Candidate
from compd.diagnosis.changes import change_candidates, moments_s
from compd.diagnosis.empirical_search import EmpiricalFit, EmpiricalSearch, explained_squares
from compd.diagnosis.forward_search import forward_search
from compd.diagnosis.problem import DiagnosisProblem
from compd.diagnosis.refined_constants import refined_variants
from compd.diagnosis.significance import OrthogonalComplement
from compd.diagnosis.subset_losses import Subset, SubsetLosses

# Changes in time that compete, of those that explain most where they were fitted.
PROMISING_CHANGES = 6
# Rounds of values between those of a grid: a factor of two becomes 1.15, then 1.03.
REFINEMENTS = 2

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Explanation:
    """The best set of candidates.

    losses : over the library and what competed with it.
    members : the set: effects, the one that explains most first, then the constant, then descriptions and changes.
    fits : the promising descriptions beside the effects; empty where none was needed.
    """

    losses: SubsetLosses
    members: tuple[int, ...]
    fits: tuple[EmpiricalFit, ...] = ()
    _fit_by_place: dict[int, EmpiricalFit] = field(default_factory=dict)

    def _of_kind(self, *kinds: str) -> tuple[int, ...]:
        return tuple(k for k in self.members if self.losses.candidates[k].kind in kinds)

    @property
    def effects(self) -> tuple[int, ...]:
        """The library's effects in the set."""
        return self._of_kind("effect")

    @property
    def named(self) -> tuple[int, ...]:
        """The effects and the constant."""
        return self._of_kind("effect", "constant")

    @property
    def descriptions(self) -> tuple[int, ...]:
        """The descriptions in the set."""
        return self._of_kind("description")

    @property
    def changes(self) -> tuple[int, ...]:
        """The changes in time in the set."""
        return self._of_kind("change")

    @property
    def loss(self) -> float:
        """Cross-validated loss of the whole set."""
        return self.losses.loss(self.members)

    def fit_of(self, member: int) -> EmpiricalFit:
        """The term that a description is."""
        return self._fit_by_place[member]


def explain(problem: DiagnosisProblem, progress: Progress) -> Explanation:
    """Search the library alone; where that leaves more than the floor, the library together with descriptions.

    A set of effects and descriptions wins by the same score; a description has the higher price.
    """
    progress("every effect, then the next beside it, on rows left out")
    library, best = _search_library(problem)
    if problem.floor_known and best.cv_loss <= problem.criteria.most_at_floor:
        return Explanation(library, _ordered(library, best.members))
    progress("every covariate, lag, direction and time")
    empirical = EmpiricalSearch(problem)
    bases: list[tuple[int, ...]] = [(), best.members[:1], best.members]
    pool = _Competitors(problem, library, empirical)
    for basis in dict.fromkeys(bases):
        pool.screen_beside(library, basis)
    progress("effects against descriptions")
    losses = pool.losses()
    forward_search(losses)
    best = forward_search(losses, best.members)
    if pool.screen_beside(losses, best.members):
        losses = pool.losses()
        best = forward_search(losses, best.members)
    members = _ordered(losses, best.members)
    named = tuple(k for k in members if losses.candidates[k].kind in ("effect", "constant"))
    fits = empirical.best_fits(losses.nuisance_with(named).values)
    return Explanation(losses, members, tuple(fits), pool.fit_by_place)


def _search_library(problem: DiagnosisProblem) -> tuple[SubsetLosses, Subset]:
    """The library's best set, constants refined between the values of their grids."""
    candidates, values = list(problem.candidates), list(problem.values)
    losses = _losses(problem, candidates, values)
    best = forward_search(losses)
    for _ in range(REFINEMENTS):
        refined = refined_variants(candidates, best.members, problem.aligned)
        if not refined:
            break
        candidates += refined
        values += [problem.whiten(candidate.columns_um) for candidate in refined]
        losses = _losses(problem, candidates, values)
        best = forward_search(losses, best.members)
    return losses, best


def _losses(problem: DiagnosisProblem, candidates: Sequence[Candidate], values: Sequence[FloatArray]) -> SubsetLosses:
    return SubsetLosses(problem.data, candidates, values, problem.criteria, 1.0 if problem.floor_known else 0.0)


class _Competitors:
    """The library's candidates, and the descriptions and changes that compete with them, by their place."""

    def __init__(self, problem: DiagnosisProblem, library: SubsetLosses, empirical: EmpiricalSearch) -> None:
        self._problem, self._empirical = problem, empirical
        self._candidates, self._values = list(library.candidates), list(library.values)
        self.fit_by_place: dict[int, EmpiricalFit] = {}
        self._taken: set[object] = set()
        best = [library.candidates[subset.members[0]] for subset in library.best_variants.values()]
        effects = [candidate for candidate in best if candidate.kind == "effect"]
        self._changes = [
            (change, problem.whiten(change.columns_um))
            for change in change_candidates(effects, problem.aligned, moments_s(problem.aligned))
        ]

    def losses(self) -> SubsetLosses:
        """Of all candidates so far."""
        return _losses(self._problem, self._candidates, self._values)

    def screen_beside(self, losses: SubsetLosses, basis: tuple[int, ...]) -> bool:
        """Add what explains most beside some members; whether anything is new."""
        nuisance = losses.nuisance_with(basis).values
        new = False
        for fit in self._empirical.best_fits(nuisance):
            term = fit.term
            if self._is_new((term.covariate, term.form, term.port, term.per_link, fit.constant)):
                self.fit_by_place[len(self._candidates)] = fit
                columns_um = term.columns_um(self._problem.aligned, fit.effect, fit.constant)
                self._candidates.append(fit.candidate(columns_um))
                self._values.append(fit.values)
                new = True
        complement = OrthogonalComplement(nuisance)
        residual = complement(self._problem.data.y)
        squares = [explained_squares([values], residual, complement)[0] for _, values in self._changes]
        order = sorted(range(len(squares)), key=lambda k: -squares[k])[:PROMISING_CHANGES]
        for k in order:
            change, values = self._changes[k]
            if self._is_new((change.name, change.time_s)):
                self._candidates.append(change)
                self._values.append(values)
                new = True
        return new

    def _is_new(self, key: object) -> bool:
        if key in self._taken:
            return False
        self._taken.add(key)
        return True


def _ordered(losses: SubsetLosses, members: Sequence[int]) -> tuple[int, ...]:
    """Effects, then the constant, then the rest; of each, first the one that beside those before it leaves least."""
    order: tuple[int, ...] = ()
    for kinds in (("effect",), ("constant",), ("description", "change")):
        left = [k for k in members if losses.candidates[k].kind in kinds]
        while left:
            best = min(left, key=lambda k: losses.loss((*order, k)))
            order = (*order, best)
            left.remove(best)
    return order
