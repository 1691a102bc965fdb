"""What counts as found: a failure at the end of a plan that the same end does not show without the defect."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from tests.worlds.defects.find import AFTER_S, BEFORE_S, Fails, Played, ending, shows
from tests.worlds.defects.play import STEP_S, Mark
from tests.worlds.plan import Event, Plan

STEPS = 10
# A world's process that answers as `play` does: what does not hold, by the step in which it is seen.
_WORLD = f"""
import json, sys
marks = json.loads(sys.argv[1])
for step in range({STEPS}):
    now = {STEP_S} * step
    seen = [mark for mark in marks if now - {STEP_S} < mark[2] <= now]
    print(json.dumps({{"time_s": now, "marks": seen}}), flush=True)
    if not sys.stdin.readline():
        break
"""


def world(*marks: Mark) -> Played:
    command = [sys.executable, "-c", _WORLD, json.dumps(marks)]
    pipe = subprocess.PIPE
    return Played(subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True))


def beyond(time_s: float, what: str = "within_bound") -> Mark:
    return Mark(what, "gauges.jump", time_s, "")


def jumps(*times_s: float) -> Plan:
    events = tuple(Event(time_s, "gauges", "jump", "scale_1.position", {}) for time_s in times_s)
    return Plan("tripod-cmm.yaml", 0, 100.0, 250.0, events)


def fails_with(events: int, what: str = "within_bound") -> Fails:
    """Something fails in a plan with at least so many events."""
    return lambda plan, asked: 1.0 if asked == what and len(plan.events) >= events else None


def test_a_world_tells_its_marks_as_they_come_until_its_end() -> None:
    with world(beyond(7.0), beyond(33.0)) as played:
        marks = played.marks()
        assert next(marks) == beyond(7.0)
        assert played.time_s == 2 * STEP_S
        assert list(marks) == [beyond(33.0)]
        assert played.time_s == STEP_S * (STEPS - 1)


def test_the_end_of_a_plan_has_its_events_from_its_own_beginning() -> None:
    part = ending(jumps(10.0, 50.0, 54.0, 56.0), 55.0, 20.0)
    assert [event.time_s for event in part.events] == [15.0, 19.0]
    assert part.duration_s == 20.0
    assert ending(jumps(1.0), 2.0, 20.0).duration_s == 2.0


@pytest.mark.parametrize(
    ("defective", "whole", "events"),
    [
        (fails_with(1), fails_with(9), 2),
        (fails_with(1), fails_with(2), None),
        (fails_with(3), fails_with(9), 3),
        (fails_with(9), fails_with(9), None),
        (fails_with(1, "valid_again"), fails_with(9), None),
    ],
    ids=["at once", "without the defect as well", "with what came before", "by chance", "another failure"],
)
def test_a_failure_counts_that_comes_again_with_the_defect_alone(
    defective: Fails, whole: Fails, events: int | None
) -> None:
    late_s = BEFORE_S[0] + 30.0
    plan = jumps(late_s - BEFORE_S[0] - 5.0, late_s - AFTER_S, late_s)
    part = shows(plan, beyond(late_s), defective, whole)
    assert (None if part is None else len(part.events)) == events
