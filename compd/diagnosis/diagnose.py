"""Which physical effect a model lacks: from a recording and a model to a verdict with its evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from compd.arrays import FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.compare import compare
from compd.comparison.shape_search import search_constants
from compd.diagnosis.candidate_results import candidate_results
from compd.diagnosis.candidates import library_pool
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.empirical_findings import Remainder, find_pair, rank_findings
from compd.diagnosis.empirical_search import cv_losses_beside
from compd.diagnosis.explanation import Explanation, Progress, explain
from compd.diagnosis.findings import CandidateResult, DiagnosisStep, EmpiricalFinding
from compd.diagnosis.measurement_programmes import recorded_limits
from compd.diagnosis.next_measurement import plan_measurement
from compd.diagnosis.problem import DiagnosisProblem, build_problem, screen_outliers
from compd.diagnosis.rivals import find_rivals
from compd.diagnosis.selection import estimate_parameters, explained_fraction, is_at_floor, penalty
from compd.diagnosis.significance import OrthogonalComplement, p_values
from compd.diagnosis.subset_search import SubsetSearch
from compd.diagnosis.unmodelled import with_disturbances
from compd.diagnosis.verdict import Diagnosis, Verdict
from compd.errors import CompdError
from compd.model.effect import Effect, FittedEffect

# Outliers and the best explanation depend on one another: so often both are determined at most.
ROUNDS = 3
# Rows of the next measurement that a diagnosis proposes of itself; `compd plan` gives as many as are wanted.
NEXT_ROWS = 12
# Covariates that the proposal of a next measurement names.
NEXT_COVARIATES = 2


def diagnose(
    aligned: AlignedRecording,
    fitted: Sequence[FittedEffect],
    covariance: FloatArray | None,
    effects: Sequence[Effect],
    progress: Progress = lambda status: None,
    criteria: Criteria = Criteria(),
) -> Diagnosis:
    """Learn which effects the model lacks on this recording.

    The residual is explained by the fewest effects that predict rows which were left out; what no effect explains is
    described by the covariates that it follows. Effects that are named are then fitted on the forward model.

    fitted, covariance : the model's effects and the joint covariance of their parameters, None where not known; they
        are refitted along.
    effects : the library.
    progress : called with a text when a stage begins.
    criteria : thresholds of the verdict.

    Raises CompdError as `compare` does.

    Example::

        diagnosis = diagnose(aligned, (), None, list(load_library().values()))
        diagnosis.verdict  # "identified"
        [step.effect.id for step in diagnosis.steps]  # ["link_elasticity"]
    """
    progress("comparing the model with the recording")
    before = compare(aligned, fitted, covariance, criteria.comparison)
    progress("what each effect would do")
    pool = library_pool(aligned, effects, [effect.effect.id for effect in fitted], criteria)
    problem = build_problem(before, pool, criteria)
    explanation = explain(problem, progress)
    for _ in range(ROUNDS - 1):
        outlier = screen_outliers(problem, [explanation.search.candidates[k] for k in explanation.members])
        if (outlier == problem.outlier).all():
            break
        problem = build_problem(before, pool, criteria, outlier)
        explanation = explain(problem, progress)
    progress("fitting on the real forward model")
    return _diagnosis(problem, explanation, covariance)


def _diagnosis(problem: DiagnosisProblem, explanation: Explanation, covariance: FloatArray | None) -> Diagnosis:
    """Fit the effects that are worth naming, and state the verdict with its evidence."""
    search, aligned, before, criteria = explanation.search, problem.aligned, problem.comparison, problem.criteria
    effects = _effects_to_name(explanation, criteria)
    p_value_by_effect = _p_values(search, effects)
    fitted, joint_covariance = before.fitted, covariance
    for number, k in enumerate(effects, start=1):
        result = search_constants(aligned, fitted, search.candidates[k].effect, problem.sigma_um, criteria.comparison)
        if number == len(effects):
            result = with_disturbances(result, aligned, problem.sigma_um, problem.pool.candidates, criteria)
        fitted, joint_covariance = result.fitted, result.covariance
    after = compare(aligned, fitted, joint_covariance, criteria.comparison) if effects else before
    explained = search.baseline - 1.0 if effects else 0.0
    at_floor = not explanation.is_empirical and is_at_floor(after.floor_ratio, criteria, explained)
    new = fitted[len(before.fitted) :]
    steps = _steps(problem, search, effects, new, p_value_by_effect, with_rivals=at_floor)
    candidates = candidate_results(problem, search, steps, p_value_by_effect)
    depends_on = () if at_floor else _depends_on(problem, explanation, effects)
    verdict = _verdict(steps, candidates, depends_on, at_floor)
    diagnosis = Diagnosis(verdict, before, after, steps, candidates, depends_on)
    return replace(diagnosis, next_measurement=_next_measurement(problem, diagnosis))


def _verdict(
    steps: Sequence[DiagnosisStep],
    candidates: Sequence[CandidateResult],
    depends_on: Sequence[EmpiricalFinding],
    at_floor: bool,
) -> Verdict:
    """The verdict; at_floor : whether the model with the steps' effects leaves nothing worth a name."""
    if at_floor:
        if not steps:
            return "adequate"
        return "ambiguous" if any(step.rivals for step in steps) else "identified"
    statuses = {candidate.status for candidate in candidates}
    if not depends_on and not steps and statuses <= {"not_testable", "no_gain"} and "not_testable" in statuses:
        return "not_testable"
    return "unexplained"


