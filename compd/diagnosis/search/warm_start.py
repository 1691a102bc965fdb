"""Sessions that began out of equilibrium: a lag whose state at the start nobody knows, as a competitor.

The unknown states move each session by a decaying exponential of their own. A session that is left out cannot teach its
own start, so these columns are projected out of everything before rows are left out; their number is paid for.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from compd.comparison import initial_state_columns
from compd.diagnosis.candidates.candidates import Candidate
from compd.diagnosis.candidates.refined_constants import refined_variants
from compd.diagnosis.search.problem import DiagnosisProblem
from compd.diagnosis.search.subset_losses import Subset, SubsetLosses


class UnknownStart(NamedTuple):
    """A problem without the starts of sessions, and the lag for which they are unknown.

    problem : with the states projected out.  lag : the effect with its time constant.
    members : the lag and the other candidates that it was tried with.  score : of these, states included.
    """

    problem: DiagnosisProblem
    lag: Candidate
    members: tuple[Candidate, ...]
    score: float


def find_warm_start(problem: DiagnosisProblem, losses: SubsetLosses, best: Subset) -> UnknownStart | None:
    """The lag that with unknown states at the start of sessions scores better than the best set; None where none does.

    Each is tried with the other members of the best set, at every time constant of its grid, then between these.
    """
    lags = [k for k, candidate in enumerate(losses.candidates) if candidate.effect.unknown_states]
    lags = [k for k in lags if losses.candidates[k].kind == "effect"]
    if not lags:
        return None
    first = min((_try(problem, losses, best, losses.candidates[k]) for k in lags), key=lambda trial: trial.score)
    place = next(k for k in lags if losses.candidates[k] is first.lag)
    between = refined_variants(losses.candidates, [place], problem.aligned, problem.criteria.candidates)
    trial = min([first, *(_try(problem, losses, best, lag) for lag in between)], key=lambda trial: trial.score)
    return trial if trial.score < losses.score(best) else None


def with_states_of(problem: DiagnosisProblem, members: Iterable[Candidate]) -> DiagnosisProblem:
    """The problem with the unknown states of every lag among some candidates projected out."""
    columns = [
        initial_state_columns(problem.aligned, candidate.effect, candidate.constants)
        for candidate in members
        if candidate.kind == "effect" and candidate.effect.unknown_states
    ]
    return problem.without(np.concatenate(columns, axis=2)) if columns else problem


def _try(problem: DiagnosisProblem, losses: SubsetLosses, best: Subset, lag: Candidate) -> UnknownStart:
    others = [losses.candidates[k] for k in best.members if losses.candidates[k].effect.id != lag.effect.id]
    members = (*others, lag)
    projected = with_states_of(problem, members)
    alone = projected.losses(members)
    subset = Subset(tuple(range(len(members))), alone.loss(range(len(members))))
    score = alone.score(subset) + problem.criteria.number_price * projected.states
    return UnknownStart(projected, lag, members, score)
