"""A simulated machine, the injector, a daemon, and the truth against which every valid setpoint is held."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
import yaml

from compd.demo.processes import START_TIMEOUT_S, Command, run_commands
from compd.errors import DaemonError
from compd.setpoint_states import State
from tests.injection.clients import Attacked, attacking
from tests.injection.ends import LOOPBACK
from tests.injection.injector import Injector
from tests.injection.truth import PREFERRED, REST_EVERY_S, SETTLED_S, Truth
from tests.support.daemon_process import Daemon
from tests.support.live_models import file_with
from tests.support.paths import CONFIG
from tests.support.patience import PATIENCE_S
from tests.support.ports import free_port
from tests.support.watching import Rules, Seen, Watcher, until

TRIPOD = "tripod-cmm.yaml"
RATE_HZ = 100.0
# What an owner adds to the shipped configuration, so that the gauges are compared with each other.
VOTES = {
    "joint_pair_um": 30.0,
    "tip_mm_per_s": 200.0,
    "frame": {"temperature": "temperature_frame_degC", "expansion_ppm_per_K": 10.5, "tolerance_um": 15.0},
}
MACHINE_ZERO = "machine-zero.json"
# Steel.
EXPANSION, EXPANSION_PPM_PER_K = "link_expansion", 11.5


@dataclass
class Verdict:
    """What became of the setpoints of a time.

    worst_um : largest distance of a valid tip from the true one, the machine at rest; nan where none was valid, inf
    for a tip that is no number.
    worst : that setpoint. states : how often each state was there. reasons : likewise.
    """

    worst_um: float = math.nan
    worst: dict[str, Any] = field(default_factory=dict)
    states: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    judged: int = 0
    valid: int = 0
    longest_reason: int = 0

    @property
    def valid_share(self) -> float:
        total = sum(self.states.values())
        return self.valid / total if total else math.nan

    def add(self, seen: Seen, tip_mm: np.ndarray | None) -> None:
        """A setpoint, with the true tip of its time; None where the machine moved."""
        self.states[seen["state"]] += 1
        if reason := seen.setpoint.get("reason"):
            self.reasons[reason] += 1
            self.longest_reason = max(self.longest_reason, len(reason.encode()))
        if not seen["valid"]:
            return
        self.valid += 1
        if tip_mm is None:
            return
        self.judged += 1
        error_um = float(np.linalg.norm(np.subtract(seen["tip_M_mm"], tip_mm))) * 1e3
        if not math.isfinite(error_um):
            error_um = math.inf
        if math.isnan(self.worst_um) or error_um > self.worst_um:
            self.worst_um, self.worst = error_um, seen.setpoint


class InjectedMachine:
    """The shipped tripod, simulated, with the injector on every line and a daemon beyond it. A context manager.

    changes : of the daemon's configuration, by section: {"loop": {"on_stale": "fade"}}. truth_every_s : how often the
    true tip is asked for. expands : its links expand as steel does, and the daemon corrects it by its thermometers.
    """

    def __init__(
        self,
        directory: Path,
        seed: int = 3,
        changes: dict[str, dict[str, Any]] | None = None,
        truth_every_s: float = REST_EVERY_S,
        expands: bool = False,
    ) -> None:
        self.directory = directory
        self.expands = expands
        self._seed = seed
        self._changes = changes or {}
        self._truth_every_s = truth_every_s
        self._reloaded = False
        self._running = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as starting:
            self._start(starting)
            self._running = starting.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._running.close()

    def _start(self, running: ExitStack) -> None:
        wires, ports = self.directory / "wires", self.directory / "ports"
        options = ["--directory", str(wires), "--seed", str(self._seed), "--zero-hold", "1e9"]
        if self.expands:
            options += ["--effect", f"{EXPANSION}={EXPANSION_PPM_PER_K}"]
            self._changes = {**self._changes, "state": {"model_file": str(self.directory / "expands.yaml")}}
            file_with(self.directory / "expands.yaml", EXPANSION, **{EXPANSION: EXPANSION_PPM_PER_K})
        commands = [Command(["sim", "run", str(CONFIG / TRIPOD), *options], ready=wires / "control.sock")]
        ports.mkdir()
        with _preferred():
            running.enter_context(run_commands(commands, log=self.directory / "simulate.log"))
            configuration = yaml.safe_load((wires / TRIPOD).read_text())
            self.injector = running.enter_context(Injector(configuration, ports))
        self.truth = Truth(wires / "control.sock", self._truth_every_s)
        running.callback(self.truth.close)
        self._attacks = running.enter_context(ExitStack())
        self._tcp = (LOOPBACK, free_port())
        self.daemon = Daemon(self._write_configuration())
        running.callback(self.daemon.stop)
        self.daemon.__enter__()
        with self.daemon.connected() as client:
            until("machine zero is taken", lambda: _takes_zero(client), START_TIMEOUT_S)

    def _write_configuration(self, exchanged: tuple[str, str] | None = None) -> Path:
        """exchanged : two lines that have each other's port."""
        data = self.injector.daemon_configuration()
        if exchanged:
            one, other = (data["lines"][name] for name in exchanged)
            one["port"], other["port"] = other["port"], one["port"]
        data["loop"]["rate_hz"] = RATE_HZ
        host, port = self._tcp
        data["sockets"] = {
            "tcp": {"host": host, "port": port},
            "unix": {"path": str(self.directory / "s")},
            "valid_for_s": 0.1,
        }
        data["state"] = {"directory": str(self.directory / "state")}
        add_votes(data)
        for section, values in self._changes.items():
            data.setdefault(section, {}).update(values)
        path = self.directory / "machine.yaml"
        path.write_text(yaml.safe_dump(data, sort_keys=False))
        return path

    @contextmanager
    def watched(self) -> Iterator[Watcher]:
        """A client that takes every setpoint; the rules that are broken are in its `broken`."""
        watcher = Watcher(self.daemon.socket, self.rules)
        try:
            yield watcher
        finally:
            watcher.close()

    @property
    def rules(self) -> Rules:
        return self.daemon.rules

    def judge(self, setpoints: Sequence[Seen], verdict: Verdict | None = None) -> Verdict:
        """Hold setpoints against the truth. Ask for the truth once more first: the last ones are judged by it."""
        self.truth.rest_for(0.0)
        verdict = verdict or Verdict()
        for seen in setpoints:
            time_s = seen["time_s"]
            age_s = seen.setpoint.get("age_s") or 0.0
            verdict.add(seen, self.truth.at(time_s - max(age_s, SETTLED_S), time_s) if seen["valid"] else None)
        return verdict

    def accept(self, names: Sequence[str] = ("all",)) -> None:
        """A person has looked at these gauges."""
        with self.daemon.connected() as client:
            for name in names:
                client.accept(name)

    def attack(self, name: str) -> None:
        """A hostile client from now on."""
        at = Attacked(str(self.daemon.socket), self._tcp, self.truth.tip_mm())
        self._attacks.enter_context(attacking(name, at))

    def signal(self, process: str, number: signal.Signals) -> None:
        """Send a signal to one of the daemon's processes."""
        # one that is just being started has the number 0, which is everybody in this process's own group
        os.kill(until(f"{process} runs", lambda: self.daemon.pids()[process]), number)

    def stop_for(self, duration_s: float) -> None:
        """Stop all of the daemon for so long."""
        os.killpg(self.daemon.process.pid, signal.SIGSTOP)
        try:
            self.truth.rest_for(duration_s)
        finally:
            os.killpg(self.daemon.process.pid, signal.SIGCONT)

    def exchange_ports(self, one: str, other: str) -> None:
        """In the configuration, by mistake; then the daemon is told to read it anew."""
        self._write_configuration((one, other))
        self._reloaded = True
        if self.daemon.alive:
            self.daemon.process.send_signal(signal.SIGHUP)

    @contextmanager
    def busy(self, processes: int) -> Iterator[None]:
        """So many other programs compute without end during the block, at the daemon's own priority."""
        with ExitStack() as running:
            for _ in range(processes):
                program = subprocess.Popen([sys.executable, "-c", "while True: pass"])
                running.callback(program.wait)
                running.callback(program.kill)
            yield

    def repair(self) -> None:
        """No fault on any line, no hostile client, and a daemon that runs with its own configuration."""
        self._attacks.close()
        self.injector.repair()
        if self._reloaded:
            self._write_configuration()
        if self._reloaded or not self.daemon.alive:
            self._reloaded = False
            self.restart()

    def restart(self, forget: bool = False) -> None:
        """End the daemon, in whatever state it is, and start it anew.

        forget : what it knows of its gauges but for machine zero, so that they are believed as they are.
        """
        self.daemon.stop()
        if forget:
            for path in (self.directory / "state").iterdir():
                if path.name != MACHINE_ZERO:
                    path.unlink()
        self.daemon.__enter__()

    def until_ok(self, watcher: Watcher, patience_s: float = PATIENCE_S) -> bool:
        """Whether the state becomes ok within this time."""
        since, end_s = watcher.now, time.monotonic() + patience_s
        while time.monotonic() < end_s:
            if any(seen["state"] == State.OK for seen in watcher.seen[since:]):
                return True
            watcher._end.wait(0.02)
        return False


def add_votes(configuration: dict[str, Any]) -> None:
    """Let the gauges of a configuration document be compared with each other, as far as they can."""
    configuration["votes"] = VOTES


@contextmanager
def _preferred() -> Iterator[None]:
    """What is started in the block stands for devices, which no program slows down, where that is permitted."""
    before = os.getpriority(os.PRIO_PROCESS, 0)
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, PREFERRED)
    try:
        yield
    finally:
        os.setpriority(os.PRIO_PROCESS, 0, before)


def _takes_zero(client: Any) -> bool:
    try:
        client.zero()
    except DaemonError:
        return False
    return True
