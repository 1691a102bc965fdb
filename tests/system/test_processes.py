"""The daemon's processes, from outside: what a misbehaving driver, a killed or a stopped process does to setpoints.

Every client here watches all setpoints and holds each to the rules of `tests.support.processes.broken_rules`. No time
is asserted that a loaded computer could not keep; the figures are printed, and measured in tests/benchmarks.
"""

from __future__ import annotations

import itertools
import os
import re
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from compd.client import Client, connect
from compd.clock import MonotonicClock
from compd.errors import DaemonError
from compd.live.loop.states import State
from tests.support.live_models import file_with
from tests.support.pauses import Pauses
from tests.support.processes import (
    DIAL_PROCESS,
    PATIENCE_S,
    RATE_HZ,
    Daemon,
    Machine,
    Pidfds,
    Seen,
    until,
)

# What may be missed or disturbed beside a misdeed: a share of the cycles, and one pause of a computer that has other
# work. A driver that keeps the loop's interpreter costs nine cycles in ten.
MISSED_SHARE = 0.02
PAUSE_S = 0.1
# Setpoints that are not ok: polls have no priority, and a simulated gauge on a busy computer answers late.
DISTURBED_SHARE = 0.2
PAUSES = Pauses()
# Of a loop at 1 kHz.
WATCHED_HZ = 200.0
# How long a misdeed is watched after its first effect.
WATCHED_S = 2.0
# Promised are the longer of 20 ms and two periods until clients hear of a lost loop, and 2 s from SIGTERM to the end.
SILENCE_S = 0.15
END_S = 3.0
AT_ZERO_B0_MM = [0.0, 0.0, -510.0]
PROCESSES = {"supervisor", "loop", "acquisition", "service"}


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machine]:
    with Machine(tmp_path_factory.mktemp("processes")) as machine:
        yield machine


@pytest.fixture
def apart(machine: Machine) -> Daemon:
    """The misbehaving gauge's line has a process of its own."""
    return machine.daemon(machine.configuration("apart"))


@pytest.fixture
def together(machine: Machine) -> Daemon:
    """The misbehaving gauge's line shares the acquisition process with the others."""
    return machine.daemon(machine.configuration("together", own_process=()))


@pytest.fixture
def fresh(machine: Machine) -> Daemon:
    """A daemon that the test may end."""
    return machine.daemon(machine.configuration("apart"), fresh=True)


@pytest.fixture
def changing(machine: Machine) -> Daemon:
    """A daemon whose configuration the test may change."""
    return machine.daemon(machine.configuration("changing"), fresh=True)


@pytest.fixture(autouse=True)
def pauses() -> Iterator[None]:
    """The computer's own pauses are known."""
    with PAUSES.watched():
        yield


def allowance(cycles: float, rate_hz: float) -> float:
    """How many of these cycles a loaded computer may cost, and one that itself paused."""
    return MISSED_SHARE * cycles + (PAUSE_S + 1.2 * PAUSES.lost_s) * rate_hz


@contextmanager
def cycles_kept(daemon: Daemon) -> Iterator[None]:
    """The loop misses no more cycles in the block than any computer may cost it."""
    before = daemon.status()["loop"]
    yield
    after = daemon.status()["loop"]
    cycles, missed = (after[key] - before[key] for key in ("cycles", "missed_cycles"))
    print(f"{missed} of {cycles + missed} cycles missed")
    assert cycles > 0
    assert missed <= allowance(cycles + missed, daemon.rate_hz)


def check_undisturbed(daemon: Daemon, seen: list[Seen]) -> None:
    """Setpoints are ok, except for as many as a busy computer may cost."""
    disturbed = [s for s in seen if not is_ok(s)]
    print(f"{len(disturbed)} of {len(seen)} setpoints not ok")
    assert len(disturbed) <= DISTURBED_SHARE * len(seen) + allowance(0, daemon.rate_hz), disturbed[0].setpoint


def starts(daemon: Daemon, process: str) -> int:
    return int(daemon.processes()[process]["starts"])


def started_again(daemon: Daemon, process: str, before: int) -> dict[str, Any] | None:
    """What STATUS says of a process once it has been started more than `before` times."""
    entry = daemon.processes()[process]
    return entry if entry["starts"] > before else None


def is_valid(seen: Seen) -> bool:
    return bool(seen["valid"])


def is_ok(seen: Seen) -> bool:
    return bool(seen["state"] == State.OK)


def correction_mm(seen: Seen) -> np.ndarray:
    return np.array(seen["correction_mm"])


# --- a driver that misbehaves ------------------------------------------------------------------------------------


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


# --- a process that dies or stops --------------------------------------------------------------------------------


def largest_silence_s(seen: list[Seen]) -> float:
    """The longest that a client had a valid setpoint and heard nothing newer, s."""
    return max(b.arrived_s - a.arrived_s for a, b in itertools.pairwise(seen) if is_valid(a))


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGSTOP], ids=lambda sent: sent.name)
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
    assert silence_s < usual_s + SILENCE_S
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


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGSTOP], ids=lambda sent: sent.name)
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
        assert {seen["state"] for seen in between} <= {State.OK, State.SLEWING, State.HOLD, State.STOP}
    assert until("a new process", lambda: started_again(apart, "acquisition", before))["starts"] == before + 1
    assert {**apart.pids(), "acquisition": 0} == {**pids, "acquisition": 0}, "the others are the same"


