"""The machines of the scoreboard that compd does not know."""

from __future__ import annotations

from tests.scoreboard.case import Case
from tests.scoreboard.external_gantry import BED
from tests.scoreboard.external_machine import ExternalMachine
from tests.scoreboard.external_printer import PRINTER
from tests.scoreboard.external_stage import STAGE

MACHINES = (STAGE, BED, PRINTER)


def machine_of(case: Case) -> ExternalMachine | None:
    """The external machine of a case; None for one that compd knows."""
    return next((machine for machine in MACHINES if case.causes and case.causes[0] in machine.causes), None)
