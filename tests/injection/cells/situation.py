"""What the machine, the daemon and its computer do while a fault lasts."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum

from tests.injection.beginnings import REST_MM
from tests.injection.case import Case
from tests.injection.cases_of_processes import CLIENTS, PROCESSES
from tests.injection.rig import InjectedMachine

# Where a machine in motion drives, one after the other: no link always the same way.
PLACES_MM = ((9.0, 11.0, 14.0), (-6.0, 9.0, 3.0), (8.0, -7.0, 12.0), REST_MM)
# Cases whose controllers command the place where the machine stands: one that drives does not follow them.
COMMANDING = "client-target"
# More than there are processors, so that the daemon has to wait for one.
BUSY_PROCESSES = 2 * (os.cpu_count() or 1)


class Situation(Enum):
    """The value is for people."""

    REST = "at rest"
    MOTION = "in motion"
    RESTART = "restarted"
    LOAD = "busy computer"

    def fits(self, case: Case) -> bool:
        """Whether a fault can be tried so. A fault that drives is in motion by itself; one of the daemon's processes
        or clients is none of a daemon that starts."""
        match self:
            case Situation.RESTART:
                return not case.drives and case.group not in (PROCESSES, CLIENTS)
            case Situation.MOTION:
                return not case.id.startswith(COMMANDING)
        return not case.drives

    @contextmanager
    def lasting(self, machine: InjectedMachine) -> Iterator[None]:
        """During the block, but for a restart."""
        match self:
            case Situation.MOTION:
                with machine.truth.shuttling(PLACES_MM):
                    machine.truth.wait_for_motion()
                    yield
            case Situation.LOAD:
                with machine.busy(BUSY_PROCESSES):
                    yield
            case _:
                yield
