"""One case of the matrix on a running machine: what it did to the setpoints, and whether that is what must happen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from compd.errors import DaemonError
from compd.setpoint_states import State
from tests.injection.beginnings import REST_MM
from tests.injection.case import Case, Way
from tests.injection.cases_of_processes import CLIENTS
from tests.injection.machine import Machine, Watched
from tests.injection.verdict import Verdict, judge
from tests.support.watching import Seen

# Until a fault shows, and until the state is ok after its end.
SHOWS_WITHIN_S = 6.0
BACK_WITHIN_S = 12.0
# Before something else is tried.
SETTLED_WITHIN_S = 8.0
# Readings are kept once a second: of a scale that has moved since, a person is asked at the next start.
KNOWN_WITHIN_S = 1.2
# For so long a gauge that must be accepted is watched after its cause has gone.
WATCHED_AFTER_S = 1.5
# A reason is for people, and goes out with every setpoint.
MAX_REASON = 1100  # bytes
# Cases in which targets are sent.
CONTROLLERS = ("client-targets", "client-target_bursts")
# A busy computer makes polls late: so many setpoints may be disturbed where nothing must be.
DISTURBED_SHARE = 0.2


@dataclass
class Outcome:
    """What was seen of one case.

    worst_um : largest error of a valid setpoint at rest, um. valid_share : of all setpoints while the fault lasted.
    shown_s : from the beginning to the first of the expected states. back_s : from the end of the cause, or from the
    acceptance, to ok. problems : what is not as the case demands.
    """

    case: str
    worst_um: float = math.nan
    valid_share: float = math.nan
    states: dict[str, int] = field(default_factory=dict)
    reasons: list[str] = field(default_factory=list)
    shown_s: float = math.nan
    back_s: float = math.nan
    setpoints: int = 0
    expired: int = 0
    problems: list[str] = field(default_factory=list)

    def as_data(self) -> dict[str, Any]:
        """For a file: rounded, and null for what is not known."""
        return {key: _plain(value) for key, value in asdict(self).items()}


def settle(machine: Machine) -> None:
    """Repair all, drive to the place of rest, accept every gauge, and wait for ok; where nothing helps, start anew."""
    machine.repair()
    machine.drive(REST_MM)
    machine.rest_for(KNOWN_WITHIN_S)
    for attempt in range(3):
        if attempt == 1:
            machine.accept()
        elif attempt == 2:
            machine.restart(forget=True)
        with machine.watched() as watcher:
            if machine.until_ok(watcher, SETTLED_WITHIN_S):
                return
    raise AssertionError(f"not ok after a restart: {watcher.seen[-1].setpoint}")


def try_case(machine: Machine, case: Case) -> Outcome:
    """Let it happen to a machine that is at rest and ok."""
    outcome = Outcome(case.id)
    with machine.watched() as watcher:
        machine.until_ok(watcher, BACK_WITHIN_S)
        start, start_s = len(watcher.seen), machine.now_s
        case.begin(machine)
        _watch_fault(machine, case, outcome, watcher, start, start_s)
        during = watcher.seen[start:]
        end_s = machine.now_s
        if case.lost and not machine.ends():
            outcome.problems.append("the daemon goes on without one of its processes")
        machine.repair()
        if not case.lost:
            _leave(machine, case, outcome, watcher, end_s)
        seen = watcher.seen[start:]
        outcome.problems += [f"a broken rule: {broken}" for broken in watcher.broken[:2]]
        ended = watcher.ended
    if case.lost:
        if not ended:
            outcome.problems.append("connections stay open after the daemon's end")
        with machine.watched() as again:
            if not machine.until_ok(again, BACK_WITHIN_S):
                outcome.problems.append("not ok after the service manager's restart")
            seen = seen + again.seen
    elif ended:
        outcome.problems.append(f"the connection ended: {ended}")
    _judge(machine, case, outcome, seen, during)
    return outcome


def _watch_fault(machine: Machine, case: Case, outcome: Outcome, watcher: Watched, start: int, start_s: float) -> None:
    """Until the fault shows and its time is over."""
    begun_s = machine.now_s
    while not watcher.ended:
        shown = [seen for seen in watcher.seen[start:] if seen["state"] in case.states and _named(case, seen)]
        if shown and math.isnan(outcome.shown_s):
            outcome.shown_s = shown[0].arrived_s - start_s
        now_s = machine.now_s
        enough = case.watched_s if shown or not case.states else max(SHOWS_WITHIN_S, case.watched_s)
        if now_s >= begun_s + enough:
            break
        machine.rest_for(0.1)
        if case.group == CLIENTS and (refusal := _asked_in_vain(machine)):
            outcome.problems.append(f"nobody is served over the Unix socket: {refusal}")
            break
    if case.states and math.isnan(outcome.shown_s):
        outcome.problems.append(f"never {' or '.join(sorted(case.states))} with a reason that names {case.names!r}")


def _asked_in_vain(machine: Machine) -> str:
    """Why STATUS and MODEL cannot be asked over the Unix socket; "" where they can."""
    try:
        machine.ask_all()
    except DaemonError as error:
        return str(error)
    return ""


def _leave(machine: Machine, case: Case, outcome: Outcome, watcher: Watched, end_s: float) -> None:
    """The cause has gone: out of it by itself, or by a person alone."""
    if case.way is Way.ACCEPTED:
        since = len(watcher.seen)
        machine.rest_for(WATCHED_AFTER_S)
        if believed := [seen for seen in watcher.seen[since:] if seen["state"] in (State.OK, State.SLEWING)]:
            outcome.problems.append(f"believed again before `compd accept`: {believed[0]['state']}")
        elif not any("compd accept" in seen["reason"] for seen in watcher.seen[since:]):
            outcome.problems.append("no reason says `compd accept`")
        try:
            machine.accept()
        except DaemonError as error:
            outcome.problems.append(f"`compd accept` is refused: {error}")
        end_s = machine.now_s
    if case.way is Way.UNSEEN:
        machine.rest_for(WATCHED_AFTER_S)  # what nothing has shown may show when it ends
    if case.way in (Way.EITHER, Way.UNSEEN) and not machine.until_ok(watcher, SETTLED_WITHIN_S):
        machine.accept()
        end_s = machine.now_s
    if machine.until_ok(watcher, BACK_WITHIN_S):
        outcome.back_s = machine.now_s - end_s
    else:
        outcome.problems.append(f"not ok within {BACK_WITHIN_S:g} s: {watcher.seen[-1].setpoint.get('reason')}")


def _judge(machine: Machine, case: Case, outcome: Outcome, seen: Sequence[Seen], during: Sequence[Seen]) -> None:
    verdict: Verdict = judge(machine, seen)
    outcome.worst_um, outcome.states, outcome.reasons = verdict.worst_at_rest_um, verdict.states, verdict.reasons
    outcome.setpoints = len(seen)
    outcome.valid_share = sum(bool(s["valid"]) for s in during) / len(during) if during else math.nan
    outcome.expired = sum(s["valid"] and s.arrived_s > s["valid_until"] for s in seen)
    problems = outcome.problems
    problems += verdict.old_targets
    if case.id in CONTROLLERS and math.isnan(verdict.target_late_s):
        problems.append("no setpoint answers a target: the controller has done nothing")
    if verdict.worst_at_rest_um > case.bound_um:
        problems.append(
            f"a valid setpoint is wrong by {verdict.worst_at_rest_um:.1f} um, allowed {case.bound_um:g}: "
            f"{verdict.worst}"
        )
    if verdict.longest_reason > MAX_REASON:
        problems.append(f"a reason of {verdict.longest_reason} bytes, allowed {MAX_REASON}")
    disturbed = [s for s in during if s["state"] != State.OK]
    if case.way in (Way.UNDISTURBED, Way.UNSEEN):
        if len(disturbed) > DISTURBED_SHARE * len(during):
            problems.append(
                f"{len(disturbed)} of {len(during)} setpoints are disturbed: {disturbed[0]['state']}, "
                f"{disturbed[0]['reason'][:200]}"
            )
        if outcome.expired > DISTURBED_SHARE * len(during):
            problems.append(f"{outcome.expired} setpoints had expired when they arrived")
    if case.way is Way.UNSEEN and not verdict.worst_at_rest_um >= case.at_least_um:
        problems.append(f"wrong by {verdict.worst_at_rest_um:.1f} um only: is it seen now? Then this row has to say so")


def _named(case: Case, seen: Seen) -> bool:
    """A gauge may be called by its name in the configuration, or in words: scale_1, scale 1."""
    return case.names.replace("_", " ") in (seen.setpoint.get("reason") or "").replace("_", " ")


def _plain(value: Any) -> Any:
    if not isinstance(value, float):
        return value
    return None if math.isnan(value) else round(value, 3)
