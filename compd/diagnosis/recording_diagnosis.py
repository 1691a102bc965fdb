"""Which physical effect a model lacks: from a recording and a model to a verdict with its evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import prod

import numpy as np

from compd.arrays import FloatArray, rms
from compd.comparison import (
    AlignedRecording,
    Comparison,
    compare,
    counted_by_neighbours,
    fit,
    initial_effect,
    thinned,
)
from compd.diagnosis import stages
from compd.diagnosis.candidate_criteria import CandidateCriteria
from compd.diagnosis.candidate_result import candidate_results, explained_fraction, why_nothing_else
from compd.diagnosis.candidates.candidates import CandidatePool, library_pool, periodic_candidates
from compd.diagnosis.candidates.plausibility import estimate_parameters
from compd.diagnosis.candidates.proxies import proxy_candidates
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.empirical_findings import describe_remainder
from compd.diagnosis.findings import (
    CandidateResult,
    ConstantFinding,
    DiagnosisStep,
    Rival,
    UnknownStates,
    UntestedEffect,
)
from compd.diagnosis.implausible_effect import implausible_effect
from compd.diagnosis.intercepts import beside, with_intercepts
from compd.diagnosis.left_interval import left_interval_um
from compd.diagnosis.little_effects import little_effects
from compd.diagnosis.named_probability import NOT_TESTED, NamedProbability
from compd.diagnosis.proposed_measurement import propose_measurement
from compd.diagnosis.rival_selection import named_members
from compd.diagnosis.search.better_sets import better_sets
from compd.diagnosis.search.explanation import Explanation, Progress, explain, explain_again, explain_little
from compd.diagnosis.search.gross_rows import gross_rows
from compd.diagnosis.search.place_significance import place_p_value
from compd.diagnosis.search.problem import DiagnosisProblem, build_problem
from compd.diagnosis.search.rivals import find_rivals
from compd.diagnosis.search.significance import Family, OrthogonalComplement, p_values
from compd.diagnosis.search.subset_losses import SubsetLosses
from compd.diagnosis.thermal_evidence import seen_once
from compd.diagnosis.unmodelled import with_disturbances
from compd.diagnosis.verdict import Diagnosis, Verdict
from compd.diagnosis.words.summary import summary
from compd.model.effects import Effect, FittedEffect


def describe_constant(
    problem: DiagnosisProblem, explanation: Explanation, named: Mapping[int, FittedEffect], constant_um: FloatArray
) -> ConstantFinding | None:
    """The constant that was taken off or found, and the effects that it may come from; None where there is none.

    named : the fitted effect of each named member.  constant_um : (m,) what was taken off beside these: the mean of
    what an effect does is the effect's.
    """
    aligned, losses = problem.aligned, explanation.losses
    if explanation.constants:
        member = explanation.constants[0]
        values, std = named[member].theta, np.sqrt(np.diag(named[member].covariance))
        rivals = find_rivals(losses, explanation.members, member)
        effects = [losses.candidates[rival.member].effect for rival in rivals]
    elif aligned.registration_columns.shape[2] and not aligned.registered:
        values, std = constant_um, np.full(len(aligned.labels), np.nan)
        effects = [candidate.effect for candidate in problem.same_as_nuisance]
    else:
        return None
    return ConstantFinding(
        by_axis_um=dict(zip(aligned.labels, values.tolist(), strict=True)),
        std_um=dict(zip(aligned.labels, std.tolist(), strict=True)),
        effects=tuple(effect.id for effect in effects),
        separated_by=effects[0].separated_by if effects else "",
    )


def diagnose(
    aligned: AlignedRecording,
    fitted: Sequence[FittedEffect],
    covariance: FloatArray | None,
    effects: Sequence[Effect],
    progress: Progress = lambda status: None,
    criteria: Criteria = Criteria(),
) -> Diagnosis:
    """Learn which effects the model lacks on this recording.

    The residual is explained by the effects that predict rows which were left out, each for its own evidence; what no
    effect explains is described by the covariates that it follows. Effects that are named are then fitted on the
    forward model.

    fitted, covariance : the model's effects and the joint covariance of their parameters, None where not known; they
        are refitted along.
    effects : the library.
    progress : called with a text when a stage begins.
    criteria : numbers of the verdict; those of the comparison are the recording's.

    A recording of more rows than `criteria.search.max_rows` is thinned evenly; the result is of those that were kept.

    Raises CompdError as `compare` does.

    Example::

        diagnosis = diagnose(aligned, (), None, list(load_library().values()))
        diagnosis.verdict  # "identified"
        [step.effect.id for step in diagnosis.steps]  # ["link_elasticity"]
    """
    progress(stages.COMPARISON)
    aligned = thinned(aligned, criteria.search.max_rows)
    before = compare(aligned, fitted, covariance)
    explanation = explain_residual(before, effects, progress, criteria)
    progress(stages.FIT)
    return _diagnosis(explanation, covariance)


def candidate_pool(
    before: Comparison, effects: Sequence[Effect], criteria: CandidateCriteria = CandidateCriteria()
) -> CandidatePool:
    """What may explain the residual of a comparison: effects that its model has not, also at periods that the residual
    suggests, and what stands for effects that were not measured.

    effects : the library.
    """
    aligned = before.aligned
    present = [effect.effect.id for effect in before.fitted]
    pool = library_pool(aligned, effects, present, criteria)
    tried = {candidate.name: candidate.effect for candidate in pool.candidates}.values()
    return replace(
        pool,
        candidates=(*pool.candidates, *periodic_candidates(aligned, tried, before.residual_um, before.used)),
        proxies=proxy_candidates(aligned, effects, present, criteria),
    )


def explain_residual(
    before: Comparison,
    effects: Sequence[Effect],
    progress: Progress = lambda status: None,
    criteria: Criteria = Criteria(),
) -> Explanation:
    """What explains the residual of a comparison: effects, descriptions, the constant; nothing is fitted yet.

    effects, progress, criteria : as of `diagnose`.
    """
    progress(stages.CANDIDATES)
    pool = candidate_pool(before, effects, criteria.candidates)
    problem = build_problem(before, pool, criteria)
    explanation = explain(problem, progress)
    if (counted := _counted_anew(explanation)) is not None:
        before = counted
        problem = build_problem(before, pool, criteria)
        explanation = explain(problem, progress)
    # which rows are gross, and what explains the others, depend on one another: both are determined twice
    members = [explanation.losses.candidates[k] for k in explanation.members]
    weights = explanation.problem.weigh_beside(members)
    problem = build_problem(before, pool, criteria, weights)
    explanation = explain_little(explain_again(problem, explanation, progress))
    named = named_members(explanation.losses, explanation.members)
    return replace(explanation, members=with_intercepts(explanation.losses, named))


def _counted_anew(explanation: Explanation) -> Comparison | None:
    """The comparison with what neighbouring rows show as its noise, where what is left contradicts the declared one."""
    problem = explanation.problem
    if not problem.may_be_noise(explanation.loss):
        left_um = problem.residual_beside_um(explanation.losses, explanation.members)
        return counted_by_neighbours(problem.comparison, left_um)
    return None if explanation.members else counted_by_neighbours(problem.comparison)


def _diagnosis(explanation: Explanation, covariance: FloatArray | None) -> Diagnosis:
    """Fit the effects that are named, and state the verdict with its evidence."""
    problem = explanation.problem
    losses, aligned, criteria = explanation.losses, problem.aligned, problem.criteria
    before = compare(aligned, problem.comparison.fitted, covariance, outlier=problem.gross)
    before = replace(before, floor=problem.comparison.floor)
    explanation, p_value_by_effect = _without_chance(explanation)
    after = before
    if explanation.named:
        links = aligned.rows.links
        new = [losses.candidates[k] for k in explanation.named]
        initial = [*before.fitted, *(initial_effect(c.effect, c.constants, links) for c in new)]
        result = fit(aligned, initial, problem.sigma_um, outlier=problem.gross)
        result = with_disturbances(result, aligned, problem.sigma_um, problem.pool.candidates, criteria)
        after = compare(aligned, result.fitted, result.covariance, outlier=problem.gross)
        after = replace(after, floor=before.floor if _noise_grows(before, after) == 1.0 else after.floor)
    named = dict(zip(explanation.named, after.fitted[len(before.fitted) :], strict=True))
    steps = _steps(problem, explanation, named, p_value_by_effect)
    candidates = candidate_results(problem, losses, steps, p_value_by_effect)
    verdict = _verdict(problem, explanation, steps, candidates, _noise_grows(before, after))
    probability = _probability(explanation, verdict, steps)
    if verdict == "identified" and not probability.confirms:
        verdict = "likely"
    above = verdict in ("partial", "unexplained", "not_testable")
    asked = implausible_effect(problem, explanation) if above else None
    depends_on = describe_remainder(problem, explanation) if above else ()
    if asked is not None:
        # where the platform was at a time looks like the time
        depends_on = tuple(finding for finding in depends_on if not finding.is_change)
    diagnosis = Diagnosis(
        verdict,
        before,
        after,
        steps,
        candidates,
        depends_on,
        constant=describe_constant(problem, explanation, named, after.constant_um),
        gross=gross_rows(problem.gross, aligned.recording.row, criteria.gross),
        untested=_untested(problem, explanation, steps),
        asked=asked,
        start=_states(problem, explanation),
        heldout_before_um=problem.unit_um * float(np.sqrt(losses.baseline)),
        heldout_after_um=problem.unit_um * float(np.sqrt(losses.loss(explanation.named))),
        left_interval_um=left_interval_um(problem, losses, explanation.named),
        probability_from=probability,
        criteria=criteria,
    )
    return replace(
        diagnosis,
        next_measurement=propose_measurement(problem, explanation, diagnosis),
        summary=summary(diagnosis),
    )


def _noise_grows(before: Comparison, after: Comparison) -> float:
    """By how much the variance of the noise grows with the effects that were found: a thermometer's noise is noise."""
    if not (before.floor.known and after.floor.known) or before.floor.source != after.floor.source:
        return 1.0
    quantities_um = rms(after.uncertainty.quantities_um[after.used][:, after.aligned.lengths])
    return 1.0 + (quantities_um / before.floor.um) ** 2


