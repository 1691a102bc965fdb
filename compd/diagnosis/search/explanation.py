"""The best explanation of a residual: effects of the library first, then in competition with descriptions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from compd.diagnosis import stages
from compd.diagnosis.candidates.candidates import Candidate, periodic_candidates
from compd.diagnosis.candidates.changes import ChangeCandidate, change_candidates, moments_between_s, moments_s
from compd.diagnosis.candidates.refined_constants import refined_variants
from compd.diagnosis.search.empirical_search import EmpiricalFit, EmpiricalSearch, explained_squares
from compd.diagnosis.search.forward_search import extend, forward_search, right_alone
from compd.diagnosis.search.problem import DiagnosisProblem
from compd.diagnosis.search.significance import OrthogonalComplement
from compd.diagnosis.search.subset_losses import Subset, SubsetLosses
from compd.diagnosis.search.warm_start import UnknownStart, find_warm_start, with_start

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Explanation:
    """The best set of candidates.

    problem : in which it was found.
    losses : over the library and what competed with it.
    members : the set: effects, the one that explains most first, then the constant, then descriptions and changes.
    fits : the promising descriptions; empty where none was needed.
    fit_by_place : of the candidates that are descriptions, the term by the candidate's place.
    start : what is unknown at the start of sessions and is in every fit; None where nothing is.
    """

    problem: DiagnosisProblem
    losses: SubsetLosses
    members: tuple[int, ...]
    fits: tuple[EmpiricalFit, ...] = ()
    fit_by_place: Mapping[int, EmpiricalFit] = field(default_factory=dict)
    start: UnknownStart | None = None

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
    def constants(self) -> tuple[int, ...]:
        """The constant, if it is in the set."""
        return self._of_kind("constant")

    @property
    def proxies(self) -> tuple[int, ...]:
        """Effects that were not measured, by what stands for their temperature."""
        return self._of_kind("proxy")

    @property
    def described(self) -> tuple[int, ...]:
        """Everything in the set that names no cause, but for the constant."""
        return self._of_kind("proxy", "description", "change")

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
        return self.fit_by_place[member]


def explain(problem: DiagnosisProblem, progress: Progress, starts: bool = True) -> Explanation:
    """Search the library alone; where that leaves more than the floor, the library together with descriptions.

    A set of effects and descriptions wins by the same score; a description has the higher price.

    starts : whether a lag may begin out of equilibrium.
    """
    progress(stages.EFFECTS)
    whole = problem
    problem, library, best, start = _search_library(whole, starts)
    if _beats_descriptions(problem, library, best):
        return Explanation(problem, library, _ordered(library, best.members), start=start)
    progress(stages.COVARIATES)
    competitors = _Competitors(problem, library)
    for basis in dict.fromkeys([(), best.members]):
        competitors.screen_beside(library, basis)
    progress(stages.DESCRIPTIONS)
    losses = problem.losses(competitors.candidates)
    best = _search_all(losses, best.members)
    fits = competitors.screen_beside(losses, best.members)
    competitors.refine_changes(best.members)
    if len(competitors.candidates) > len(losses.candidates):
        losses = problem.losses(competitors.candidates)
        best = _search_all(losses, best.members)
    if start is not None and not _has(losses, best, start):
        return explain(whole, progress, starts=False)
    return Explanation(problem, losses, _ordered(losses, best.members), fits, competitors.fit_by_place, start)


def _has(losses: SubsetLosses, subset: Subset, start: UnknownStart) -> bool:
    """Whether the lag of an unknown start is in a set: without it, nothing began out of equilibrium."""
    return start.lag.name in [losses.name(k) for k in subset.members]


def explain_again(problem: DiagnosisProblem, before: Explanation, progress: Progress) -> Explanation:
    """The same search on rows that are weighed anew, among the candidates that were promising before."""
    candidates, whole = before.losses.candidates, problem
    if before.start is not None:
        problem = with_start(problem, before.start.lag)
    losses = problem.losses(candidates)
    best = _search_all(losses, before.members)
    if before.start is not None and not _has(losses, best, before.start):
        return explain(whole, progress, starts=False)
    if not losses.describes and not _beats_descriptions(problem, losses, best):
        return explain(whole, progress)

    def weighed(fit: EmpiricalFit) -> EmpiricalFit:
        return replace(fit, values=problem.whiten(fit.columns_um(problem.aligned)))

    fit_by_place = {k: replace(fit, values=losses.values[k]) for k, fit in before.fit_by_place.items()}
    fits = tuple(weighed(fit) for fit in before.fits)
    return Explanation(problem, losses, _ordered(losses, best.members), fits, fit_by_place, before.start)


def explain_little(explanation: Explanation) -> Explanation:
    """Where nothing is named: the effects that take more than all that may stay unnamed, if they leave noise alone.

    What stays unnamed is `disturbance` at most: an effect that surely takes more is named, at this lower price.
    """
    problem, criteria = explanation.problem, explanation.problem.criteria
    if explanation.members or not problem.floor_known:
        return explanation
    price = float(np.log1p(criteria.disturbance**2))
    lower = replace(problem, criteria=replace(criteria, effect_price=min(price, criteria.effect_price)))
    effects = [candidate for candidate in explanation.losses.candidates if candidate.kind in ("effect", "constant")]
    losses, best = _refined(lower, effects, ())
    if not best.members or not problem.may_be_noise(best.cv_loss):
        return explanation
    return replace(explanation, losses=losses, members=_ordered(losses, best.members), fits=(), fit_by_place={})


def _beats_descriptions(problem: DiagnosisProblem, losses: SubsetLosses, best: Subset) -> bool:
    """Whether no description could score better than a set of effects: at the floor each costs its price at least.

    Many effects with many numbers reach the floor of a cause that the library does not have, too.
    """
    return problem.is_at_floor(best.cv_loss) and losses.score(best) <= problem.criteria.description_price


def _search_all(losses: SubsetLosses, start: tuple[int, ...]) -> Subset:
    """The best set of effects and descriptions: from the best set of effects, from nothing, and from another set."""
    effects = [k for k, candidate in enumerate(losses.candidates) if candidate.kind in ("effect", "constant")]
    for begin in dict.fromkeys([extend(losses, among=effects).members, ()]):
        extend(losses, begin)
    return right_alone(losses, forward_search(losses, start))


def _search_library(
    problem: DiagnosisProblem, starts: bool
) -> tuple[DiagnosisProblem, SubsetLosses, Subset, UnknownStart | None]:
    """The library's best set, and the problem in which it was found: where a lag began warm, with that start."""
    losses, best = _refined(problem, problem.candidates, ())
    if problem.is_at_floor(best.cv_loss):
        return problem, losses, best, None
    if best.members:
        # a period that was hidden behind something larger shows in what that leaves
        effects = {candidate.name: candidate.effect for candidate in problem.candidates if candidate.kind == "effect"}
        residual_um = problem.residual_beside_um(losses, best.members)
        periodic = periodic_candidates(problem.aligned, effects.values(), residual_um, problem.rows)
        if periodic:
            losses, best = _refined(problem, [*losses.candidates, *periodic], best.members)
    warm = find_warm_start(problem, losses, best) if starts else None
    if warm is not None:
        candidates = [*losses.candidates, *(lag for lag in (warm.lag,) if lag not in losses.candidates)]
        start = tuple(candidates.index(member) for member in warm.members)
        warm_losses, warm_best = _refined(warm.problem, candidates, start)
        if _has(warm_losses, warm_best, warm):
            return warm.problem, warm_losses, warm_best, warm
    return problem, losses, best, None


