"""Every effect of the library with the reason why it is named, or why not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from compd.diagnosis.problem import DiagnosisProblem
from compd.diagnosis.selection import cost, explained_fraction, numbers, untestable
from compd.diagnosis.subset_search import Contest, Entry
from compd.diagnosis.verdict import CandidateResult, DiagnosisStep, Status


def judged(
    bench: DiagnosisProblem, contest: Contest, steps: Sequence[DiagnosisStep], chance: Mapping[str, float]
) -> tuple[CandidateResult, ...]:
    """The best first; then those that could not be tried.

    chance : by effect, that noise alone looks as good, corrected for all that were tried.
    """
    found = [
        _alone(bench, contest, entry, steps, chance.get(name, float("nan")))
        for name, entry in contest.best_variant.items()
        if not contest.candidates[entry.members[0]].described
    ]
    names = dict.fromkeys(one.name for one in contest.candidates if not one.described)
    found += [
        CandidateResult(
            name, "not_testable", "acts in one session or sector only: what it does there predicts no other"
        )
        for name in names
        if name not in contest.best_variant
    ]
    found += [CandidateResult(name, "not_testable", why) for name, why in bench.pool.untestable.items()]
    return tuple(found)


def _alone(
    bench: DiagnosisProblem, contest: Contest, entry: Entry, steps: Sequence[DiagnosisStep], chance: float
) -> CandidateResult:
    (k,) = entry.members
    candidate = contest.candidates[k]
    theta, covariance = contest.fitted(entry.members)[0]
    shown = tuple(numbers(candidate.effect, bench.aligned.rows.links, theta, covariance))
    phi = explained_fraction(contest.base, entry.loss)
    rms_um = bench.before.floor.um * float(np.sqrt(max(entry.loss, 0.0)))
    named = [one.effect.id for one in steps]
    rival_of = [one.effect.id for one in steps if candidate.name in [rival.name for rival in one.rivals]]
    gain, worth = contest.base - entry.loss, cost(max(contest.base - 1.0, 0.0), candidate.price)
    strange = [one for one in shown if not one.plausible]
    status: Status
    percent = f"{100 * max(phi, 0.0):.0f} %"
    if candidate.name in named:
        status, why = "explains", f"named, number {named.index(candidate.name) + 1}"
    elif rival_of:
        status, why = "explains", f"as good as {rival_of[0]} on these rows; apart by {candidate.effect.separated_by}"
    elif untestable(candidate.limits, np.sqrt(np.diag(covariance))):
        status, why = "not_testable", "its numbers stay less certain than their plausible ranges are wide"
    elif gain < worth:
        status, why = "no_gain", f"takes {percent} of the error away: not worth a name"
    elif strange:
        values = ", ".join(f"{one.name} = {one.value:.3g} {one.unit}" for one in strange[:3])
        status, why = "partial", f"only with implausible numbers: {values}"
    elif named:
        status, why = "partial", "nothing more beside what is named"
    else:
        status, why = "partial", f"leaves {rms_um:.2g} um: a likeness, not the cause"
    return CandidateResult(candidate.name, status, why, rms_um, phi, chance, shown)
