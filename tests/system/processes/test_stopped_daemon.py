"""A daemon that is stopped as a whole, or looked at by a debugger."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import threading
import time
from pathlib import Path

import pytest

from compd.clock import MonotonicClock
from tests.support.daemon_process import Daemon
from tests.support.patience import PATIENCE_S
from tests.support.process_checks import is_ok
from tests.support.sampled import sampled
from tests.support.watching import until


def pause(duration_s: float) -> None:
    """Let the daemon be stopped for so long: how long it takes is what the test is about."""
    MonotonicClock().wait(threading.Event(), duration_s)


def is_stopped(pid: int) -> bool:
    """Whether every thread is in state T: stopped by a signal, or by a debugger."""
    states = [(task / "stat").read_text().rpartition(")")[2].split()[0] for task in Path(f"/proc/{pid}/task").iterdir()]
    return set(states) <= {"T", "t"}


@pytest.mark.parametrize("duration_s", sampled([1.0, 0.2, 3.0], 3))
def test_the_daemon_goes_on_after_sigstop_and_sigcont(apart: Daemon, duration_s: float) -> None:
    pids = apart.pids()
    with apart.watched() as watcher:
        watcher.for_s(0.2)
        os.killpg(apart.process.pid, signal.SIGSTOP)
        try:
            until("all processes are stopped", lambda: all(map(is_stopped, pids.values())))
            since = watcher.now
            pause(duration_s)
        finally:
            os.killpg(apart.process.pid, signal.SIGCONT)
        continued_s = time.monotonic()
        again = watcher.until("ok", lambda seen: is_ok(seen) and seen["time_s"] > continued_s, since)
        print(f"ok {(again['time_s'] - continued_s) * 1e3:.0f} ms after SIGCONT")
        watcher.for_s(1.0)  # whoever took the pause for a fault of another process has acted by now
        watcher.until("ok", is_ok, watcher.now)
    now = apart.pids()
    assert now["supervisor"] == pids["supervisor"]
    assert now["service"] == pids["service"]


def test_the_daemon_goes_on_after_ctrl_z(apart: Daemon) -> None:
    pids = apart.pids()
    with apart.watched() as watcher:
        os.killpg(apart.process.pid, signal.SIGTSTP)
        try:
            pause(0.5)
        finally:
            os.killpg(apart.process.pid, signal.SIGCONT)
        continued_s = time.monotonic()
        watcher.until("ok", lambda seen: is_ok(seen) and seen["time_s"] > continued_s + 1.0)
    now = apart.pids()
    assert now["supervisor"] == pids["supervisor"]
    assert now["service"] == pids["service"]


@pytest.mark.long
@pytest.mark.sample
@pytest.mark.skipif(shutil.which("gdb") is None, reason="gdb is not installed")
@pytest.mark.parametrize("process", ["supervisor", "service"])
def test_a_debugger_may_look(apart: Daemon, process: str) -> None:
    pids = apart.pids()
    with apart.watched() as watcher:
        start_s = time.monotonic()
        gdb = subprocess.run(
            ["gdb", "-nx", "-p", str(pids[process]), "-batch"],
            capture_output=True,
            text=True,
            env={**os.environ, "DEBUGINFOD_URLS": ""},
            timeout=PATIENCE_S,
            check=False,
        )
        if "not permitted" in gdb.stderr:
            pytest.skip("gdb may not attach here")
        assert "detached" in gdb.stdout, gdb.stdout + gdb.stderr
        end_s = time.monotonic()
        print(f"attached for less than {end_s - start_s:.1f} s")
        watcher.until("ok", lambda seen: is_ok(seen) and seen["time_s"] > end_s + 1.0)
    now = apart.pids()
    assert now["supervisor"] == pids["supervisor"]
    assert now["service"] == pids["service"]
