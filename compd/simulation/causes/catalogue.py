"""The causes that can be hidden in a simulated machine, by id.

A new cause is a class in the module of its family (and in that module's CAUSES); nothing else has to be edited.
Random numbers belong to a cause's id, not to its place in a list: one cause more changes no other cause's parts, and
a random choice only where the new cause is chosen.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Iterable, Mapping

import numpy as np

from compd.operation_settings import Wiring
from compd.simulation.causes import actuators, comparators, joints, link, outside_library, reference, scale, tool
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.mechanism import Mechanism

CAUSES: Mapping[str, type[Cause]] = {
    cause.id: cause
    for module in (scale, comparators, link, joints, tool, reference, outside_library, actuators)
    for cause in module.CAUSES
}


def possible_causes(mechanism: Mechanism, wiring: Wiring | None = None) -> list[str]:
    """Ids of the causes that this machine can have.

    wiring : tells whether there are joint comparators; left out: there are.
    """
    unwired = wiring is not None and not wiring.joint
    return [
        name
        for name, cause in CAUSES.items()
        if cause.applies_to(mechanism) and not (unwired and cause.acts_on_joint_comparators)
    ]


def build_cause(name: str, strength: float, mechanism: Mechanism, seed: int) -> Cause:
    """The cause `name` with its parts. The same seed gives the same parts at every strength.

    strength : as `Cause.strength`, the reciprocal of what is stated for a stiffness.
    """
    return CAUSES[name](strength, mechanism, np.random.default_rng([seed, zlib.crc32(name.encode())]))


def shuffle_causes(names: Iterable[str], seed: int, purpose: str) -> list[str]:
    """The names in a random order that follows from seed and purpose.

    Sorted by a hash of (purpose, seed, name): one name more is inserted somewhere, and the others keep their order.
    """
    return sorted(names, key=lambda name: hashlib.sha256(f"{purpose}/{seed}/{name}".encode()).digest())
