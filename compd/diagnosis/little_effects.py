"""Effects that take little, so that they may be what others are or leave: they are likely at most.

A larger effect of nearly the right form leaves what another one takes. Alone, an effect that takes hardly more than all
that stays unnamed is known to act, and hardly which.
"""

from __future__ import annotations

from collections.abc import Sequence

from compd.diagnosis.criteria import Criteria
from compd.diagnosis.findings import DiagnosisStep


def little_effects(steps: Sequence[DiagnosisStep], criteria: Criteria) -> list[str]:
    """Ids of the effects that take less than `least_alone`, or less than `least_beside` beside those before them."""
    least = [criteria.least_alone, *[criteria.least_beside] * (len(steps) - 1)]
    return [step.effect.id for step, squares in zip(steps, least, strict=False) if step.taken < squares]
