"""Every effect of the library with its status, and the reason why it is named or not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from compd.diagnosis.findings import CandidateResult, DiagnosisStep, ParameterEstimate, Status
from compd.diagnosis.problem import DiagnosisProblem
from compd.diagnosis.selection import estimate_parameters, explained_fraction, is_undetermined, penalty
from compd.diagnosis.subset_search import Subset, SubsetSearch


def candidate_results(
    problem: DiagnosisProblem, search: SubsetSearch, steps: Sequence[DiagnosisStep], p_values: Mapping[str, float]
) -> tuple[CandidateResult, ...]:
    """One result per effect, tried alone at its best nonlinear constants: the best first, then those not testable.

    steps : the effects that were named.  p_values : by effect, corrected for all that were tried.
    """
    results = [
        _result_alone(problem, search, subset, steps, p_values.get(name, float("nan")))
        for name, subset in search.best_variants.items()
        if not search.candidates[subset.members[0]].is_empirical
    ]
    names = dict.fromkeys(candidate.name for candidate in search.candidates if not candidate.is_empirical)
    why = "acts in one session or sector only: what it does there predicts no other"
    results += [CandidateResult(name, "not_testable", why) for name in names if name not in search.best_variants]
    results += [CandidateResult(name, "not_testable", reason) for name, reason in problem.pool.untestable.items()]
    return tuple(results)


def _result_alone(
    problem: DiagnosisProblem, search: SubsetSearch, subset: Subset, steps: Sequence[DiagnosisStep], p_value: float
) -> CandidateResult:
    """The result of one effect at its best nonlinear constants."""
    candidate = search.candidates[subset.members[0]]
    theta, covariance = search.estimates(subset.members)[0]
    links = problem.aligned.rows.links
    parameters = tuple(estimate_parameters(candidate.effect, links, theta, covariance, problem.criteria))
    fraction = explained_fraction(search.baseline, subset.cv_loss)
    rms_um = problem.comparison.floor.um * float(np.sqrt(max(subset.cv_loss, 0.0)))
    factor = candidate.penalty_factor(problem.criteria)
    needed_gain = penalty(max(search.baseline - 1.0, 0.0), problem.criteria, factor)
    status: Status
    if (named := _reason_of_explaining(candidate.name, candidate.effect.separated_by, steps)) is not None:
        status, why = "explains", named
    elif is_undetermined(candidate.limits, np.sqrt(np.diag(covariance))):
        status, why = "not_testable", "its numbers stay less certain than their plausible ranges are wide"
    elif search.baseline - subset.cv_loss < needed_gain:
        status, why = "no_gain", f"takes {100 * max(fraction, 0.0):.0f} % of the error away: not worth a name"
    elif implausible := [parameter for parameter in parameters if not parameter.plausible]:
        status, why = "partial", f"only with implausible numbers: {_values(implausible[:3])}"
    elif steps:
        status, why = "partial", "nothing more beside what is named"
    else:
        status, why = "partial", f"leaves {rms_um:.2g} um: a likeness, not the cause"
    return CandidateResult(candidate.name, status, why, rms_um, fraction, p_value, parameters)


def _reason_of_explaining(name: str, separated_by: str, steps: Sequence[DiagnosisStep]) -> str | None:
    """Why an effect explains the recording: it is named, or a rival of one that is; None where it is neither."""
    for number, step in enumerate(steps, start=1):
        if step.effect.id == name:
            return f"named, number {number}"
    for step in steps:
        if name in [rival.name for rival in step.rivals]:
            return f"as good as {step.effect.id} on these rows; apart by {separated_by}"
    return None


def _values(parameters: Sequence[ParameterEstimate]) -> str:
    return ", ".join(f"{parameter.name} = {parameter.value:.3g} {parameter.unit}" for parameter in parameters)
