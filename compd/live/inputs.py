"""All that one cycle computes from: with it, its setpoint can be computed again, bit for bit."""

from __future__ import annotations

from typing import NamedTuple

from compd.compensation import WarmStart
from compd.errors import StateError
from compd.live.models import Models
from compd.live.protocol import Target
from compd.live.setpoint import Array
from compd.live.stale import Comparators
from compd.live.zero import MachineZero
from compd.model.acting import Remembered
from compd.readings import Snapshot


class Carried(NamedTuple):
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
    correction_mm: Array
    last_good: Comparators | None
    scales_seen: bool
    shadow: Remembered = Remembered()
    adopting: bool = False
    u_tip_um: Array | None = None


class Inputs(NamedTuple):
    """One cycle's snapshot, orders as they were read, and what it had from the cycle before."""

    snapshot: Snapshot
    zero: MachineZero | StateError
    target: Target | None
    carried: Carried
    models: Models | None = None
