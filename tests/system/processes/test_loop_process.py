"""The loop: its priority, and a model that is adopted."""

from __future__ import annotations

import itertools
import os
import re
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.support.daemon_process import Daemon
from tests.support.live_models import file_with
from tests.support.process_checks import PAUSE_S, PAUSES, allowance, correction_mm, is_ok
from tests.support.processes import Machine
from tests.support.watching import Seen

# Of a loop at 1 kHz.
WATCHED_HZ = 200.0


def may_use_fifo() -> bool:
    """Whether this process, and so a daemon that it starts, may use SCHED_FIFO."""
    granted: list[bool] = []

    def ask() -> None:  # on a thread, which alone gets the policy
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
            granted.append(True)
        except OSError:
            granted.append(False)

    thread = threading.Thread(target=ask)
    thread.start()
    thread.join()
    return granted[0]


def test_the_loop_is_one_thread_with_priority_in_locked_memory(apart: Daemon) -> None:
    status, pid = apart.status(), apart.pids()["loop"]
    assert len(list(Path(f"/proc/{pid}/task").iterdir())) == 1
    links = [path.readlink() for path in Path(f"/proc/{pid}/fd").iterdir()]
    assert not [link for link in links if str(link).startswith("socket:")]
    realtime = status["realtime"]
    assert realtime["sched_fifo"]["granted"] == may_use_fifo()
    assert os.sched_getscheduler(pid) == (os.SCHED_FIFO if realtime["sched_fifo"]["granted"] else os.SCHED_OTHER)
    locked_kb = int(re.search(r"VmLck:\s+(\d+) kB", Path(f"/proc/{pid}/status").read_text())[1])
    assert (locked_kb > 0) == realtime["locked_memory"]["granted"]


def largest_gap(seen: list[Seen]) -> int:
    """Cycles between two consecutive setpoints of which a client saw nothing."""
    return max(int(b["seq"] - a["seq"] - 1) for a, b in itertools.pairwise(seen))


@pytest.mark.long
def test_adopting_a_model_and_a_shadow_costs_no_cycle(machine: Machine, tmp_path: Path) -> None:
    rate_hz = 1000.0
    shift_um = [60.0, -45.0, 30.0]
    adopted = file_with(tmp_path / "adopted.yaml", "link_zero", link_zero=shift_um)
    shadow = file_with(tmp_path / "shadow.yaml", "link_zero", "tool_offset", link_zero=shift_um, tool_offset=[3, -2, 5])
    fast = machine.daemon(machine.configuration("fast", rate_hz=rate_hz))

    def missed(watch: Callable[[], list[Seen]]) -> tuple[int, int, float]:
        """Missed cycles and the largest gap while `watch` runs, and how long that took."""
        before, start_s = fast.status()["loop"], time.monotonic()
        seen = watch()
        duration_s = time.monotonic() - start_s
        return fast.status()["loop"]["missed_cycles"] - before["missed_cycles"], largest_gap(seen), duration_s

    with fast.watched(WATCHED_HZ) as watcher, fast.connected() as operator:

        def adopt() -> list[Seen]:
            since = watcher.now
            model = operator.model(str(adopted))["applied"]["model"]
            first = watcher.until("adopted", lambda seen: seen.setpoint.get("model") == model, since)
            ok = watcher.until("ok, having slewed", is_ok, watcher.seen.index(first))
            moved_um = (correction_mm(ok) - correction_mm(watcher.seen[since])) * 1e3
            assert np.abs(np.abs(moved_um) - np.abs(shift_um)).max() < 5, "as far as the model says"
            operator.model(str(shadow), shadow=True)
            watcher.until("a shadow", lambda seen: "shadow" in seen.setpoint, since)
            watcher.for_s(0.5)
            return watcher.seen[since:]

        with_adoption, gap, duration_s = missed(adopt)
        # after it, so that the cycles cost the same
        usual, usual_gap, _ = missed(lambda: watcher.for_s(duration_s))
    print(f"in {duration_s:.1f} s {with_adoption} cycles missed, gap {gap}; as long after {usual}, {usual_gap}")
    assert gap <= usual_gap + (PAUSE_S + 1.2 * PAUSES.lost_s) * rate_hz
    assert with_adoption <= usual + allowance(duration_s * rate_hz, rate_hz)
