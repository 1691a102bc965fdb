"""Shrinks a failing plan: to its failure, then to the fewest events (ddmin), then to the shortest time."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from itertools import pairwise

from tests.worlds.plan import Event, Plan
from tests.worlds.run import play
from tests.worlds.watch import Watch

# A plan ends this long after its failure, s.
_AFTER_S = 0.1
# Gaps between events are shortened to as little as this, s.
_GAPS_S = (0.0, 0.25, 1.0, 3.0)

# How long a plan takes to its failure, s; None where it does not fail.
Fails = Callable[[Plan], float | None]


def failure_s(plan: Plan, what: str) -> float | None:
    """When the invariant `what` fails first in a plan, s; None where it holds."""

    def failed(watch: Watch) -> bool:
        return any(finding.what == what for finding in watch.found.values())

    found = [finding.time_s for finding in play(plan, until=failed).findings if finding.what == what]
    return min(found, default=None)


def shrink(plan: Plan, what: str, real_s: float, fails: Fails | None = None) -> Plan:
    """Shrink a plan in which the invariant `what` fails, as far as `real_s` (s) of this computer's time allow."""
    until_s = time.monotonic() + real_s
    test: Fails = fails or (lambda tried: failure_s(tried, what))

    def tried(candidate: Plan) -> Plan | None:
        """The candidate up to its failure; None where it does not fail, or the time is over."""
        if time.monotonic() > until_s:
            return None
        at_s = test(candidate)
        return None if at_s is None else _until(candidate, at_s + _AFTER_S)

    smallest = tried(plan)
    if smallest is None:
        return plan
    smallest = _fewest(smallest, tried)
    return _shortest(smallest, tried)


def _until(plan: Plan, time_s: float) -> Plan:
    """A plan that ends at `time_s`, without what comes later."""
    duration_s = min(plan.duration_s, time_s)
    return plan._replace(duration_s=duration_s, events=tuple(e for e in plan.events if e.time_s < duration_s))


def _fewest(plan: Plan, tried: Callable[[Plan], Plan | None]) -> Plan:
    """Delta debugging (ddmin) by complements: leave ever smaller parts out while the plan still fails."""
    parts = 2
    while len(plan.events) >= 1:
        for rest in _complements(plan.events, parts):
            smaller = tried(plan.with_events(rest))
            if smaller is not None:
                plan, parts = smaller, max(parts - 1, 2)
                break
        else:
            if parts >= len(plan.events):
                return plan
            parts = min(2 * parts, len(plan.events))
    return plan


def _complements(events: Sequence[Event], parts: int) -> list[Sequence[Event]]:
    """The events without each of `parts` parts."""
    parts = min(parts, len(events))
    edges = [round(k * len(events) / parts) for k in range(parts + 1)]
    return [[*events[:a], *events[b:]] for a, b in pairwise(edges)]


def _shortest(plan: Plan, tried: Callable[[Plan], Plan | None]) -> Plan:
    """Bring every event as close to the one before it as the failure allows."""
    for k in range(len(plan.events)):
        for gap_s in _GAPS_S:
            if k >= len(plan.events):
                break
            before_s = plan.events[k - 1].time_s if k else 0.0
            by_s = plan.events[k].time_s - before_s - gap_s
            if by_s <= 0:
                break
            later = [e._replace(time_s=round(e.time_s - by_s, 6)) for e in plan.events[k:]]
            moved = plan.with_events([*plan.events[:k], *later])._replace(duration_s=plan.duration_s - by_s + 1.0)
            if (shorter := tried(moved)) is not None:
                plan = shorter
                break
    return plan
