"""Sessions that began out of equilibrium: a lag whose state at the start nobody knows, as a competitor.

The unknown states move each session by a decaying exponential of their own, and any warm-up is much like one. They are
a description, at its price, and are judged on rows that were left out, as everything is: in the splits that leave out a
part of a session, since a session that is left out whole cannot teach its own start. Where they win, every set of
candidates is judged with them and in these splits, so that none is compared with another that lacks them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from compd.arrays import FloatArray
from compd.comparison import initial_state_columns
from compd.diagnosis.candidates.candidates import Candidate
from compd.diagnosis.candidates.refined_constants import refined_variants
from compd.diagnosis.search.problem import DiagnosisProblem
from compd.diagnosis.search.subset_losses import Subset, SubsetLosses


class UnknownStart(NamedTuple):
    """A problem with the unknown starts of sessions, and the lag of which they are.

    problem : with the states in every fit.  lag : the effect with its time constant.
    members : the lag and the other candidates that it was tried with.
    gain : by how much its score is less than without the states and with the lag at its best, in the same splits.
    before, after : loss with and without the states, beside nothing else, in the same splits.
    """

    problem: DiagnosisProblem
    lag: Candidate
    members: tuple[Candidate, ...]
    gain: float
    before: float
    after: float


def find_warm_start(problem: DiagnosisProblem, losses: SubsetLosses, best: Subset) -> UnknownStart | None:
    """The lag that with unknown states at the start of sessions gains their price; None where none does.

    Each is tried alone and with the other members of the best set, which may be there for what the start does; at every
    time constant of its grid, then between these.
    """
    lags = [k for k, candidate in enumerate(losses.candidates) if candidate.effect.unknown_states]
    lags = [k for k in lags if losses.candidates[k].kind == "effect"]
    trials = [trial for k in lags for trial in _trials(problem, losses, best, losses.candidates[k])]
    if not trials:
        return None
    first = max(trials, key=lambda trial: trial.gain)
    place = next(k for k in lags if losses.candidates[k] is first.lag)
    between = refined_variants(losses.candidates, [place], problem.aligned, problem.criteria.candidates)
    refined = [trial for lag in between for trial in _trials(problem, losses, best, lag)]
    trial = max([first, *refined], key=lambda trial: trial.gain)
    return trial if trial.gain > 0 else None


def with_start(problem: DiagnosisProblem, lag: Candidate) -> DiagnosisProblem:
    """A problem, of which a split can test the states, with the unknown states of a lag in every fit."""
    columns_um = start_columns_um(problem, lag)
    part = problem.on_splits_that_test(columns_um)
    return (part or problem).with_states(columns_um)


def start_columns_um(problem: DiagnosisProblem, lag: Candidate) -> FloatArray:
    """(N, m, Q) by how many um each unknown state of a lag moves the prediction."""
    return initial_state_columns(problem.aligned, lag.effect, lag.constants)


def _trials(problem: DiagnosisProblem, losses: SubsetLosses, best: Subset, lag: Candidate) -> Iterator[UnknownStart]:
    columns_um = start_columns_um(problem, lag)
    part = problem.on_splits_that_test(columns_um) if columns_um.shape[2] else None
    if part is None:
        return
    own = [losses.candidates[k] for k in best.members]
    others = [candidate for candidate in own if candidate.effect.id != lag.effect.id]
    without = part.losses([*own, lag])
    sets = without.evaluate([range(len(own)), [*map(own.index, others), len(own)]])
    score = min((without.score(subset) for subset in sets), default=float("inf"))
    with_states = part.with_states(columns_um)
    beside = with_states.losses([*others, lag])
    criteria = problem.criteria
    price = criteria.description_price + criteria.number_price * (columns_um.shape[2] - 1)
    for subset in beside.evaluate([[len(others)], range(len(others) + 1)]):
        members = tuple(beside.candidates[k] for k in subset.members)
        gain = score - beside.score(subset) - price
        yield UnknownStart(with_states, lag, members, gain, without.baseline, beside.baseline)
