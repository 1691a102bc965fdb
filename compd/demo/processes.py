"""`compd` commands that run as processes side by side: each ready before the next starts, all stopped at the end."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

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
