"""A machine on simulated wires, the daemon's processes as a system sees them, and a client that sees every setpoint."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np
import yaml

from compd.client import Client, connect
from compd.clock import MonotonicClock
from compd.demo.processes import START_TIMEOUT_S, STOP_TIMEOUT_S, Command, run_commands
from compd.demo.session import wait_for_gauges
from compd.errors import DaemonError
from compd.live.loop.states import State, state_named
from tests.support.misbehaving import Misdeeds
from tests.support.paths import CONFIG

# Long enough for a loaded computer; what is waited for comes much sooner.
PATIENCE_S = 30.0
LOOK_EVERY_S = 0.05
TRIPOD = "tripod-cmm.yaml"
# The gauge that misbehaves: the only one on its line.
DIAL = "dial"
DIAL_PROCESS = f"line {DIAL}"
DIAL_CHANNEL = f"{DIAL}.value"
RATE_HZ = 100.0
# An acquisition process may grow by this; a few polls of the driver that eats memory.
MEMORY_MB = 200
# Numbers are rounded to 1e-7 mm.
ROUNDING_MM = 1e-6

Message = dict[str, Any]
T = TypeVar("T")


def until(what: str, holds: Callable[[], T | None], patience_s: float = PATIENCE_S) -> T:
    """The first true value of `holds`; fails when none comes."""
    clock, never, end_s = MonotonicClock(), threading.Event(), time.monotonic() + patience_s
    while not (value := holds()):
        assert time.monotonic() < end_s, f"never: {what}"
        clock.wait(never, LOOK_EVERY_S)
    return value


class Rules(NamedTuple):
    """What a configuration promises of every setpoint."""

    period_s: float
    slew_mm_per_s: float
    stale_after_s: float
    hold_s: float


def broken_rules(setpoint: Message, before: Message | None, last_valid: Message | None, rules: Rules) -> Iterator[str]:
    """What is wrong with a setpoint, after the one before it and the last one that was valid."""
    if before is not None and not (setpoint["seq"] > before["seq"] and setpoint["time_s"] > before["time_s"]):
        yield f"seq or time does not grow: {before['seq']}, {before['time_s']} s"
    state = state_named(setpoint["state"])
    if state is None or state.valid != setpoint["valid"]:
        yield "validity is not that of its state"
    if setpoint["state"] != State.OK and not setpoint["reason"]:
        yield "no reason"
    if not setpoint["valid"]:
        if numbers := {"tip_M_mm", "scale_setpoint_mm", "correction_mm", "link_length_mm"} & setpoint.keys():
            yield f"invalid, with {sorted(numbers)}"
        return
    replaced = state in (State.HOLD, State.FADE)
    if setpoint["age_s"] > rules.stale_after_s + (rules.hold_s if replaced else 0.0) + 1e-3:
        yield f"from readings that are {setpoint['age_s']} s old"
    if last_valid is not None:
        step_mm = np.abs(np.subtract(setpoint["correction_mm"], last_valid["correction_mm"])).max()
        # a correction slews by periods, whatever the jitter of their times
        elapsed_s = max(
            setpoint["time_s"] - last_valid["time_s"], (setpoint["seq"] - last_valid["seq"]) * rules.period_s
        )
        if step_mm > rules.slew_mm_per_s * elapsed_s + ROUNDING_MM:
            yield f"the correction jumps by {step_mm} mm in {elapsed_s} s"


@dataclass(frozen=True)
class Seen:
    """A setpoint, and when it arrived."""

    arrived_s: float
    setpoint: Message

    def __getitem__(self, key: str) -> Any:
        return self.setpoint[key]


class Watcher:
    """A client that takes every setpoint, on a thread of its own, and holds each to the rules.

    Attributes
    ----------
    seen : all that arrived. ended : why no more come; "" while they do. broken : which setpoint broke which rule.
    """

    def __init__(self, address: Path, rules: Rules, rate_hz: float | None = None) -> None:
        self.seen: list[Seen] = []
        self.ended = ""
        self.broken: list[str] = []
        self._rules = rules
        self._end = threading.Event()
        self._rate_hz = rate_hz
        self._client = connect(address, PATIENCE_S)
        self._thread = threading.Thread(target=self._run, name="watcher", daemon=True)
        self._thread.start()

    @property
    def now(self) -> int:
        """What is seen from this index on is new."""
        return len(self.seen)

    def until(self, what: str, holds: Callable[[Seen], bool], since: int = 0) -> Seen:
        """The first setpoint from index `since` on for which `holds`; fails when none comes, or no more can."""
        end_s = time.monotonic() + PATIENCE_S
        index = since
        while True:
            ended, patient = self._end.is_set(), time.monotonic() < end_s
            for seen in self.seen[index:]:
                if holds(seen):
                    return seen
                index += 1
            last = self.seen[-1].setpoint if self.seen else None
            assert not ended, f"never: {what}; {self.ended}; last {last}"
            assert patient, f"never: {what}; still {last}"
            # not one by one: at 1 kHz that would take the interpreter from the thread that reads
            self._end.wait(LOOK_EVERY_S)

    def for_s(self, duration_s: float) -> list[Seen]:
        """What arrives from now on, until the daemon's clock is `duration_s` further."""
        since = self.now
        first = self.until("a setpoint", lambda _: True, since)
        self.until(f"{duration_s} s more", lambda seen: seen["time_s"] - first["time_s"] >= duration_s, since)
        return self.seen[since:]

    def until_end(self) -> None:
        """Wait until the daemon has closed the connection."""
        assert self._end.wait(PATIENCE_S), "setpoints still come"

    def close(self) -> None:
        """Stop watching."""
        # ends the thread's read; the thread closes the files
        with contextlib.suppress(OSError):
            self._client._connection.shutdown(socket.SHUT_RDWR)
        self._thread.join(PATIENCE_S)
        assert not self._thread.is_alive()

    def _run(self) -> None:
        before = last_valid = None
        why = "stopped watching"
        try:
            for setpoint in self._client.watch(self._rate_hz):
                broken = [f"{rule}: {setpoint}" for rule in broken_rules(setpoint, before, last_valid, self._rules)]
                before, last_valid = setpoint, setpoint if setpoint["valid"] else last_valid
                self.seen.append(Seen(time.monotonic(), setpoint))
                self.broken += broken
        except DaemonError as error:
            why = str(error)
        finally:
            self._client.close()
            self.ended = why
            self._end.set()


