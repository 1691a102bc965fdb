"""The causes that can be hidden in a simulated machine, by id.

A new cause is a class in the module of its family (and in that module's CAUSES); nothing else has to be edited.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from compd.simulation.causes import comparators, joints, link, outside_library, reference, scale, tool
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.mechanism import Mechanism

CAUSES: Mapping[str, type[Cause]] = {
    cause.id: cause
    for module in (scale, comparators, link, joints, tool, reference, outside_library)
    for cause in module.CAUSES
}


def possible_causes(mechanism: Mechanism) -> list[str]:
    """Ids of the causes that this machine can have."""
    return [name for name, cause in CAUSES.items() if cause.applies_to(mechanism)]


def build_cause(name: str, strength: float, mechanism: Mechanism, seed: int) -> Cause:
    """The cause `name` with its parts. The same seed gives the same parts at every strength.

    strength : as `Cause.strength`, the reciprocal of what is stated for a stiffness.
    """
    number = list(CAUSES).index(name)
    return CAUSES[name](strength, mechanism, np.random.default_rng([seed, number]))
