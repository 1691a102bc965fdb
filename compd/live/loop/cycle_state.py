"""All that one cycle computes from: with it, its setpoint can be computed again, bit for bit."""

from __future__ import annotations

from typing import NamedTuple

from compd.arrays import FloatArray
from compd.compensation import WarmStart
from compd.errors import StateError
from compd.live.loop.commands import Target
from compd.live.loop.machine_zero import MachineZero
from compd.live.loop.model_loader import Models
from compd.live.loop.stale_policy import ComparatorSet
from compd.model.apply_effects import EffectMemory
from compd.readings import Snapshot


class CycleState(NamedTuple):
    """What a cycle has from the one before it. Nothing in it is ever changed in place.

    zero : the machine zero that was used; None before the first. A new one makes the cycle forget.
    warm : where Newton starts. correction_mm (n) : the correction that stands, from which the next one slews.
    last_good : the newest complete set of comparators; None before the first.
    scales_seen : whether the scales have ever been good: lost ones are then `stop`, not `starting`.
    shadow : what the shadow's effects remember.  adopting : the correction is on its way to a new model's.
    u_tip_um (3) : the tip's standard uncertainty; None where it has not been computed.
    """

    zero: MachineZero | None
    warm: WarmStart
    correction_mm: FloatArray
    last_good: ComparatorSet | None
    scales_seen: bool
    shadow: EffectMemory = EffectMemory()
    adopting: bool = False
    u_tip_um: FloatArray | None = None


class CycleInputs(NamedTuple):
    """One cycle's snapshot, orders as they were read, and what it had from the cycle before."""

    snapshot: Snapshot
    zero: MachineZero | StateError
    target: Target | None
    carried: CycleState
    models: Models | None = None