class Pidfds:
    """Handles of processes, taken while they run, so that no other process can be meant later."""

    def __init__(self, pids: Iterable[int]) -> None:
        self._descriptors = {os.pidfd_open(pid): pid for pid in pids}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for descriptor in self._descriptors:
            os.close(descriptor)

    def wait_for_ends(self, patience_s: float = PATIENCE_S) -> None:
        """Return when every process has ended; fails with those that have not."""
        left = dict(self._descriptors)
        poller, end_s = select.poll(), time.monotonic() + patience_s
        for descriptor in left:
            poller.register(descriptor, select.POLLIN)
        while left:
            ready = poller.poll(max(0.0, end_s - time.monotonic()) * 1e3)
            assert ready, f"processes that do not end: {sorted(left.values())}"
            for descriptor, _ in ready:
                poller.unregister(descriptor)
                del left[descriptor]


class Daemon:
    """`compd run` as a process group. A context manager: runs in the block, and leaves nothing behind.

    The group is in the test's own session: in an orphaned one SIGTSTP would have no effect.
    """

    def __init__(self, config: Path) -> None:
        self.config = config
        self.log = config.with_suffix(".log")
        data = yaml.safe_load(config.read_text())
        self.socket = Path(data["sockets"]["unix"]["path"])
        self.rate_hz = float(data["loop"]["rate_hz"])
        loop = data["loop"]
        self.rules = Rules(1 / self.rate_hz, data["limits"]["slew_mm_per_s"], loop["stale_after_s"], loop["hold_s"])
        self.process: subprocess.Popen[bytes]

    def __enter__(self) -> Self:
        notify = self.config.with_suffix(".notify")
        notify.unlink(missing_ok=True)
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager, self.log.open("wb") as log:
            manager.bind(str(notify))
            self.process = subprocess.Popen(
                [sys.executable, "-m", "compd", "run", str(self.config)],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                process_group=0,
                env={**os.environ, "NOTIFY_SOCKET": str(notify), "PYTHONUNBUFFERED": "1"},
            )
            try:
                self._wait_for_ready(manager)
            except BaseException:
                self.stop()
                raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """End it in whatever state it is; whatever is left of it is killed."""
        if self.process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGCONT)
            self.process.terminate()
            try:
                self.process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        for pid in self.left():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    @property
    def alive(self) -> bool:
        """Whether the main process runs."""
        return self.process.poll() is None

    def status(self) -> Message:
        """STATUS, over a connection of its own."""
        with self.connected() as client:
            return client.status()

    def connected(self) -> Client:
        return connect(self.socket, PATIENCE_S)

    def processes(self) -> dict[str, Message]:
        """The daemon's processes by name, as STATUS has them."""
        processes: dict[str, Message] = self.status()["processes"]
        return processes

    def pids(self) -> dict[str, int]:
        return {name: int(process["pid"]) for name, process in self.processes().items()}

    def quality(self, channel: str = DIAL_CHANNEL) -> str:
        """What STATUS says of a channel."""
        return next(str(gauge["quality"]) for gauge in self.status()["gauges"] if gauge["channel"] == channel)

    def left(self) -> list[int]:
        """Every process of this daemon that the system has; they have the configuration in their command lines."""
        found = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdecimal():
                with contextlib.suppress(OSError):
                    if str(self.config).encode() in (entry / "cmdline").read_bytes().split(b"\0"):
                        found.append(int(entry.name))
        return found

    @contextmanager
    def watched(self, rate_hz: float | None = None) -> Iterator[Watcher]:
        """A client that watches during the block; no setpoint may break a rule.

        rate_hz : None for every setpoint, which at 1 kHz is more than a busy computer can read.
        """
        watcher = Watcher(self.socket, self.rules, rate_hz)
        try:
            yield watcher
        finally:
            watcher.close()
        assert not watcher.broken, f"{len(watcher.broken)} broken rules, the first: {watcher.broken[0]}"

    def _wait_for_ready(self, manager: socket.socket) -> None:
        end = os.pidfd_open(self.process.pid)
        try:
            poller = select.poll()
            poller.register(manager, select.POLLIN)
            poller.register(end, select.POLLIN)
            limit_s = time.monotonic() + START_TIMEOUT_S
            while True:
                ready = [descriptor for descriptor, _ in poller.poll(max(0.0, limit_s - time.monotonic()) * 1e3)]
                assert ready, f"not ready in {START_TIMEOUT_S} s:\n{self._tail()}"
                assert end not in ready, f"ended with {self.process.wait()}:\n{self._tail()}"
                if manager.recv(4096) == b"READY=1":
                    return
        finally:
            os.close(end)

    def _tail(self) -> str:
        return self.log.read_text(errors="replace")[-8000:]


