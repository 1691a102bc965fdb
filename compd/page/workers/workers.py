"""The workers of one page's server: a limited number of processes, forked from one with their imports."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess
from typing import Any
from weakref import WeakSet

from compd.page.workers.limits import WorkerLimits, too_many
from compd.page.workers.worker import Worker
from compd.page.workers.worker_process import serve

# Most processes with their states in memory, on the daemon's computer.
MAX_PROCESSES = 8
# Imports of the workers that the server's own process does without, in this order.
PRELOADED = [
    "compd.page.workers.single_thread",
    "compd.page.joining.joiner",
    "compd.page.workbench.diagnosing",
    "compd.page.workbench.formula_questions",
    "compd.page.workbench.plan_questions",
]
# Thread that starts the fork server; it lives as long as this process, since the fork server ends with it.
_STARTER = ThreadPoolExecutor(1, "workers")


class Workers:
    """All workers.

    Attributes
    ----------
    starting : held by the worker's thread that makes room and starts a process; the first waits for what is imported.
    """

    def __init__(self, most: int = MAX_PROCESSES) -> None:
        """most : limit of processes at once."""
        self._context = multiprocessing.get_context("forkserver")
        self._most = most
        self._workers: WeakSet[Worker] = WeakSet()
        self._lock = threading.Lock()
        self.starting = threading.Lock()

    def prepare(self) -> None:
        """Start the process that workers are forked from, unless it runs. It imports what they need, which takes
        seconds; this does not wait for it. Looking at the machine needs no worker."""
        with suppress(OSError):  # the start of a worker says it
            _STARTER.submit(self._ensure_running).result()

    def _ensure_running(self) -> None:
        os.environ["PYTHONSAFEPATH"] = "1"  # nothing is imported from the working directory
        self._context.set_forkserver_preload(PRELOADED)
        forkserver.ensure_running()

    def worker(self, name: str, opening: str, arguments: Sequence[Any], limits: WorkerLimits) -> Worker:
        """A new one; see `Worker`. Its process starts with the first question."""
        worker = Worker(self, name, opening, arguments, limits)
        with self._lock:
            self._workers.add(worker)
        return worker

    def make_room(self, wanting: Worker) -> None:
        """End the least recently used idle process if the limit is reached. Raises StateError if all are busy."""
        with self._lock:
            workers = list(self._workers)
        running = [worker for worker in workers if worker.pid is not None and worker is not wanting]
        excess = len(running) + 1 - self._most
        for worker in sorted(running, key=lambda worker: worker.used_s):
            if excess <= 0:
                return
            excess -= worker.rest()
        if excess > 0:
            raise too_many(wanting.name, self._most)

    def start(self, arguments: tuple[Any, ...]) -> tuple[ForkServerProcess, Connection]:
        """A new process and the connection to it. arguments : of `serve`, after the connection.

        Raises OSError or EOFError where the system lets none be started.
        """
        ours, theirs = self._context.Pipe()
        try:
            process = self._context.Process(target=serve, args=(theirs, *arguments), daemon=True)
            process.start()
        except BaseException:
            ours.close()
            raise
        finally:
            theirs.close()
        return process, ours

    def end(self) -> None:
        """End every process."""
        with self._lock:
            workers = list(self._workers)
        for worker in workers:
            worker.end()
