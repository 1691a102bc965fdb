"""Main function of a worker's process: opens its state at the first question, and answers until the end of input.

A message to it is (question, arguments, whether steps are told); a question is the name of a function that gets the
state first. Messages from it are (kind, content, kept): "step" with a text; "answer" with bytes; "error" with the
exception; "memory".
"""

from __future__ import annotations

import json
import multiprocessing
import os
import pkgutil
import signal
import threading
from collections.abc import Sequence
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from compd.errors import CompdError
from compd.live.system import limit_memory
from compd.text import nan_to_null

_NICE = 10
# OOM score adjustment (at most 1000): the system ends a worker first if memory is short.
_KILLED_FIRST = "700"
# Exceptions that stand for an answer: a problem for a person, a missing key, a missing file.
ERRORS = (CompdError, KeyError, IndexError, FileNotFoundError)


def serve(messages: Connection, opening: str, arguments: Sequence[Any], kept: Any, memory_mb: float) -> None:
    """Answer questions until the other end is closed.

    opening : "package.module:Class" of the state. arguments : of the class, before `kept`. kept : `kept` of the state
    in whose place this one comes, None for none. memory_mb : see `WorkerLimits`.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all its processes
    threading.Thread(target=end_with_the_parent, daemon=True).start()
    _step_back()
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
    """Bytes as they are; other plain data as JSON in ASCII, with null for what is not finite."""
    return answer if isinstance(answer, bytes) else json.dumps(nan_to_null(answer)).encode()


def end_with_the_parent() -> None:
    """End with the page's server, even if that is killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _step_back() -> None:
    """Give the daemon and the page precedence for processor and memory."""
    os.setpriority(os.PRIO_PROCESS, 0, max(_NICE, os.getpriority(os.PRIO_PROCESS, 0)))
    os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    Path("/proc/self/oom_score_adj").write_text(_KILLED_FIRST, encoding="ascii")