def _refined(
    problem: DiagnosisProblem, candidates: Sequence[Candidate], start: tuple[int, ...]
) -> tuple[SubsetLosses, Subset]:
    """The best set of some candidates, constants refined between the values of their grids."""
    losses = problem.losses(candidates)
    extend(losses)
    best = forward_search(losses, start)
    for _ in range(problem.criteria.search.refinements):
        refined = refined_variants(losses.candidates, best.members, problem.aligned, problem.criteria.candidates)
        if not refined:
            break
        losses = problem.losses([*losses.candidates, *refined])
        best = forward_search(losses, best.members)
    return losses, best


class _Competitors:
    """The library's candidates, and the descriptions and changes that compete with them, by their place."""

    def __init__(self, problem: DiagnosisProblem, library: SubsetLosses) -> None:
        self._problem, self._empirical = problem, EmpiricalSearch(problem)
        self.candidates: list[Candidate] = list(library.candidates)
        self.fit_by_place: dict[int, EmpiricalFit] = {}
        self._taken: set[object] = set()
        best = [library.candidates[subset.members[0]] for subset in library.best_variants.values()]
        effects = [candidate for candidate in best if candidate.kind == "effect"]
        self._moments_s = moments_s(problem.aligned, problem.criteria.candidates)
        self._changes = change_candidates(effects, problem.aligned, self._moments_s, problem.criteria.candidates)
        self._change_values = [problem.whiten(change.columns_um) for change in self._changes]

    def screen_beside(self, losses: SubsetLosses, basis: tuple[int, ...]) -> tuple[EmpiricalFit, ...]:
        """Add what explains most beside some members; returns the descriptions that do."""
        nuisance = losses.nuisance_with(basis).values
        fits = tuple(self._empirical.best_fits(nuisance))
        for fit in fits:
            term = fit.term
            if term.form == "step" and self._problem.aligned.model is not None:
                continue  # a change of an effect that makes a constant does the same, and has a name
            if self._is_new((term.covariate, term.form, term.port, term.per_link, fit.constant)):
                self.fit_by_place[len(self.candidates)] = fit
                self.candidates.append(fit.candidate(fit.columns_um(self._problem.aligned)))
        complement = OrthogonalComplement(nuisance)
        residual = complement(self._problem.data.y)
        squares = explained_squares(self._change_values, residual, complement)
        left = (float((residual**2).sum()) - squares) / residual.size
        prices = [change.price(self._problem.criteria) for change in self._changes]
        scores = [losses.log_loss(loss) + price for loss, price in zip(left.tolist(), prices, strict=True)]
        # of each effect the best moment: the next one explains nearly the same
        best: dict[str, ChangeCandidate] = {}
        for k in np.argsort(scores, kind="stable"):
            best.setdefault(self._changes[k].name, self._changes[k])
        for change in [*best.values()][: self._problem.criteria.search.promising_changes]:
            if self._is_new((change.name, change.time_s)):
                self.candidates.append(change)
        return fits

    def refine_changes(self, members: Sequence[int]) -> None:
        """Add the changes among some members at moments between those that were tried."""
        criteria = self._problem.criteria.candidates
        for change in [self.candidates[k] for k in members]:
            if isinstance(change, ChangeCandidate):
                times_s = moments_between_s(self._moments_s, change.time_s, criteria)
                self.candidates += change_candidates([change.whole], self._problem.aligned, times_s, criteria)

    def _is_new(self, key: object) -> bool:
        if key in self._taken:
            return False
        self._taken.add(key)
        return True


def _ordered(losses: SubsetLosses, members: Sequence[int]) -> tuple[int, ...]:
    """Effects, then the constant, then the rest; of each, first the one that beside those before it leaves least."""
    order: tuple[int, ...] = ()
    for kinds in (("effect",), ("constant",), ("proxy", "description", "change")):
        left = [k for k in members if losses.candidates[k].kind in kinds]
        while left:
            best = min(left, key=lambda k: losses.loss((*order, k)))
            order = (*order, best)
            left.remove(best)
    return order