def _states(problem: DiagnosisProblem, explanation: Explanation) -> UnknownStates | None:
    if (start := explanation.start) is None:
        return None
    before_um, after_um = (problem.unit_um * float(np.sqrt(loss)) for loss in (start.before, start.after))
    return UnknownStates(start.lag.effect.id, problem.states, before_um, after_um)


def _verdict(
    problem: DiagnosisProblem,
    explanation: Explanation,
    steps: Sequence[DiagnosisStep],
    candidates: Sequence[CandidateResult],
    grown: float,
) -> Verdict:
    """At the floor nothing, one or several effects are missing; above it, or where it is not known, the rest remains.

    Beside effects that are named the unnamed ones may leave what their standard errors allow for. Where the noise is
    not known, whether something is missing can be told only by finding it; a declaration that is smaller says that
    something is.

    grown : by how much the variance of the noise grows by that of the quantities from which effects are computed.
    """
    found = bool(explanation.described)
    unnamed = problem.criteria.disturbance**2 if steps else 0.0
    if not found and problem.may_be_noise(explanation.loss / grown - unnamed):
        if not steps:
            return "adequate"
        if any(step.rivals for step in steps):
            return "ambiguous"
        effects = [step.effect for step in steps]
        once = seen_once(problem.aligned, problem.comparison.used, effects, problem.criteria)
        return "likely" if once or little_effects(steps, problem.criteria) else "identified"
    if steps:
        return "partial"
    may_be_noise = not problem.floor_known and not problem.comparison.floor.above_declared
    if not found and (may_be_noise or all(c.status == "not_testable" for c in candidates)):
        return "not_testable"
    return "unexplained"


