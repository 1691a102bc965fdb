"""`compd` commands as processes side by side, such as a simulated machine and its daemon.

Each is ready before the next starts, and all are stopped at the end.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from compd.configuration import Configuration
from compd.errors import DaemonError

# Longest wait (s) for a start: the first one compiles the kernels, up to two minutes on a slow computer.
START_TIMEOUT_S = 180.0
STOP_TIMEOUT_S = 10.0
POLL_EVERY_S = 0.05


@dataclass(frozen=True)
class Command:
    """`compd` arguments, and the file (a socket) that exists once the process is ready."""

    arguments: Sequence[str]
    ready: Path


@contextmanager
def run_commands(commands: Sequence[Command], log: Path) -> Iterator[None]:
    """Run `commands` during the block, their output in `log`. Raises DaemonError with it if one does not start."""
    processes: list[subprocess.Popen[bytes]] = []
    try:
        with log.open("wb") as output:
            for command in commands:
                process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "compd", *command.arguments],
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=output,
                    start_new_session=True,
                )
                processes.append(process)
                _wait_until_ready(command, process, log)
            yield
    finally:
        for process in reversed(processes):
            process.send_signal(signal.SIGTERM)
        for process in reversed(processes):
            try:
                process.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@contextmanager
def simulated_daemon(
    configuration: Configuration, seed: int, speedup: float, zero_hold_s: float, effects: Sequence[str] = ()
) -> Iterator[Path]:
    """Both run during the block; the directory with their sockets, `control.sock` and `compd.sock`.

    seed : of weather, joints and targets.  speedup : of the weather.  zero_hold_s : how long the machine stands at
    machine zero, s.  effects : hidden in the machine, as for `compd sim run --effect`.

    Raises DaemonError if one does not start.
    """
    with tempfile.TemporaryDirectory(prefix="compd-") as temporary:
        directory = Path(temporary)
        options = ["--seed", str(seed), "--speedup", str(speedup), "--zero-hold", str(zero_hold_s)]
        options += [f"--effect={effect}" for effect in effects]
        commands = [
            Command(
                ["sim", "run", str(configuration.path), "--directory", temporary, *options],
                ready=directory / "control.sock",
            ),
            Command(["run", str(directory / configuration.path.name)], ready=directory / "compd.sock"),
        ]
        with run_commands(commands, log=directory / "output.log"):
            yield directory


def _wait_until_ready(command: Command, process: subprocess.Popen[bytes], log: Path) -> None:
    end_s = time.monotonic() + START_TIMEOUT_S
    while not command.ready.exists():
        if process.poll() is not None or time.monotonic() > end_s:
            raise DaemonError.of(
                f"compd {' '.join(command.arguments)}",
                "did not start",
                next_step="read what it printed:\n" + log.read_text(errors="replace")[-8000:],
            )
        time.sleep(POLL_EVERY_S)
