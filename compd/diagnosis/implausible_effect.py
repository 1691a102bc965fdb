"""An effect that would explain the error if its numbers could be as large as that takes: a question for the owner."""

from __future__ import annotations

from dataclasses import replace

from compd.diagnosis.candidate_result import explained_fraction
from compd.diagnosis.candidates.plausibility import estimate_parameters
from compd.diagnosis.findings import ImplausibleEffect
from compd.diagnosis.search.explanation import Explanation
from compd.diagnosis.search.problem import DiagnosisProblem

# Times the plausible range: so wide is none of the ranges that a fit is held within.
_FREE = 1e3


def implausible_effect(problem: DiagnosisProblem, explanation: Explanation) -> ImplausibleEffect | None:
    """The effect that alone explains the error best, with numbers held by no range, where one of them is implausible.

    None where the best effect is plausible, takes less than `excellent_share`, or leaves more than what is named does.
    """
    losses, criteria = explanation.losses, problem.criteria
    effects = [c for c in losses.candidates if c.kind == "effect"]
    free = problem.losses([replace(candidate, limits=_FREE * candidate.limits) for candidate in effects])
    best = next(iter(free.best_variants.values()), None)
    if best is None or best.cv_loss >= losses.loss(explanation.named):
        return None
    fraction = explained_fraction(losses.baseline, best.cv_loss, 1.0 if problem.floor_known else 0.0)
    if fraction < criteria.excellent_share:
        return None
    effect = free.candidates[best.members[0]].effect
    theta, covariance = free.estimates(best.members)[0]
    links = problem.aligned.rows.links
    doubtful = [
        (number, column.parameter)
        for number, column in zip(
            estimate_parameters(effect, links, theta, covariance, criteria), effect.columns(links), strict=True
        )
        if not number.plausible
    ]
    if not doubtful:
        return None
    number, parameter = max(doubtful, key=lambda pair: abs(pair[0].value) / max(abs(pair[1].low), abs(pair[1].high)))
    rms_um = problem.unit_um * float(max(best.cv_loss, 0.0) ** 0.5)
    return ImplausibleEffect(effect.id, rms_um, fraction, number, parameter)