def _probability(explanation: Explanation, verdict: Verdict, steps: Sequence[DiagnosisStep]) -> NamedProbability:
    """How probable it is that the named set is right. Where descriptions refuse every effect, no score is compared."""
    problem = explanation.problem
    criteria = problem.criteria.probability
    if verdict == "not_testable":
        return NamedProbability(unknown=NOT_TESTED, criteria=criteria)
    refused = bool(explanation.described) and not steps
    return NamedProbability(
        better_sets=0.0 if refused else better_sets(explanation.losses, explanation.members),
        sets_told=prod(1 + len(step.rivals) for step in steps),
        above_noise=problem.floor_known and verdict in ("partial", "unexplained") and not explanation.described,
        criteria=criteria,
    )


def _steps(
    problem: DiagnosisProblem,
    explanation: Explanation,
    named: Mapping[int, FittedEffect],
    p_value_by_effect: Mapping[str, float],
) -> tuple[DiagnosisStep, ...]:
    """One effect after another, with what each adds to those before it.

    The constant, where it is a member, stands before all: what it takes is no effect's.
    """
    losses, floor = explanation.losses, 1.0 if problem.floor_known else 0.0
    before = tuple(k for k in explanation.named if k not in explanation.effects)
    steps = []
    for k in explanation.effects:
        loss_before, loss = losses.loss(before), losses.loss((*before, k))
        before = (*before, k)
        fitted = named[k]
        links = problem.aligned.rows.links
        parameters = estimate_parameters(fitted.effect, links, fitted.theta, fitted.covariance, problem.criteria)
        steps.append(
            DiagnosisStep(
                fitted=fitted,
                rivals=_rivals(explanation, k),
                heldout_rms_um=problem.unit_um * float(np.sqrt(loss)),
                explained_fraction=explained_fraction(loss_before, loss, floor),
                p_value=p_value_by_effect[fitted.effect.id],
                parameters=tuple(parameters),
                taken=problem.above_floor(loss_before) - problem.above_floor(loss),
            )
        )
    return tuple(steps)