@pytest.mark.parametrize("victim", ["service", "supervisor"])
def test_without_service_or_supervisor_nothing_is_left(fresh: Daemon, victim: str) -> None:
    """A restart is the service manager's: there must be nobody in its way."""
    pids = fresh.pids()
    with fresh.watched() as watcher, Pidfds(pids.values()) as processes:
        os.kill(pids[victim], signal.SIGKILL)
        processes.wait_for_ends()
        watcher.until_end()
    assert fresh.process.wait(PATIENCE_S) != 0
    until("no process is left", lambda: not fresh.left())


# --- a daemon that is stopped as a whole -------------------------------------------------------------------------


def pause(duration_s: float) -> None:
    """Let the daemon be stopped for so long: how long it takes is what the test is about."""
    MonotonicClock().wait(threading.Event(), duration_s)


def is_stopped(pid: int) -> bool:
    """Whether every thread is in state T: stopped by a signal, or by a debugger."""
    states = [(task / "stat").read_text().rpartition(")")[2].split()[0] for task in Path(f"/proc/{pid}/task").iterdir()]
    return set(states) <= {"T", "t"}


@pytest.mark.parametrize("duration_s", [0.2, 1.0, 3.0])
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


# --- an end, and a new configuration -----------------------------------------------------------------------------


def check_goodbye(seen: list[Seen], reason: str) -> None:
    """The last setpoints of a stream: held for this reason, and a stop in the end.

    A computer that pauses in between makes the loop miss its time, which is a stop of its own.
    """
    announced = next((i for i, s in enumerate(seen) if reason in s["reason"]), None)
    assert announced is not None, f"no reason contains {reason!r}: {seen[-1].setpoint}"
    assert seen[announced]["state"] == State.HOLD
    assert is_valid(seen[announced])
    states = [s["state"] for s in seen[announced:]]
    assert set(states) == {State.HOLD, State.STOP}
    assert states[-1] == State.STOP, "the last setpoint is invalid"


def test_sigterm_is_told_to_clients_and_leaves_nothing(fresh: Daemon) -> None:
    pids = fresh.pids()
    with fresh.watched() as watcher, Pidfds(pids.values()) as processes:
        watcher.for_s(0.2)
        since = watcher.now
        start_s = time.monotonic()
        fresh.process.terminate()
        assert fresh.process.wait(PATIENCE_S) == 0, fresh.log.read_text()[-4000:]
        took_s = time.monotonic() - start_s
        print(f"ended {took_s:.2f} s after SIGTERM")
        assert took_s < END_S
        processes.wait_for_ends()
        watcher.until_end()
        check_goodbye(watcher.seen[since:], "stopping")
    assert not fresh.socket.exists()
    assert not fresh.left()


def changed(config: Path, **loop: Any) -> None:
    """Write these keys of `loop:` into a configuration."""
    data = yaml.safe_load(config.read_text())
    data["loop"] |= loop
    new = config.with_suffix(".new")
    new.write_text(yaml.safe_dump(data, sort_keys=False))
    new.rename(config)


def test_sighup_with_an_invalid_configuration_changes_nothing(changing: Daemon) -> None:
    pids = changing.pids()
    with changing.connected() as client:
        config_hash = client.version["config_hash"]
    with changing.watched() as watcher, cycles_kept(changing):
        changed(changing.config, rate_hz=-1)
        os.kill(changing.process.pid, signal.SIGHUP)
        until("the log says why", lambda: "loop.rate_hz" in changing.log.read_text(errors="replace"))
        watcher.for_s(1.0)
        assert not watcher.ended
        check_undisturbed(changing, watcher.seen)
    assert changing.pids() == pids
    with changing.connected() as client:
        assert client.version["config_hash"] == config_hash


def test_sighup_brings_a_changed_configuration_under_the_same_main_process(changing: Daemon) -> None:
    with changing.connected() as client:
        config_hash = client.version["config_hash"]
    with changing.watched() as watcher:
        watcher.for_s(0.2)
        since = watcher.now
        changed(changing.config, rate_hz=RATE_HZ / 2)
        start_s = time.monotonic()
        os.kill(changing.process.pid, signal.SIGHUP)
        watcher.until_end()
        check_goodbye(watcher.seen[since:], "configuration")

    def comes_back() -> Client | None:
        assert changing.alive
        try:
            return connect(changing.socket, PATIENCE_S)
        except DaemonError:
            return None

    with until("it listens again", comes_back) as client:
        assert client.version["config_hash"] != config_hash
        status = client.status()
        assert status["config_hash"] == client.version["config_hash"]
        assert status["loop"]["rate_hz"] == RATE_HZ / 2
        assert status["processes"]["supervisor"]["pid"] == changing.process.pid
        assert status["zero"]["taken"], "a rate changes no machine zero"
    with changing.watched() as watcher:
        watcher.until("ok", is_ok)
        print(f"ok {time.monotonic() - start_s:.2f} s after SIGHUP")


# --- the loop ----------------------------------------------------------------------------------------------------


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
