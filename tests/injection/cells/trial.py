"""One cell on a running machine: the fault, the situation, the way out, and what was published meanwhile."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any

from compd.setpoint_states import State
from tests.injection.cells.cell import Cell
from tests.injection.cells.situation import PLACES_MM, Situation
from tests.injection.machine import SETTLED_S, Watched
from tests.injection.trial import BACK_WITHIN_S, settle
from tests.injection.verdict import Verdict, judge
from tests.injection.virtual import VirtualMachine
from tests.support.watching import Seen

# How long a fault's end is given before a person accepts all gauges, and then before the daemon is started anew.
FAULT_SHOWS_S, BY_ITSELF_S = 1.0, 4.0
AFTER_ACCEPTANCE_S = 8.0
# The bound of a machine at rest without a fault, over the 95 % error.
FITS = (1.0, 2.0)


@dataclass
class CellResult:
    """What was seen of a cell; one line of the file of results.

    way_out : "itself", "accepted" or "restarted". problems : what must not be.
    """

    cell: str
    faults: list[str]
    situation: str
    unseen: bool
    verdict: Verdict
    way_out: str
    broken: list[str] = field(default_factory=list)

    @property
    def problems(self) -> list[str]:
        problems = [f"a broken rule: {self.broken[0][:200]}"] if self.broken else []
        if self.way_out == "restarted":
            problems.append("ok again only after a restart that forgets")
        verdict = self.verdict
        if self.unseen:
            return problems
        if not self.faults and (self.way_out != "itself" or not verdict.held):
            problems.append(f"without a fault: {verdict.held} setpoints to judge, ok again: {self.way_out}")
        # at rest without a fault
        if not self.faults and self.situation == Situation.REST.name.lower():
            fit = verdict.bound_um / verdict.error_95_um
            if not FITS[0] <= fit <= FITS[1]:
                problems.append(f"the bound is {fit:.2f} times the 95 % error, allowed {FITS[0]:g} to {FITS[1]:g}")
        return problems + verdict.problems

    def as_data(self) -> dict[str, Any]:
        """For a file: one level, rounded, null for what is not known."""
        data = asdict(self)
        data |= data.pop("verdict")
        data["problems"] = self.problems
        return {key: _plain(value) for key, value in data.items()}


def try_cell(cell: Cell) -> CellResult:
    """Let it happen to a machine that is at rest and ok."""
    with VirtualMachine(expands=cell.expands) as machine:
        settle(machine)
        seen, broken = _during(machine, cell)
        if any(case.lost for case in cell.cases) and not machine.ends():
            broken.append("the daemon goes on without one of its processes")
        machine.repair()
        way_out = _leave(machine, seen, broken)
        broken += machine.world.died
        verdict = judge(machine, seen)
    return CellResult(
        cell.name,
        [case.id for case in cell.cases],
        cell.situation.name.lower(),
        cell.unseen,
        verdict,
        way_out,
        broken,
    )


def _during(machine: VirtualMachine, cell: Cell) -> tuple[list[Seen], list[str]]:
    """While the faults last: the setpoints, and the rules that were broken."""
    if not cell.cases and cell.situation is Situation.REST:
        return list(_rests(machine, cell.watched_s / len(PLACES_MM))), []
    restarts = cell.situation is Situation.RESTART
    # one that drives itself needs the machine at rest
    situation = Situation.REST if cell.drives_itself else cell.situation
    with situation.lasting(machine):
        if restarts:  # the fault comes while the daemon is away
            machine.end_daemon()
            _begin(machine, cell)
            machine.start_daemon()
        with machine.watched() as watcher:
            start = 0
            if not restarts:
                machine.until_ok(watcher, BACK_WITHIN_S)
                start = len(watcher.seen)
                _begin(machine, cell)
            machine.rest_for(cell.watched_s)
            return watcher.seen[start:], list(watcher.broken)


def _begin(machine: VirtualMachine, cell: Cell) -> None:
    for case in cell.cases:
        case.begin(machine)


def _rests(machine: VirtualMachine, each_s: float) -> Iterator[Seen]:
    """Without a fault at rest: at several places, since what no gauge measures differs from one to the next."""
    for place_mm in PLACES_MM:
        machine.drive(place_mm)
        with machine.watched() as watcher:
            machine.rest_for(each_s)
        yield from watcher.seen


def _leave(machine: VirtualMachine, seen: list[Seen], broken: list[str]) -> str:
    """The faults have gone: by itself, by a person, or not at all."""
    with machine.watched() as watcher:
        way_out = "restarted"
        if not watcher.ended:
            machine.rest_for(SETTLED_S)  # a fault's end is a jump, too, and shows at the next poll
        if _ok_by_itself(machine, watcher):
            way_out = "itself"
        else:
            machine.accept()
            if machine.until_ok(watcher, AFTER_ACCEPTANCE_S):
                way_out = "accepted"
        seen += watcher.seen
        broken += watcher.broken
    if way_out == "restarted":
        machine.restart(forget=True)
    return way_out


def _ok_by_itself(machine: VirtualMachine, watcher: Watched) -> bool:
    """Of a state that a person has to end there is nothing to wait for."""
    if machine.until_ok(watcher, FAULT_SHOWS_S):
        return True
    return watcher.seen[-1]["state"] != State.FAULT and machine.until_ok(watcher, BY_ITSELF_S)


def _plain(value: Any) -> Any:
    if not isinstance(value, float):
        return value
    return None if math.isnan(value) else round(value, 4)
