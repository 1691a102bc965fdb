"""What counts as found: a failure that the same world without the patch does not show near the same time."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import partial

import pytest

from tests.worlds.defects.find import NEAR_S, Played, _also, _first
from tests.worlds.defects.play import STEP_S, Mark

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
    return Played(partial(subprocess.Popen, command, stdin=pipe, stdout=pipe, text=True))


def beyond(time_s: float, what: str = "within_bound") -> Mark:
    return Mark(what, "gauges.jump", time_s, "")


@pytest.mark.parametrize(
    ("without", "found"),
    [
        ([], True),
        ([beyond(12.0)], False),
        ([beyond(12.0, "valid_again")], True),
        ([beyond(12.0 + NEAR_S - 1.0)], False),
        ([beyond(12.0 + NEAR_S + STEP_S)], True),
    ],
)
def test_a_failure_counts_that_is_not_there_without_the_patch(without: list[Mark], found: bool) -> None:
    with world(beyond(12.0)) as defective, world(*without) as whole:
        mark = _first(defective, lambda mark: not _also(whole, mark))
    assert mark == (beyond(12.0) if found else None)


def test_a_later_failure_counts_where_the_first_does_not() -> None:
    with world(beyond(7.0), beyond(33.0)) as defective, world(beyond(7.0)) as whole:
        assert _first(defective, lambda mark: not _also(whole, mark)) == beyond(33.0)


def test_a_world_ends_and_is_asked_no_further() -> None:
    with world() as whole:
        whole.until(1e6)
        assert whole.over
        assert whole.time_s == STEP_S * (STEPS - 1)
