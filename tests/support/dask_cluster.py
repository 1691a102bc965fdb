"""A Dask scheduler and workers as processes of their own, as a person starts them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from tests.support.paths import ROOT
from tests.support.patience import PATIENCE_S
from tests.support.watching import until


class DaskCluster:
    """A running scheduler, at `address`, with its workers."""

    def __init__(
        self, address: str, scheduler: subprocess.Popen[bytes], workers: list[subprocess.Popen[bytes]]
    ) -> None:
        self.address = address
        self.scheduler = scheduler
        self.workers = workers

    def kill_scheduler(self) -> None:
        """End the scheduler at once; workers end by themselves."""
        self.scheduler.kill()
        self.scheduler.wait()

    def kill_worker(self) -> None:
        """End the first worker as a lack of memory would; nothing starts it again."""
        self.workers[0].kill()
        self.workers[0].wait()


@contextmanager
def dask_cluster(directory: Path, workers: int) -> Iterator[DaskCluster]:
    """`dask scheduler` and so many `dask worker`, one thread each, without anything that starts them again."""
    file = directory / "scheduler.json"
    with ExitStack() as running:
        log = running.enter_context((directory / "dask.log").open("wb"))

        def start(*arguments: str) -> subprocess.Popen[bytes]:
            process = subprocess.Popen(
                [sys.executable, "-m", "dask", *arguments, "--no-dashboard", "--scheduler-file", str(file)],
                cwd=directory,
                stdout=log,
                stderr=log,
                env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "drivers")])},
            )
            running.callback(process.wait, PATIENCE_S)
            running.callback(process.send_signal, signal.SIGTERM)
            return process

        scheduler = start("scheduler", "--host", "127.0.0.1", "--port", "0")
        until("a scheduler", lambda: file.exists() and file.read_text().endswith("}"), PATIENCE_S)
        started = [start("worker", "--nthreads", "1", "--no-nanny") for _ in range(workers)]
        yield DaskCluster(json.loads(file.read_text())["address"], scheduler, started)
