"""What an invariant sees of a world at one setpoint."""

from __future__ import annotations

import math
from typing import NamedTuple

from compd.configuration import Configuration
from compd.live.loop import Setpoint
from tests.worlds.coverage import NO_FAULT, Case
from tests.worlds.faults.fault import Fault
from tests.worlds.plan import Event
from tests.worlds.world import Told

# A fault has consequences for so long after its end, s.
AFTER_S = 5.0


class Happening(NamedTuple):
    """An event that a world plays. is_fault : False for ordinary work."""

    event: Event
    fault: Fault
    is_fault: bool

    def concerns(self, now_s: float) -> bool:
        """Whether it is present or ended less than `AFTER_S` ago."""
        return now_s < self.fault.ended_s + AFTER_S


class Sight(NamedTuple):
    """One setpoint, with what is true of it.

    before : last valid setpoint before it. recent : what is present or ended less than `AFTER_S` ago, oldest first.
    suspects : gauges that had a fault since a person last looked; "" where it could be any.
    left_um : the error without the part that no data can show. departed : whether the machine moves and no reading
    shows it yet.
    """

    configuration: Configuration
    setpoint: Setpoint
    told: Told
    before: Setpoint | None
    recent: tuple[Happening, ...]
    suspects: frozenset[str]
    left_um: float
    departed: bool = False

    @property
    def bound_um(self) -> float:
        """`protect_tip_um` of a setpoint that has it, else `u_tip_um`; nan where there is none."""
        protect_um = getattr(self.setpoint, "protect_tip_um", None)
        return self.told.u_tip_um if protect_um is None or math.isnan(protect_um) else protect_um

    @property
    def faults(self) -> tuple[Happening, ...]:
        return tuple(happening for happening in self.recent if happening.is_fault)

    @property
    def cases(self) -> set[Case]:
        """What the setpoint is counted under: its state, with each family of fault."""
        state = "departure" if self.departed else "after" if self.faults else "motion" if self.told.moving else "rest"
        families = {happening.event.family for happening in self.faults}
        return {Case(state, family) for family in families or {NO_FAULT}}

    @property
    def counted_um(self) -> float:
        """The error for the coverage: of a departure, which has its own case, all of it."""
        return self.told.error_um if self.departed else self.left_um

    @property
    def blame(self) -> str:
        """Kinds of fault that are present or have just ended."""
        return ", ".join(sorted({happening.event.name for happening in self.faults})) or NO_FAULT
