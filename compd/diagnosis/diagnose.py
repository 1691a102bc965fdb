"""Which physical effect is missing: from a recording and a model to a verdict with its evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from compd.arrays import FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.compare import compare
from compd.comparison.shape_search import search_constants
from compd.diagnosis.candidate_results import judged
from compd.diagnosis.candidates import library_pool
from compd.diagnosis.empirical_search import EmpiricalFinding, Rest, held_out_losses, ranked, together
from compd.diagnosis.explanation import Explanation, Progress, explain, held_block
from compd.diagnosis.measurement_programmes import limits_of
from compd.diagnosis.next_measurement import plan
from compd.diagnosis.problem import DiagnosisProblem
from compd.diagnosis.rivals import rivals
from compd.diagnosis.selection import MOST_LEFT, at_floor, cost, explained_fraction, numbers
from compd.diagnosis.significance import Projection, chances
from compd.diagnosis.subset_search import Contest, Members
from compd.diagnosis.unmodelled import with_disturbances
from compd.diagnosis.verdict import Diagnosis, DiagnosisStep, Verdict
from compd.errors import CompdError
from compd.model.effect import Effect, FittedEffect

# Gross rows and the best explanation depend on one another: so often they are looked at again.
ROUNDS = 3
# Rows of the next measurement that a diagnosis proposes of itself; `compd plan` gives as many as are wanted.
NEXT_ROWS = 12


def diagnose(
    aligned: AlignedRecording,
    fitted: Sequence[FittedEffect],
    covariance: FloatArray | None,
    effects: Sequence[Effect],
    progress: Progress = lambda said: None,
) -> Diagnosis:
    """Learn which effects the model lacks on this recording.

    fitted, covariance : the model's effects, refitted along.  effects : the library.  progress : told what begins.
    Raises CompdError as `compare` does.
    """
    progress("comparing the model with the recording")
    before = compare(aligned, fitted, covariance)
    progress("what each effect would do")
    pool = library_pool(aligned, effects, [one.effect.id for one in fitted])
    bench = DiagnosisProblem(before, pool)
    found = explain(bench, progress)
    for _ in range(ROUNDS - 1):
        outlier = bench.outliers_beside(found.members, found.contest)
        if (outlier == bench.outlier).all():
            break
        bench = DiagnosisProblem(before, pool, outlier)
        found = explain(bench, progress)
    progress("fitting on the real forward model")
    return _diagnosis(bench, found, covariance)


def _diagnosis(bench: DiagnosisProblem, found: Explanation, covariance: FloatArray | None) -> Diagnosis:
    contest, aligned, before = found.contest, bench.aligned, bench.before
    effects = _worth_naming(found)
    chance = _chances(contest, effects)
    current, joint = before.fitted, covariance
    for number, k in enumerate(effects, start=1):
        result = search_constants(aligned, current, contest.candidates[k].effect, bench.sigma_um)
        if number == len(effects):
            result = with_disturbances(result, aligned, bench.sigma_um, bench.pool.candidates)
        current, joint = result.fitted, result.covariance
    after = compare(aligned, current, joint) if effects else before
    quiet = not found.described and at_floor(after.floor_ratio, contest.base - 1.0 if effects else 0.0)
    steps = _steps(bench, found, effects, current[len(before.fitted) :], chance, quiet)
    candidates = judged(bench, contest, steps, chance)
    depends = () if quiet else _depends(bench, found, effects)
    verdict: Verdict = "unexplained"
    if quiet:
        ambiguous = any(step.rivals for step in steps)
        verdict = "adequate" if not steps else "ambiguous" if ambiguous else "identified"
    elif not depends and not steps and all(one.status in ("not_testable", "no_gain") for one in candidates):
        verdict = "not_testable" if any(one.status == "not_testable" for one in candidates) else "unexplained"
    diagnosis = Diagnosis(verdict, before, after, steps, candidates, depends)
    return replace(diagnosis, next_measurement=_next(bench, diagnosis))


def _worth_naming(found: Explanation) -> Members:
    """The effects of the best set; none where they leave much that nothing describes either: a likeness, no cause."""
    contest, effects = found.contest, found.effects
    if not effects or found.described:
        return effects
    loss = contest.entries([effects])[0].loss
    enough = explained_fraction(contest.base, loss) >= 1 - 2 * MOST_LEFT
    return effects if enough or at_floor(loss, contest.base - 1.0) else ()


def _steps(
    bench: DiagnosisProblem,
    found: Explanation,
    effects: Members,
    fitted: Sequence[FittedEffect],
    chance: Mapping[str, float],
    quiet: bool,
) -> tuple[DiagnosisStep, ...]:
    """One effect after another, with what each adds. Rivals are looked for where the end is at the floor."""
    contest, noise_um = found.contest, bench.before.floor.um
    steps, left = [], contest.base
    for place, one in enumerate(fitted):
        loss = contest.entries([effects[: place + 1]])[0].loss
        known = numbers(one.effect, bench.aligned.rows.links, one.theta, one.covariance)
        others = rivals(contest, effects, place) if quiet else ()
        phi = explained_fraction(left, loss)
        steps.append(
            DiagnosisStep(one, others, noise_um * float(np.sqrt(loss)), phi, chance[one.effect.id], tuple(known))
        )
        left = loss
    return tuple(steps)


def _depends(bench: DiagnosisProblem, found: Explanation, effects: Members) -> tuple[EmpiricalFinding, ...]:
    """What the rest follows, one line per covariate; two covariates together first, where one is not enough."""
    contest, searched = found.contest, found.searched
    if not searched:
        return ()
    held = held_block(contest, effects)
    rest = Rest(
        bench.evidence,
        held,
        contest.entries([effects])[0].loss if effects else contest.base,
        bench.before.floor.um,
        cost(contest.base - 1.0),
        bench.aligned.rows.links,
    )
    losses = held_out_losses(bench.evidence, held, searched)
    lines = ranked(rest, searched, losses)
    if not lines or at_floor(float(np.nanmin(losses))):
        return lines
    return (*together(rest, searched, float(np.nanmin(losses))), *lines)


def _chances(contest: Contest, effects: Members) -> dict[str, float]:
    """Each effect's chance to look as good by noise alone, corrected for all of them and their shape constants."""
    beside = Projection(contest.evidence.always.values)
    values = [beside(one) for one in contest.values]
    y = beside(contest.evidence.y)
    chosen = list(effects) or [one.members[0] for one in contest.singles[:1]]
    left = Projection(np.concatenate([values[k] for k in chosen], axis=2))(y) if chosen else y
    names = list(dict.fromkeys(one.name for one in contest.candidates if not one.described))
    families = [[v for v, c in zip(values, contest.candidates, strict=True) if c.name == name] for name in names]
    return dict(zip(names, chances(families, y, left, contest.evidence.group).tolist(), strict=True))


def _next(bench: DiagnosisProblem, diagnosis: Diagnosis) -> list[dict[str, object]]:
    """Rows that tell the first rivals apart; for the unexplained, what to vary."""
    for step in diagnosis.steps:
        if step.rivals and bench.aligned.model is not None:
            rival = bench.pool.candidates[step.rivals[0].member]
            try:
                other = search_constants(bench.aligned, bench.before.fitted, rival.effect, bench.sigma_um).fitted[-1]
                pair = (step.fitted, other)
                return [
                    *plan(
                        bench.aligned, bench.before.fitted, pair, bench.sigma_um, limits_of(bench.aligned), NEXT_ROWS
                    ).rows
                ]
            except CompdError as error:
                return [{"measure": step.effect.separated_by, "why": str(error.problems[0].what)}]
    return [
        {
            "measure": f"vary {one.covariate} alone, everything else as it is, at three places and back again",
            "why": f"the rest follows it ({one.form}, at the {one.port})",
        }
        for one in diagnosis.depends_on[:2]
    ]
