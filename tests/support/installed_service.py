"""The daemon as systemd runs it in a container, for a simulated machine there."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from compd.client import Client, connect
from compd.errors import DaemonError
from tests.support.container import Container, wait_until
from tests.support.paths import CONFIG
from tests.support.patience import PATIENCE_S

# Where the container has this project's configurations.
CONFIGURATIONS = Path("/opt/config")
SIMULATED = Path("/run/simulated")
MACHINE = Path("/etc/compd/machine.yaml")
SOCKET = Path("/run/compd/compd.sock")
SHIPPED = "tripod-cmm.yaml"
# Longer than the tests take: the machine stands still, so that machine zero fits its gauges throughout.
ZERO_HOLD_S = 86_400


@dataclass(frozen=True)
class Service:
    """The daemon as systemd runs it in a container."""

    container: Container

    def systemctl(self, *arguments: str) -> str:
        return self.container.run("systemctl", *arguments)

    def shown(self, name: str) -> str:
        """A property of the unit."""
        return self.systemctl("show", "--value", f"--property={name}", "compd").strip()

    def reached_s(self, name: str) -> float:
        """When the unit reached a state, on the monotonic clock that the container shares."""
        return int(self.shown(f"{name}TimestampMonotonic")) * 1e-6

    def connect(self) -> Client:
        """A client, from outside the container."""
        return connect(self.container.path(SOCKET), PATIENCE_S)

    def zero(self) -> Any:
        with self.connect() as client:
            return client.status()["zero"]

    def wait_for_ok(self, timeout_s: float = PATIENCE_S) -> float:
        """Wait until the daemon's setpoints are ok; the time on the monotonic clock at which one was."""

        end_s = time.monotonic() + timeout_s

        def moment_s() -> float | None:
            try:
                with self.connect() as client:
                    for setpoint in client.watch():
                        if setpoint["state"] == "ok":
                            return time.monotonic()
                        assert time.monotonic() < end_s, setpoint
            except DaemonError:
                pass  # not yet there
            return None

        return wait_until(moment_s, "a daemon with setpoints", timeout_s)

    def wait_for_another_process(self, main: str) -> None:
        """Wait until systemd has started the daemon anew. main : the process id of the one before."""
        wait_until(lambda: self.shown("MainPID") not in (main, "0"), "a restart", PATIENCE_S)

    def config_hash(self) -> str:
        """Of the configuration that the daemon runs with."""
        with self.connect() as client:
            return str(client.version["config_hash"])

    def log(self, since_s: float = 0.0) -> str:
        """What daemon and systemd have written to the journal about the unit. since_s : seconds since 1970."""
        return self.container.run("journalctl", "--unit=compd", "--output=cat", "--quiet", f"--since=@{since_s:.6f}")

    def signal_main(self, name: str) -> None:
        self.systemctl("kill", "--kill-whom=main", f"--signal={name}", "compd")


def simulate(container: Container, program: Path) -> None:
    """A simulated machine on ptys of the daemon's user, and the configuration of that machine.

    program : compd in the container, which has this project's configurations at CONFIGURATIONS.
    """
    container.run(
        *("systemd-run", "--unit=simulated-machine", "--quiet"),
        *("--property=User=compd", f"--property=RuntimeDirectory={SIMULATED.name}"),
        *(str(program), "sim", "run", str(CONFIGURATIONS / SHIPPED)),
        *(f"--directory={SIMULATED}", f"--zero-hold={ZERO_HOLD_S}"),
    )
    wait_until(container.path(SIMULATED / "control.sock").exists, "the simulated machine", PATIENCE_S)
    data = yaml.safe_load(container.path(SIMULATED / SHIPPED).read_text())
    shipped = yaml.safe_load((CONFIG / SHIPPED).read_text())
    data["sockets"]["unix"] = shipped["sockets"]["unix"]
    data["state"] = shipped["state"]
    container.path(MACHINE).parent.mkdir(exist_ok=True)
    container.path(MACHINE).write_text(yaml.safe_dump(data))


def take_zero(container: Container, program: Path) -> None:
    """Take machine zero of the simulated machine."""
    zero = (str(program), "zero")
    # on a busy computer a simulated gauge is late now and then
    wait_until(lambda: "taken" in container.run(*zero, check=False), "machine zero", PATIENCE_S)


@contextmanager
def changed_limit(service: Service, name: str, value: float) -> Iterator[None]:
    """Write a limit into the machine's configuration; the one before is back after the block."""
    path = service.container.path(MACHINE)
    before = path.read_text()
    data = yaml.safe_load(before)
    data["limits"][name] = value
    path.write_text(yaml.safe_dump(data))
    try:
        yield
    finally:
        path.write_text(before)


def without_s(words: str) -> float:
    """The time without valid setpoints that `compd service` tells."""
    found = re.search(r"([\d.]+) s without valid setpoints", words)
    assert found is not None, words
    return float(found[1])
