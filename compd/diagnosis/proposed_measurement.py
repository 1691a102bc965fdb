"""What a diagnosis proposes to measure next: what would settle the first question that it leaves open."""

from __future__ import annotations

from typing import Any

from compd.diagnosis.findings import EmpiricalFinding
from compd.diagnosis.search.explanation import Explanation
from compd.diagnosis.search.problem import DiagnosisProblem
from compd.diagnosis.verdict import Diagnosis
from compd.planning import measurement_of_constant, measurement_to_test, next_measurement
from compd.text import clock_text

# Covariates that the proposal names.
MAX_COVARIATES = 2


def propose_measurement(
    problem: DiagnosisProblem, explanation: Explanation, diagnosis: Diagnosis
) -> list[dict[str, Any]]:
    """Rows, or words under `measure` and `why`: about rivals, else about an effect without its gauge, else about what
    the residual follows, else about where a constant comes from.
    """
    aligned, candidates = problem.aligned, explanation.losses.candidates
    fitted, criteria = diagnosis.after.fitted, problem.criteria.planning
    for step in diagnosis.steps:
        if step.rivals:
            others = [effect for effect in fitted if effect is not step.fitted]
            rival = candidates[step.rivals[0].member]
            found = next_measurement(
                aligned,
                others,
                step.fitted,
                rival.effect,
                problem.sigma_um,
                constants=rival.constants,
                criteria=criteria,
            )
            return found.as_json()
    by_id = {candidate.effect.id: candidate.effect for candidate in candidates if candidate.kind == "proxy"}
    likely = [by_id[untested.effect] for untested in diagnosis.untested if untested.likely]
    if likely:
        return measurement_to_test(aligned, fitted, likely[0], problem.sigma_um, criteria=criteria).as_json()
    for finding in diagnosis.depends_on[:1]:
        if finding.is_change:
            return [
                {
                    "measure": "some of the first rows once more: is the machine as it was then?",
                    "why": f"{finding.effect or 'everything'} changed at {clock_text(finding.time_s)}: look what "
                    "happened there",
                }
            ]
    if not problem.floor_known:
        return [
            {
                "measure": "one point twice in a row, at ten places, with the same number in a column `visit`",
                "why": "without repeats or a declared uncertainty nobody knows how much of the error is noise",
            }
        ]
    follows = [finding for finding in diagnosis.depends_on if not finding.effect and finding.covariate != "time_s"]
    if follows:
        return [_to_vary(finding) for finding in follows[:MAX_COVARIATES]]
    constant = diagnosis.constant
    causes = [candidate.effect for candidate in problem.same_as_nuisance]
    if constant is not None and len(causes) > 1:
        by_axis = problem.comparison.constant_um
        return measurement_of_constant(aligned, fitted, causes, by_axis, problem.sigma_um, criteria=criteria).as_json()
    return []


def _to_vary(finding: EmpiricalFinding) -> dict[str, Any]:
    return {
        "measure": f"vary {finding.covariate} alone, everything else as it is, at three places and back again",
        "why": f"the residual follows it ({finding.form}, at the {finding.port})",
    }
