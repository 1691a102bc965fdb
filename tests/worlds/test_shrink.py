"""Shrinking: to the failure, to the fewest events, to the shortest time."""

from __future__ import annotations

import pytest

from tests.worlds.plan import Event, Plan
from tests.worlds.shrink import Fails, shrink


def plan(*kinds: str) -> Plan:
    events = [Event(10.0 * k, "lines", kind, "", {}) for k, kind in enumerate(kinds, start=1)]
    return Plan("tripod-cmm.yaml", 1, 1000.0, 250.0, tuple(events))


def fails_with(*needed: str) -> Fails:
    """Fails half a second after the last of the needed events, which have to come in this order."""

    def fails(tried: Plan) -> float | None:
        left = list(needed)
        for event in tried.events:
            if left and event.kind == left[0]:
                left.pop(0)
                if not left:
                    return event.time_s + 0.5 if event.time_s + 0.5 <= tried.duration_s else None
        return None

    return fails


@pytest.mark.parametrize("needed", [("c",), ("a", "h"), ("b", "d", "g")])
def test_only_what_is_needed_is_left(needed: tuple[str, ...]) -> None:
    small = shrink(plan(*"abcdefgh"), "within_bound", 60.0, fails_with(*needed))
    assert tuple(event.kind for event in small.events) == needed
    assert small.duration_s < 2.0


def test_a_plan_that_does_not_fail_again_stays_as_it_is() -> None:
    whole = plan(*"abc")
    assert shrink(whole, "within_bound", 60.0, lambda tried: None) == whole


def test_without_time_left_a_plan_stays_as_it_is() -> None:
    whole = plan(*"abc")
    assert shrink(whole, "within_bound", 0.0, fails_with("a")) == whole