def _takes_zero(client: Client) -> bool:
    """Take machine zero; False where a gauge was too late for it just now."""
    try:
        client.zero()
    except DaemonError:
        return False
    return True


class Machine:
    """The shipped tripod on simulated wires, with one gauge more, the one that misbehaves; and one daemon at a time.

    A context manager. The daemons share a directory, so that machine zero is taken once.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.misdeeds = Misdeeds(directory)
        self._running = ExitStack()
        self._daemon: Daemon | None = None

    def __enter__(self) -> Self:
        wires = self.directory / "wires"
        simulate = ["simulate", str(CONFIG / TRIPOD), "--directory", str(wires), "--seed", "3", "--zero-hold", "3600"]
        self._running.enter_context(
            run_commands([Command(simulate, ready=wires / "control.sock")], log=self.directory / "simulate.log")
        )
        # nobody answers on the dial's line: its driver asks nothing
        self._ends = os.openpty()
        for end in self._ends:
            self._running.callback(os.close, end)
        self._running.callback(self._stop_daemon)
        return self

    def __exit__(self, *_: object) -> None:
        self._running.close()

    def configuration(self, name: str, own_process: Sequence[str] = (DIAL,), rate_hz: float = RATE_HZ) -> Path:
        """The file of a daemon for this machine."""
        data = yaml.safe_load((self.directory / "wires" / TRIPOD).read_text())
        data["lines"][DIAL] = {
            "kind": "serial",
            "port": os.ttyname(self._ends[1]),
            "baud": 9600,
            "format": "8N1",
            "timeout_s": 0.02,
            "back_off_s": [0.1, 0.5],
            "poll_every_s": 0.1,
        }
        data["gauges"][DIAL] = {"driver": self.misdeeds.driver, "line": DIAL}
        data["wiring"]["quantities"].append({"name": "temperature_dial_degC", "gauge": DIAL})
        data["loop"]["rate_hz"] = rate_hz
        data["acquisition"] = {"own_process": list(own_process), "memory_mb": MEMORY_MB}
        data["sockets"] = {"unix": {"path": str(self.directory / "s")}, "valid_for_s": 0.1}
        data["state"] = {"directory": str(self.directory / "state")}
        path = self.directory / f"{name}.yaml"
        path.write_text(yaml.safe_dump(data, sort_keys=False))
        return path

    def daemon(self, config: Path, fresh: bool = False) -> Daemon:
        """A daemon with this configuration in state ok: the one that runs, unless `fresh`, or a new one."""
        self.misdeeds.end()
        running = self._daemon
        if running is not None and not fresh and running.config == config and running.alive:
            with contextlib.suppress(AssertionError, DaemonError):  # what a failed test has left is no use to others
                self._settle(running)
                return running
        self._stop_daemon()
        self._daemon = Daemon(config).__enter__()
        self._settle(self._daemon)
        return self._daemon

    def _settle(self, daemon: Daemon) -> None:
        """Wait until it is ok; without machine zero, take it."""
        with daemon.connected() as observer, daemon.watched() as watcher:
            if not observer.status()["zero"]["taken"]:
                with daemon.connected() as client:
                    wait_for_gauges(observer, client.watch(10))
                until("machine zero is taken", lambda: _takes_zero(observer))
            until("the dial is good", lambda: daemon.quality() == "ok")
            watcher.until("ok", lambda seen: seen["state"] == "ok", watcher.now)

    def _stop_daemon(self) -> None:
        if self._daemon is not None:
            self._daemon.stop()
            self._daemon = None
