"""A driver that misbehaves harms its own gauge alone."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from compd.setpoint_states import State
from tests.support.daemon_process import Daemon, Pidfds
from tests.support.misbehaving import DIAL_PROCESS
from tests.support.process_checks import check_undisturbed, cycles_kept, is_ok, is_valid, started_again, starts
from tests.support.processes import Machine
from tests.support.watching import until

# Two minutes in all.
pytestmark = pytest.mark.long

# How long a misdeed is watched after its first effect.
WATCHED_S = 2.0
AT_ZERO_B0_MM = [0.0, 0.0, -510.0]
PROCESSES = {"supervisor", "loop", "acquisition", "service"}


def test_status_tells_every_process(apart: Daemon) -> None:
    processes = apart.processes()
    assert set(processes) == PROCESSES | {DIAL_PROCESS}
    assert processes["supervisor"]["pid"] == apart.process.pid
    pids = apart.pids()
    assert len(set(pids.values())) == len(pids)
    assert set(pids.values()) <= set(apart.left()), "they are there, and of this configuration"
    assert all(process["starts"] >= 1 for process in processes.values())


def is_lost(daemon: Daemon, _: int) -> bool:
    return daemon.quality() != "ok"


def is_faulty(daemon: Daemon, _: int) -> bool:
    return daemon.quality() == "driver_error"


def is_cut_short(daemon: Daemon, _: int) -> bool:
    return "log lines dropped" in daemon.log.read_text(errors="replace")


def has_died(daemon: Daemon, starts_before: int) -> bool:
    return started_again(daemon, DIAL_PROCESS, starts_before) is not None


# How each misdeed shows.
MISDEEDS: dict[str, Callable[[Daemon, int], bool]] = {
    "keep_interpreter": is_lost,
    "spin": is_lost,
    "raise_error": is_faulty,
    "flood_log": is_cut_short,
    "eat_memory": has_died,
    "crash": has_died,
    "exit": has_died,
}


@pytest.mark.parametrize("misdeed", MISDEEDS)
def test_a_driver_in_a_process_of_its_own_harms_its_gauge_alone(machine: Machine, apart: Daemon, misdeed: str) -> None:
    before, others = starts(apart, DIAL_PROCESS), {**apart.pids(), DIAL_PROCESS: 0}
    with apart.watched() as watcher, cycles_kept(apart):
        machine.misdeeds.begin(misdeed)
        until(f"{misdeed} shows", lambda: MISDEEDS[misdeed](apart, before))
        watcher.for_s(WATCHED_S)
        machine.misdeeds.end()
        until("the dial is good again", lambda: apart.quality() == "ok")
        check_undisturbed(apart, watcher.seen)  # the dial is no comparator
    assert {**apart.pids(), DIAL_PROCESS: 0} == others, "no other process was started anew"


@pytest.mark.parametrize(("misdeed", "end"), [("crash", "SIGSEGV"), ("exit", "3")])
def test_a_dead_process_is_started_anew_and_status_says_how_it_ended(
    machine: Machine, apart: Daemon, misdeed: str, end: str
) -> None:
    before, pid = starts(apart, DIAL_PROCESS), apart.pids()[DIAL_PROCESS]
    with Pidfds([pid]) as old:
        machine.misdeeds.begin(misdeed, once=True)
        old.wait_for_ends()
    entry = until("a new process", lambda: started_again(apart, DIAL_PROCESS, before))
    assert entry["starts"] == before + 1
    assert end in entry["last_end"]
    assert entry["pid"] != pid
    until("the dial is good again", lambda: apart.quality() == "ok")


def test_memory_is_given_back_when_a_process_has_grown_too_far(machine: Machine, apart: Daemon) -> None:
    before, pid = starts(apart, DIAL_PROCESS), apart.pids()[DIAL_PROCESS]
    with Pidfds([pid]) as old:
        machine.misdeeds.begin("eat_memory")
        old.wait_for_ends()
        machine.misdeeds.end()
    entry = until("a new process", lambda: started_again(apart, DIAL_PROCESS, before))
    assert entry["last_end"]
    until("the dial is good again", lambda: apart.quality() == "ok")
    assert resident_mb(apart.pids()[DIAL_PROCESS]) < 400


def resident_mb(pid: int) -> float:
    text = Path(f"/proc/{pid}/status").read_text()
    return int(re.search(r"VmRSS:\s+(\d+) kB", text)[1]) / 1e3


def test_a_flood_of_the_log_stays_small(machine: Machine, apart: Daemon) -> None:
    before = apart.log.stat().st_size
    with apart.watched() as watcher:
        machine.misdeeds.begin("flood_log")
        watcher.for_s(WATCHED_S)
        machine.misdeeds.end()
    text = apart.log.read_bytes()[before:].decode(errors="replace")
    lines = text.splitlines()
    print(f"{len(lines)} lines of about {WATCHED_S / 0.1 * 1000:.0f}")
    assert any(line.startswith("dial: ") for line in lines), "some pass"
    assert len(lines) < 1000
    assert not [line for line in lines if line.startswith("dial: ") and not re.fullmatch(r"dial: \S+ degC, \d+", line)]


def test_a_crash_in_the_shared_process_is_held_and_comes_back(machine: Machine, together: Daemon) -> None:
    """All gauges are lost with it. In machine-tool mode, which needs no scales, the last good set is held."""
    before = starts(together, "acquisition")
    with together.connected() as controller, together.watched() as watcher:
        controller.target(tip_B0_mm=AT_ZERO_B0_MM)
        watcher.until("machine-tool mode", lambda seen: seen["mode"] == "machine_tool" and is_ok(seen))
        since = watcher.now
        machine.misdeeds.begin("crash")
        held = watcher.until("held", lambda seen: seen["state"] == State.HOLD, since)
        assert is_valid(held)
        assert held["reason"]
        machine.misdeeds.end()
        controller.target(tip_B0_mm=AT_ZERO_B0_MM)  # again: it grows old
        after = watcher.now
        watcher.until("ok by itself", is_ok, after)
    entry = until("a new process", lambda: started_again(together, "acquisition", before))
    assert "SIGSEGV" in entry["last_end"]
