"""Every effect of the library with its status, and the reason why it is named or not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import erfc

from compd.arrays import FloatArray
from compd.diagnosis.candidates.candidates import Candidate
from compd.diagnosis.candidates.plausibility import estimate_parameters, is_undetermined
from compd.diagnosis.findings import CandidateResult, DiagnosisStep, ParameterEstimate, Status
from compd.diagnosis.search.problem import DiagnosisProblem
from compd.diagnosis.search.subset_losses import Subset, SubsetLosses
from compd.text import chance_text, estimate_text, join_words, number_text

# Numbers of a combination that are named: those with so large a share of its largest.
_NAMED_SHARE = 0.3
MAX_NAMED = 6
# Cosine from which two motions of the rows are said to be alike.
_ALIKE = 0.95


def undetermined_text(problem: DiagnosisProblem, losses: SubsetLosses, member: int) -> str:
    """What the least certain combination of an effect's numbers does on these rows, in words.

    The combination is that of the largest variance, each number measured by the width of its plausible range: the
    direction of the smallest singular value of the scaled Jacobian.
    """
    candidate = losses.candidates[member]
    _, covariance = losses.estimates([member])[0]
    width = np.ptp(candidate.limits, axis=1)
    if not (np.isfinite(width).all() and np.isfinite(covariance).all()):
        return ""
    _, directions = np.linalg.eigh(covariance / np.outer(width, width))
    share = directions[:, -1]
    names = [column.name for column in candidate.effect.columns(problem.aligned.rows.links)]
    named = [
        name for name, part in zip(names, np.abs(share), strict=True) if part >= _NAMED_SHARE * np.abs(share).max()
    ]
    who = join_words(named) if len(named) <= MAX_NAMED else f"{named[0]} to {named[-1]}"
    together = " together act" if len(named) > 1 else " acts"
    rows = problem.whiten(candidate.columns_um)
    moved = rows.reshape(-1, rows.shape[2]) @ (share * width)
    like = _like(problem, losses, candidate, moved)
    if like:
        return f"{who}{together} like {like}"
    move = "together move" if len(named) > 1 else "moves"
    return f"{who} {move} these rows too little to be told from the error that is left"


def _like(problem: DiagnosisProblem, losses: SubsetLosses, candidate: Candidate, moved: FloatArray) -> str:
    """What else moves the rows as `moved` does: what is fitted along, or a number of another effect; "" for nothing."""
    nuisance = losses.data.nuisance.values
    along = nuisance.reshape(len(moved), nuisance.shape[2])
    if along.shape[1]:
        explained = along @ np.linalg.lstsq(along, moved, rcond=None)[0]
        if explained @ explained >= _ALIKE**2 * (moved @ moved):
            registered = "the instrument's frame and target" if problem.aligned.registered else "a constant"
            return f"{registered}, which is fitted along"
    best, found = _ALIKE, ""
    for other in losses.candidates:
        if other.kind != "effect" or other.name == candidate.name:
            continue
        values = problem.whiten(other.columns_um)
        columns = values.reshape(len(moved), values.shape[2])
        cosines = np.abs(moved @ columns) / (np.linalg.norm(columns, axis=0) * np.linalg.norm(moved) + 1e-300)
        k = int(np.argmax(cosines))
        if cosines[k] >= best:
            best, found = cosines[k], f"{other.name} {other.effect.columns(problem.aligned.rows.links)[k].name}"
    return found


def candidate_results(
    problem: DiagnosisProblem, losses: SubsetLosses, steps: Sequence[DiagnosisStep], p_values: Mapping[str, float]
) -> tuple[CandidateResult, ...]:
    """One result per effect, tried alone at its best nonlinear constants: the best first, then those not testable.

    steps : the effects that were named.  p_values : by effect, corrected for all that were tried.
    """
    results = [
        _result_alone(problem, losses, subset, steps, p_values.get(name, float("nan")))
        for name, subset in losses.best_variants.items()
        if losses.candidates[subset.members[0]].kind == "effect"
    ]
    names = dict.fromkeys(candidate.name for candidate in losses.candidates if candidate.kind == "effect")
    why = "acts in one session or sector only: what it does there predicts no other"
    results += [CandidateResult(name, "not_testable", why) for name in names if name not in losses.best_variants]
    why = why_nothing_else(problem)
    results += [CandidateResult(candidate.name, "not_testable", why) for candidate in problem.same_as_nuisance]
    results += [CandidateResult(name, "not_testable", reason) for name, reason in problem.pool.untestable.items()]
    return tuple(results)


def why_nothing_else(problem: DiagnosisProblem) -> str:
    """Why effects cannot be seen that do nothing but what is fitted along in any case."""
    if (ends := problem.aligned.ends) is None and problem.aligned.target is not None:
        return (
            "moves these rows as the instrument's frame or the target's place does, which are fitted along; "
            "`--hold target.place` leaves the place out"
        )
    if ends is None:
        return "makes nothing on these rows but a constant, which is fitted along"
    fixed = "fixed balls" if ends.of_lengths else "pins"
    return f"makes nothing on these rows but a shift of the {fixed}, which is fitted along"


def explained_fraction(before: float, after: float, floor: float) -> float:
    """phi = (SSE0 - SSE1) / (SSE0 - n sigma^2), from losses in squares of the noise floor; 0 where nothing is above.

    floor : 1, or 0 where the noise is not known.
    At most 1: the floor is known to some per cent only, so that more than what is above it can be explained::

        explained_fraction(5.0, 2.0, 1.0)  # 0.75
    """
    return min((before - after) / (before - floor), 1.0) if before > floor else 0.0


def _result_alone(
    problem: DiagnosisProblem, losses: SubsetLosses, subset: Subset, steps: Sequence[DiagnosisStep], p_value: float
) -> CandidateResult:
    """The result of one effect at its best nonlinear constants."""
    member = subset.members[0]
    candidate = losses.candidates[member]
    theta, covariance = losses.estimates(subset.members)[0]
    links = problem.aligned.rows.links
    parameters = tuple(estimate_parameters(candidate.effect, links, theta, covariance, problem.criteria))
    floor = 1.0 if problem.floor_known else 0.0
    fraction = explained_fraction(losses.baseline, subset.cv_loss, floor)
    rms_um = problem.unit_um * float(np.sqrt(max(subset.cv_loss, 0.0)))
    gain = losses.log_loss(losses.baseline) - losses.log_loss(subset.cv_loss)
    # what as many numbers take of pure noise
    akaike = losses.criteria.number_price * len(parameters)
    unit = problem.aligned.unit
    status: Status
    if (named := _reason_of_explaining(candidate.name, candidate.effect.separated_by, steps)) is not None:
        status, why = "explains", named
    elif gain >= losses.price(member) and (implausible := [p for p in parameters if not p.plausible]):
        status, why = "partial", f"only with implausible numbers: {_values(implausible[:3])}"
    elif akaike <= gain < losses.price(member) and (sure := _surest(losses, parameters)):
        status, own_um = "too_small", problem.unit_um * float(np.sqrt(max(losses.baseline - subset.cv_loss, 0.0)))
        why = f"{sure} from nought; it does {number_text(own_um, unit)}, too little for a name"
    elif is_undetermined(candidate.limits, np.sqrt(np.diag(covariance))):
        status, why = "not_testable", "its numbers stay less certain than their plausible ranges are wide"
        if combination := undetermined_text(problem, losses, member):
            why += f": {combination}"
    elif gain < losses.price(member) and problem.is_at_floor(losses.baseline):
        status, why = "no_gain", "only noise is left for it to explain"
    elif gain < losses.price(member):
        status, why = "no_gain", f"takes {100 * max(fraction, 0.0):.0f} % of the error away: not worth a name"
    elif steps:
        status, why = "partial", "nothing more beside what is named"
    else:
        chance = f"noise alone does this {chance_text(p_value)}" if p_value > 0 else "that may be chance"
        others = "others or descriptions do better" if len(losses.candidates) > 1 and losses.describes else chance
        reason = "" if np.isnan(p_value) and others == chance else f": {others}"
        status, why = "partial", f"leaves {number_text(rms_um, unit)}{reason}"
    if status in ("no_gain", "too_small") and problem.is_at_floor(losses.baseline):
        fraction = float("nan")
    return CandidateResult(candidate.name, status, why, rms_um, fraction, p_value, parameters)


def _surest(losses: SubsetLosses, parameters: Sequence[ParameterEstimate]) -> str:
    """The plausible parameter that is farthest from nought in standard errors; "" if noise makes one as far.

    Each parameter of each candidate had its chance, whence the level is divided by their number (Bonferroni).
    """
    surest = max(parameters, key=_sigmas)
    sigmas = _sigmas(surest)
    tried = sum(values.shape[-1] for values in losses.values)
    if not surest.plausible or tried * float(erfc(sigmas / np.sqrt(2.0))) > losses.criteria.p_value:
        return ""
    return f"{surest.name} = {estimate_text(surest.value, surest.std, surest.unit)}, {sigmas:.0f} standard errors"


def _sigmas(parameter: ParameterEstimate) -> float:
    return abs(parameter.value) / parameter.std if parameter.std > 0 else 0.0


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
