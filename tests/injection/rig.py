"""The machine of the matrix with real parts: ptys, sockets and processes, for what virtual time cannot stand for."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Self

import yaml

from compd.demo.processes import START_TIMEOUT_S, Command, run_commands
from compd.errors import DaemonError
from tests.injection.clients import Attacked, attacking
from tests.injection.ends import LOOPBACK
from tests.injection.injector import Injector
from tests.injection.machine import (
    SEED,
    SETTLED_S,
    TRIPOD,
    UNKNOWN,
    Held,
    Machine,
    exchange_ports,
    prepare,
)
from tests.injection.truth import PREFERRED, Truth
from tests.support.daemon_process import Daemon
from tests.support.paths import CONFIG
from tests.support.ports import free_port
from tests.support.watching import Seen, Watcher, until


class RealMachine(Machine):
    """The shipped tripod, simulated, with the injector on every line and a daemon beyond it. A context manager."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.state = directory / "state"
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
        options = ["--directory", str(wires), "--seed", str(SEED), "--zero-hold", "1e9"]
        commands = [Command(["sim", "run", str(CONFIG / TRIPOD), *options], ready=wires / "control.sock")]
        ports.mkdir()
        with _preferred():
            running.enter_context(run_commands(commands, log=self.directory / "simulate.log"))
            configuration = yaml.safe_load((wires / TRIPOD).read_text())
            self.injector: Injector = running.enter_context(Injector(configuration, ports))
        self.truth = Truth(wires / "control.sock")
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
            exchange_ports(data, *exchanged)
        host, port = self._tcp
        data["sockets"] = {"tcp": {"host": host, "port": port}, "unix": {"path": str(self.directory / "s")}}
        data["state"] = {"directory": str(self.state)}
        prepare(data)
        path = self.directory / "machine.yaml"
        path.write_text(yaml.safe_dump(data, sort_keys=False))
        return path

    # --- time and the machine

    @property
    def now_s(self) -> float:
        return time.monotonic()

    def rest_for(self, duration_s: float) -> None:
        self.truth.rest_for(duration_s)

    def drive(self, scale_mm: Sequence[float]) -> None:
        self.truth.drive(scale_mm)
        self.place_mm = tuple(scale_mm)
        self.rest_for(SETTLED_S)

    # --- the daemon

    def kill(self, process: str) -> None:
        self.signal(process, signal.SIGKILL)

    def stall(self, process: str, duration_s: float) -> None:
        self.signal(process, signal.SIGSTOP)
        if math.isfinite(duration_s):
            try:
                self.rest_for(duration_s)
            finally:
                self.signal(process, signal.SIGCONT)

    def signal(self, process: str, number: signal.Signals) -> None:
        """Send a signal to one of the daemon's processes, or to all of them for ""."""
        if not process:
            os.killpg(self.daemon.process.pid, number)
            return
        # one that is just being started has the number 0, which is everybody in this process's own group
        os.kill(until(f"{process} runs", lambda: self.daemon.pids()[process]), number)

    def attack(self, name: str) -> None:
        at = Attacked(str(self.daemon.socket), self._tcp, self.truth.tip_mm())
        self._attacks.enter_context(attacking(name, at))

    def reload(self, exchanged: tuple[str, str] | None) -> None:
        self._write_configuration(exchanged)
        self._reloaded = exchanged is not None
        if self.daemon.alive:
            self.daemon.process.send_signal(signal.SIGHUP)

    def ends(self) -> bool:
        return self.daemon.ends()

    def end_daemon(self) -> None:
        self.daemon.stop()

    def start_daemon(self) -> None:
        self.daemon.__enter__()

    def repair(self) -> None:
        self._attacks.close()
        self.injector.repair()
        if self._reloaded:
            self._write_configuration()
        if self._reloaded or not self.daemon.alive:
            self._reloaded = False
            self.restart()

    # --- clients

    @contextmanager
    def watched(self) -> Iterator[Watcher]:
        watcher = Watcher(self.daemon.socket, self.daemon.rules)
        try:
            yield watcher
        finally:
            watcher.close()

    def accept(self) -> None:
        with self.daemon.connected() as client:
            client.accept("all")

    def ask_all(self) -> None:
        with self.daemon.connected() as client:
            client.status()
            client.model()

    def hold(self, seen: Sequence[Seen]) -> list[Held]:
        return [self._held(one) for one in seen]

    def _held(self, one: Seen) -> Held:
        """Known at rest alone."""
        age_s = one.setpoint.get("age_s") or 0.0
        tip_mm = self.truth.at(one["time_s"] - max(age_s, SETTLED_S), one["time_s"])
        return UNKNOWN if tip_mm is None else Held(1e3 * math.dist(one["tip_M_mm"], tip_mm), True)


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
