"""The constant in a diagnosis: its values, and the effects that it may come from."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from compd.arrays import FloatArray
from compd.diagnosis.findings import ConstantFinding
from compd.diagnosis.search.explanation import Explanation
from compd.diagnosis.search.problem import DiagnosisProblem
from compd.diagnosis.search.rivals import find_rivals
from compd.model.effects import FittedEffect


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