def _rivals(explanation: Explanation, member: int) -> tuple[Rival, ...]:
    """Effects that would do in a member's place, with the descriptions or without: these settle no contest."""
    rivals = find_rivals(explanation.losses, explanation.members, member)
    if explanation.described:
        known = {rival.name for rival in rivals}
        others = find_rivals(explanation.losses, explanation.named, member)
        rivals += tuple(rival for rival in others if rival.name not in known)
    return rivals


def _without_chance(explanation: Explanation) -> tuple[Explanation, dict[str, float]]:
    """The explanation without the effects that noise alone does as well as, and the p-value of each effect."""
    losses = explanation.losses
    while True:
        p_values = _p_values(losses, explanation.members)
        weak = [k for k in explanation.effects if p_values[losses.name(k)] > losses.criteria.p_value]
        if not weak:
            return explanation, p_values
        weakest = max(weak, key=lambda k: p_values[losses.name(k)])
        explanation = replace(explanation, members=tuple(k for k in explanation.members if k != weakest))


def _p_values(losses: SubsetLosses, members: tuple[int, ...]) -> dict[str, float]:
    """p-value of each effect of the library, corrected for all of them and for their nonlinear constants.

    Of an effect among the members of the set: beside the other members; of any other: alone, beside the constant.
    """
    library = [k for k, candidate in enumerate(losses.candidates) if candidate.kind == "effect"]
    member_by_name = {losses.name(k): k for k in members if k in library}
    constant = [k for k in members if losses.candidates[k].kind == "constant"]
    families, by_place = {}, []
    names = dict.fromkeys(losses.name(k) for k in library)
    for name in names:
        others = beside(losses, members, member_by_name[name]) if name in member_by_name else constant
        nuisance = losses.nuisance_with(others).values
        complement = OrthogonalComplement(nuisance)
        own = [k for k in library if losses.name(k) == name]
        variants = [complement(losses.values[k]) for k in own]
        best_of = [losses.candidates[k].best_of for k in own]
        families[name] = Family(variants, complement(losses.data.y), best_of)
        # each effect has an equal part of the chance, whatever was searched for another
        tried = len(names) * sum(best_of)
        values = [losses.values[k] for k in own]
        by_place.append(
            place_p_value(losses.data.y, nuisance, values, tried, losses.data.place, losses.criteria.search)
        )
    found = p_values(list(families.values()), losses.data.block, losses.criteria.search.sign_flips)
    return dict(zip(families, np.maximum(found, by_place).tolist(), strict=True))


def _untested(
    problem: DiagnosisProblem, explanation: Explanation, steps: Sequence[DiagnosisStep]
) -> tuple[UntestedEffect, ...]:
    """Effects that cannot be tried, first those that may be what was found: by a proxy, or as a rival."""
    likely = {explanation.losses.candidates[k].effect.id for k in explanation.proxies}
    likely |= {rival.name for step in steps for rival in step.rivals}
    reasons = dict(problem.pool.untestable)
    if problem.aligned.ends is not None:
        reasons |= {candidate.effect.id: why_nothing_else(problem) for candidate in problem.same_as_nuisance}
    untested = [UntestedEffect(name, why, name in likely) for name, why in reasons.items()]
    return tuple(sorted(untested, key=lambda effect: not effect.likely))
