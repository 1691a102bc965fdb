"""A process that dies or stops."""

from __future__ import annotations

import itertools
import os
import signal
import time

import pytest

from compd.setpoint_states import State
from tests.support.daemon_process import Daemon, Pidfds
from tests.support.patience import PATIENCE_S
from tests.support.process_checks import is_ok, is_valid, started_again, starts
from tests.support.sampled import sampled
from tests.support.watching import Seen, until


def largest_silence_s(seen: list[Seen]) -> float:
    """The longest that a client had a valid setpoint and heard nothing newer, s."""
    return max(b.arrived_s - a.arrived_s for a, b in itertools.pairwise(seen) if is_valid(a))


@pytest.mark.parametrize("sent", sampled([signal.SIGKILL, signal.SIGSTOP], 2), ids=lambda sent: sent.name)
def test_without_its_loop_the_daemon_says_stop_and_goes_on_from_the_last_correction(
    apart: Daemon, sent: signal.Signals
) -> None:
    """That the correction slews from the last valid one is among the rules for every setpoint."""
    before, pids = starts(apart, "loop"), apart.pids()
    with apart.watched() as watcher, Pidfds([pids["loop"]]) as old:
        usual_s = largest_silence_s(watcher.for_s(1.0))
        since = watcher.now
        os.kill(pids["loop"], sent)
        old.wait_for_ends()
        entry = until("a new loop", lambda: started_again(apart, "loop", before))
        watcher.until("ok", is_ok, watcher.now)
        seen = watcher.seen[since - 1 :]
    silence_s = largest_silence_s(seen)
    print(
        f"{sent.name}: {silence_s * 1e3:.1f} ms from a valid setpoint to the next or a stop; usual {usual_s * 1e3:.1f}"
    )
    stops = [s for s in seen if not is_valid(s)]
    # a loop that dies may be replaced before anybody misses it, one that hangs is missed first
    if stops or sent is signal.SIGSTOP:
        assert {s["state"] for s in stops} == {State.STOP}
        assert any("loop" in s["reason"] for s in stops)
        last = max(s["time_s"] for s in stops)
        print(f"{sent.name}: the last stop {(last - stops[0]['time_s']) * 1e3:.0f} ms after the first")
    assert entry["starts"] == before + 1
    assert "SIGKILL" in entry["last_end"] or sent is not signal.SIGKILL, entry
    assert entry["last_end"]
    assert {**apart.pids(), "loop": 0} == {**pids, "loop": 0}, "the others are the same"


@pytest.mark.parametrize("sent", sampled([signal.SIGKILL, signal.SIGSTOP], 2), ids=lambda sent: sent.name)
def test_a_lost_acquisition_is_a_lost_scale_and_comes_back(apart: Daemon, sent: signal.Signals) -> None:
    before, pids = starts(apart, "acquisition"), apart.pids()
    with apart.watched() as watcher, Pidfds([pids["acquisition"]]) as old:
        since = watcher.now
        os.kill(pids["acquisition"], sent)
        sent_s = time.monotonic()
        old.wait_for_ends()
        again = watcher.until(
            "ok from new readings", lambda seen: is_ok(seen) and seen["time_s"] - seen["age_s"] > sent_s, since
        )
        print(f"{sent.name}: ok from new readings after {again['time_s'] - sent_s:.2f} s")
        # how old a reading may be is among the rules for every setpoint
        between = watcher.seen[since : watcher.seen.index(again)]
        assert {seen["state"] for seen in between} <= {State.OK, State.SLEWING, State.HOLD, State.STOP, State.REFUSED}
    assert until("a new process", lambda: started_again(apart, "acquisition", before))["starts"] == before + 1
    assert {**apart.pids(), "acquisition": 0} == {**pids, "acquisition": 0}, "the others are the same"


@pytest.mark.parametrize("victim", sampled(["service", "supervisor"], 2))
def test_without_service_or_supervisor_nothing_is_left(fresh: Daemon, victim: str) -> None:
    """A restart is the service manager's: there must be nobody in its way."""
    pids = fresh.pids()
    with fresh.watched() as watcher, Pidfds(pids.values()) as processes:
        os.kill(pids[victim], signal.SIGKILL)
        processes.wait_for_ends()
        watcher.until_end()
    assert fresh.process.wait(PATIENCE_S) != 0
    until("no process is left", lambda: not fresh.left())
