"""The workers of one page's server: a limited number of processes, forked from one with their imports.

A worker opens its state at the first question, and answers until the end of its input.

A message to it is (question, arguments, whether steps are told); a question is the name of a function that gets the
state first. Messages from it are (kind, content, kept): "step" with a text; "answer" with bytes; "error" with the
exception; "memory".
"""

from __future__ import annotations

import json
import multiprocessing
import os
import pkgutil
import shutil
import signal
import tempfile
import threading
import weakref
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from multiprocessing import forkserver
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import TYPE_CHECKING, Any

from compd.errors import CompdError
from compd.live.system import limit_memory
from compd.page.shares import shares_of
from compd.page.shown_texts import shown
from compd.page.workers.limits import WorkerLimits, too_many
from compd.page.workers.worker import Started, Worker
from compd.text import nan_to_null

if TYPE_CHECKING:
    from compd.page.guard import Token

# OOM score adjustment (at most 1000): the system ends a worker first if memory is short.
_KILLED_FIRST = "700"
# Exceptions that stand for an answer: a problem for a person, a missing key, a missing file.
ERRORS = (CompdError, KeyError, IndexError, FileNotFoundError)


def serve(
    messages: Connection,
    temporary: str,
    opening: str,
    arguments: Sequence[Any],
    kept: Any,
    memory_mb: float,
    nice: int,
) -> None:
    """Answer questions until the other end is closed.

    temporary : directory of its temporary files, which the server removes after its end.
    opening : "package.module:Class" of the state. arguments : of the class, before `kept`. kept : `kept` of the state
    in whose place this one comes, None for none. memory_mb : see `WorkerLimits`. nice : priority of the process.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all its processes
    threading.Thread(target=end_with_the_parent, daemon=True).start()
    _step_back(nice)
    tempfile.tempdir = temporary
    limit_memory(memory_mb)
    state: Any = None
    while True:
        try:
            question, given, tells_steps = messages.recv()
        except EOFError:
            return
        answer: tuple[str, Any, Any]
        steps = {"progress": lambda text: messages.send(("step", text, None))} if tells_steps else {}
        try:
            if state is None:
                state = pkgutil.resolve_name(opening)(*arguments, kept)
            answer = ("answer", ready_to_send(pkgutil.resolve_name(question)(state, *given, **steps)), state.kept)
        except ERRORS as error:
            answer = ("error", error, None if state is None else state.kept)
        except MemoryError:
            answer = ("memory", None, None)
        messages.send(answer)


def ready_to_send(answer: Any) -> bytes:
    """Bytes as they are; other plain data as JSON in ASCII, `shown`, with null for what is not finite."""
    return answer if isinstance(answer, bytes) else json.dumps(nan_to_null(shown(answer))).encode()


def end_with_the_parent() -> None:
    """End with the page's server, even if that is killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _step_back(nice: int) -> None:
    """Give the daemon and the page precedence for processor and memory."""
    os.setpriority(os.PRIO_PROCESS, 0, max(nice, os.getpriority(os.PRIO_PROCESS, 0)))
    os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    Path("/proc/self/oom_score_adj").write_text(_KILLED_FIRST, encoding="ascii")


# Most processes with their states in memory, on the daemon's computer.
MAX_PROCESSES = 16
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
    """All workers."""

    def __init__(self, most: int = MAX_PROCESSES) -> None:
        """most : limit of processes at once."""
        self._context = multiprocessing.get_context("forkserver")
        self._most = most
        self._workers: weakref.WeakSet[Worker] = weakref.WeakSet()
        self._temporary: str | None = None
        self._lock = threading.Lock()
        #: held by the worker's thread that makes room and starts a process; the first waits for what is imported
        self.starting = threading.Lock()

    def prepare(self) -> None:
        """Start the process that workers are forked from, unless it runs. It imports what they need, which takes
        seconds; this does not wait for it."""
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

    def make_room(self, wanting: Worker, token: Token | None) -> list[Started]:
        """Kill the least recently used idle process of each share of the token that is used up; return these.

        Raises StateError if all processes of a share are busy.
        """
        with self._lock:
            workers = list(self._workers)
        leaving: list[Started] = []
        for share in shares_of(token, self._most):
            running = [worker for worker in workers if worker.pid is not None and worker is not wanting]
            holding = sorted((w for w in running if share.holds(w.token)), key=lambda worker: worker.used_s)
            excess = len(holding) + 1 - share.most
            for worker in holding:
                if excess <= 0:
                    break
                if (ended := worker.left()) is not None:
                    leaving += ended
                    excess -= 1
            if excess > 0:
                raise too_many(wanting.name, share.most, share.whose)
        return leaving

    def start(self, arguments: tuple[Any, ...]) -> Started:
        """Start a process. arguments : of `serve`, after the connection and the directory; call with `starting` held.

        Raises OSError or EOFError where the system lets none be started.
        """
        if self._temporary is None:
            self._temporary = tempfile.mkdtemp(prefix="compd-page-")
            weakref.finalize(self, shutil.rmtree, self._temporary, ignore_errors=True)
        temporary = tempfile.mkdtemp(dir=self._temporary)
        ours, theirs = self._context.Pipe()
        try:
            process = self._context.Process(target=serve, args=(theirs, temporary, *arguments), daemon=True)
            process.start()
        except BaseException:
            ours.close()
            shutil.rmtree(temporary)
            raise
        finally:
            theirs.close()
        return Started(process, ours, Path(temporary))

    def end(self) -> None:
        """End every process."""
        with self._lock:
            workers = list(self._workers)
        for worker in workers:
            worker.end()
