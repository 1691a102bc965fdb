"""What the machine, the daemon and its computer do while a fault lasts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum

from tests.injection.beginnings import REST_MM
from tests.injection.case import Case
from tests.injection.cases_of_processes import PROCESSES
from tests.injection.virtual import VirtualMachine

# Where a machine in motion drives, one after the other: no link always the same way.
PLACES_MM = ((9.0, 11.0, 14.0), (-6.0, 9.0, 3.0), (8.0, -7.0, 12.0), REST_MM)


class Situation(Enum):
    """The value is for people."""

    REST = "at rest"
    MOTION = "in motion"
    RESTART = "restarted"
    LOAD = "busy computer"

    def fits(self, case: Case) -> bool:
        """Whether a fault can be tried so. A fault that drives is in motion by itself; one of the daemon's processes is
        none of a daemon that starts."""
        if self is Situation.MOTION:
            return True
        return not case.drives and not (self is Situation.RESTART and case.group == PROCESSES)

    @contextmanager
    def lasting(self, machine: VirtualMachine) -> Iterator[None]:
        """During the block, but for a restart."""
        match self:
            case Situation.MOTION:
                with machine.shuttling(PLACES_MM):
                    yield
            case Situation.LOAD:
                with machine.busy():
                    yield
            case _:
                yield
