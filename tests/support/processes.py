"""The shipped tripod on simulated wires with a gauge that misbehaves, and one daemon at a time for it."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import yaml

from compd.client import Client
from compd.demo.machine_zero import wait_for_gauges
from compd.demo.processes import Command, run_commands
from compd.errors import DaemonError
from tests.support.daemon_process import Daemon
from tests.support.misbehaving import DIAL, Misdeeds
from tests.support.paths import CONFIG
from tests.support.simulated import PATIENT_TIP_ERROR_UM
from tests.support.watching import until

TRIPOD = "tripod-cmm.yaml"
RATE_HZ = 100.0
# An acquisition process may grow by this; a few polls of the driver that eats memory.
MEMORY_MB = 200


def takes_zero(client: Client) -> bool:
    """Take machine zero; False where a gauge was too late for it just now."""
    try:
        client.zero()
    except DaemonError:
        return False
    return True


def read_twice(client: Client) -> bool:
    """Whether the motion of every length is known: one reading tells none, and is refused when it is held."""
    return all(gauge["ok"] >= 2 for line in client.status()["lines"].values() for gauge in line["gauges"].values())


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
        simulate = ["sim", "run", str(CONFIG / TRIPOD), "--directory", str(wires), "--seed", "3", "--zero-hold", "3600"]
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
        data["limits"]["tip_error_um"] = PATIENT_TIP_ERROR_UM
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
                until("machine zero is taken", lambda: takes_zero(observer))
            until("the dial is good", lambda: daemon.quality() == "ok")
            until("every gauge was read twice", lambda: read_twice(observer))
            watcher.until("ok", lambda seen: seen["state"] == "ok", watcher.now)

    def _stop_daemon(self) -> None:
        if self._daemon is not None:
            self._daemon.stop()
            self._daemon = None