def _effects_to_name(explanation: Explanation, criteria: Criteria) -> tuple[int, ...]:
    """The effects of the best subset; none where they leave much that nothing describes: similarity, no cause."""
    search, effects = explanation.search, explanation.effects
    if not effects or explanation.is_empirical:
        return effects
    loss = search.evaluate([effects])[0].cv_loss
    enough = explained_fraction(search.baseline, loss) >= 1 - criteria.most_unexplained
    return effects if enough or is_at_floor(loss, criteria, search.baseline - 1.0) else ()


def _steps(
    problem: DiagnosisProblem,
    search: SubsetSearch,
    effects: tuple[int, ...],
    fitted: Sequence[FittedEffect],
    p_value_by_effect: Mapping[str, float],
    *,
    with_rivals: bool,
) -> tuple[DiagnosisStep, ...]:
    """One effect after another, with what each adds to those before it."""
    steps, loss_before = [], search.baseline
    for place, effect in enumerate(fitted):
        loss = search.evaluate([effects[: place + 1]])[0].cv_loss
        links = problem.aligned.rows.links
        parameters = estimate_parameters(effect.effect, links, effect.theta, effect.covariance, problem.criteria)
        steps.append(
            DiagnosisStep(
                fitted=effect,
                rivals=find_rivals(search, effects, place) if with_rivals else (),
                heldout_rms_um=problem.comparison.floor.um * float(np.sqrt(loss)),
                explained_fraction=explained_fraction(loss_before, loss),
                p_value=p_value_by_effect[effect.effect.id],
                parameters=tuple(parameters),
            )
        )
        loss_before = loss
    return tuple(steps)


def _depends_on(
    problem: DiagnosisProblem, explanation: Explanation, effects: tuple[int, ...]
) -> tuple[EmpiricalFinding, ...]:
    """What the rest follows, one finding per covariate; first a pair of covariates where one is not enough."""
    search, fits, criteria = explanation.search, explanation.fits, problem.criteria
    if not fits:
        return ()
    nuisance = search.nuisance_with(effects)
    remainder = Remainder(
        data=replace(problem.data, nuisance=nuisance),
        loss=search.evaluate([effects])[0].cv_loss if effects else search.baseline,
        noise_um=problem.comparison.floor.um,
        least_gain=penalty(search.baseline - 1.0, criteria),
        links=problem.aligned.rows.links,
    )
    losses = cv_losses_beside(nuisance, problem.data, fits, criteria)
    findings = rank_findings(remainder, fits, losses, criteria)
    if not findings or is_at_floor(float(np.nanmin(losses)), criteria):
        return findings
    return (*find_pair(remainder, fits, float(np.nanmin(losses)), criteria), *findings)


def _p_values(search: SubsetSearch, effects: tuple[int, ...]) -> dict[str, float]:
    """p-value of each effect of the library, corrected for all of them and for their nonlinear constants.

    The noise is what the named effects leave; where none is named, what the best candidate leaves.
    """
    complement = OrthogonalComplement(search.data.nuisance.values)
    columns = [complement(values) for values in search.values]
    y = complement(search.data.y)
    explaining = list(effects) or [subset.members[0] for subset in search.singles[:1]]
    noise = OrthogonalComplement(np.concatenate([columns[k] for k in explaining], axis=2))(y) if explaining else y
    names = list(dict.fromkeys(candidate.name for candidate in search.candidates if not candidate.is_empirical))
    families = [
        [values for values, candidate in zip(columns, search.candidates, strict=True) if candidate.name == name]
        for name in names
    ]
    return dict(zip(names, p_values(families, y, noise, search.data.block).tolist(), strict=True))


def _next_measurement(problem: DiagnosisProblem, diagnosis: Diagnosis) -> list[dict[str, object]]:
    """Rows that tell the first rivals apart; where nothing explains the residual, what to vary."""
    aligned, model, criteria = problem.aligned, problem.comparison.fitted, problem.criteria.comparison
    for step in diagnosis.steps:
        if step.rivals and aligned.model is not None:
            rival = problem.pool.candidates[step.rivals[0].member]
            try:
                fitted_rival = search_constants(aligned, model, rival.effect, problem.sigma_um, criteria).fitted[-1]
                pair = (step.fitted, fitted_rival)
                limits = recorded_limits(aligned)
                return list(plan_measurement(aligned, model, pair, problem.sigma_um, limits, NEXT_ROWS).rows)
            except CompdError as error:
                return [{"measure": step.effect.separated_by, "why": str(error.problems[0].what)}]
    return [
        {
            "measure": f"vary {finding.covariate} alone, everything else as it is, at three places and back again",
            "why": f"the rest follows it ({finding.form}, at the {finding.port})",
        }
        for finding in diagnosis.depends_on[:NEXT_COVARIATES]
    ]
