"""A worker: a process that holds a state and answers questions about it in turn, within limits."""

from __future__ import annotations

import asyncio
import shutil
import threading
import time
from collections import deque
from collections.abc import Callable, Coroutine, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from compd.errors import CompdError
from compd.page.shares import ASKER, looks_only
from compd.page.workers import limits as limited
from compd.page.workers.limits import WorkerLimits

if TYPE_CHECKING:
    from compd.page.guard import Token


@dataclass(eq=False)
class Asked:
    """One question.

    question : "package.module:function", or "package.module:Class.method", of what gets the worker's state first. It is
        named, so that the server imports none of it. given : its further arguments, plain data.
    seconds : that the answer may take. progress : called with each step that is told, by the worker's thread.
    answer : bytes that are ready to be sent, or the exception.
    is_cancelled : whether the question was abandoned.
    token : of the request that asks; its share of the processes has this one. None outside a request.
    """

    question: str
    given: Sequence[Any]
    seconds: float
    progress: Callable[[str], None] | None = None
    answer: Future[bytes] = field(default_factory=Future)
    is_cancelled: bool = False
    token: Token | None = field(default_factory=ASKER.get)


# A process closes its connection just before its end.
_ENDS_WITHIN_S = 5.0
# Priorities, see nice(2): the page and the daemon go first, and then whoever operates.
NICE, VIEWERS_NICE = 10, 19
# Exit code of a process after an unexpected exception.
_FAULT = 1


class Started(NamedTuple):
    """A process, the connection to it, and its directory of temporary files, which goes with it."""

    process: ForkServerProcess
    messages: Connection
    temporary: Path


class Starter(Protocol):
    """Starts the processes of all workers; see `compd.page.workers.workers.Workers`."""

    starting: threading.Lock

    def prepare(self) -> None: ...
    def make_room(self, wanting: Worker, token: Token | None) -> list[Started]: ...
    def start(self, arguments: tuple[Any, ...]) -> Started: ...


class Worker:
    """Its process starts with the first question. After its end the next question starts another.

    It ends when idle, killed or beyond a limit; its successor opens the state again.
    """

    def __init__(
        self, starter: Starter, name: str, opening: str, arguments: Sequence[Any], limits: WorkerLimits
    ) -> None:
        """starter : starts its process. opening, arguments : see `worker_process.serve`."""
        self._starter, self._limits = starter, limits
        self._opening, self._arguments = opening, arguments
        self.name = name  #: of what it works on, for people
        #: plain data that the state told last, from which another goes on in its place; None before the first answer
        self.kept: Any = None
        self.used_s = time.monotonic()  #: when it was used last, on a monotonic clock
        self.token: Token | None = None  #: whose question it has answered last, or works on
        self._changed = threading.Condition()
        self._waiting: deque[Asked] = deque()
        self._current: Asked | None = None
        self._thread: threading.Thread | None = None
        self._running: Started | None = None

    @property
    def pid(self) -> int | None:
        """Id of its process; None without a process."""
        running = self._running
        return None if running is None else running.process.pid

    @property
    def questions(self) -> int:
        """Number of unanswered questions."""
        with self._changed:
            return len(self._waiting) + (self._current is not None)

    def ask(self, question: str, *given: Any, seconds: float) -> Coroutine[Any, Any, bytes]:
        """The answer, to be awaited. Cancelling the caller cancels the question, too.

        Raises what the state raises of CompdError, KeyError, IndexError and FileNotFoundError; StateError where a limit
        is met, or the process was killed.
        """
        # counted at once, so that the next request takes another worker
        return self._awaited(self.submit(question, *given, seconds=seconds))

    async def _awaited(self, asked: Asked) -> bytes:
        try:
            return await asyncio.wrap_future(asked.answer)
        except asyncio.CancelledError:
            self.cancel(asked)
            raise

    def submit(
        self, question: str, *given: Any, seconds: float, progress: Callable[[str], None] | None = None
    ) -> Asked:
        """As `ask`, without waiting; `progress` is called with each step that the state tells."""
        self._starter.prepare()
        asked = Asked(question, given, seconds, progress)
        with self._changed:
            if self._thread is None:
                thread = threading.Thread(target=self._answer_all, name=f"worker {self.name}", daemon=True)
                try:
                    thread.start()
                except RuntimeError as error:
                    raise limited.none_left(self.name) from error
                self._thread = thread
            self._waiting.append(asked)
            self._changed.notify_all()
        return asked

    def cancel(self, asked: Asked) -> None:
        """Cancel a question, with the process that works on it; no effect once there is an answer."""
        asked.answer.cancel()
        with self._changed:
            asked.is_cancelled = True
            if self._current is asked and self._running is not None:
                self._running.process.kill()

    def end(self) -> None:
        """Cancel every question, and end the process."""
        with self._changed:
            every = [*self._waiting, *([] if self._current is None else [self._current])]
        for asked in every:
            self.cancel(asked)
        self.rest()

    def rest(self) -> bool:
        """End the process unless it works on a question; return whether there is none now."""
        ended = self.left()
        for process in ended or ():
            _wait_for_end(process)
        return ended is not None

    def left(self) -> list[Started] | None:
        """As `rest`, without waiting: the process that is ending, if there was one; None where it works."""
        with self._changed:
            if self._current is not None:
                return None
            ended = self._detached()
        return [] if ended is None else [ended]

    def _answer_all(self) -> None:
        """Loop of the worker's thread: runs while there is a process, until it has been idle for a while."""
        while (asked := self._next()) is not None:
            # skip a question that was cancelled while waiting
            if asked.answer.set_running_or_notify_cancel():
                tell: Callable[[], None]
                try:
                    tell = partial(asked.answer.set_result, self._answer(asked))
                except Exception as error:  # noqa: BLE001  passed to the waiting caller
                    tell = partial(asked.answer.set_exception, error)
                with self._changed:  # the receiver of the answer may end the process
                    self._current = None
                tell()

    def _next(self) -> Asked | None:
        with self._changed:
            self._current = None
            self.used_s = time.monotonic()
            self._changed.wait_for(lambda: self._waiting or self._running is None, timeout=self._limits.idle_s)
            if self._waiting:
                self._current = self._waiting.popleft()
                return self._current
            ended = self._detached()
            self._thread = None
        _wait_for_end(ended)
        return None

    def _answer(self, asked: Asked) -> bytes:
        messages, is_new = self._started(asked)
        allowed_s = asked.seconds + (self._limits.opening_s if is_new else 0.0)
        try:
            kind, content, kept = _reply(messages, asked, allowed_s)
        except TimeoutError:
            raise self._ended(limited.too_long(self.name, allowed_s)) from None
        except (EOFError, OSError) as error:
            if asked.is_cancelled:
                raise self._ended(limited.cancelled(self.name)) from None
            raise self._ended(self._without_a_word(asked)) from error
        self.kept = self.kept if kept is None else kept
        if kind == "memory":
            raise self._ended(limited.too_large(self.name, self._limits.memory_mb))
        if kind == "error":
            raise content
        answer: bytes = content
        return answer

    def _without_a_word(self, asked: Asked) -> CompdError:
        """Reason of the process's end. Raises RuntimeError for a fault of compd, which is in the log."""
        with self._changed:
            running = self._running
        if running is not None:
            running.process.join(_ENDS_WITHIN_S)
            if running.process.exitcode == _FAULT:
                self._ended(limited.cancelled(self.name))
                raise RuntimeError(f"{asked.question} failed; its process wrote why")
        return limited.killed(self.name, self._limits.memory_mb)

    def _ended(self, error: CompdError) -> CompdError:
        """End the process and return `error`."""
        with self._changed:
            ended = self._detached()
        _wait_for_end(ended)
        return error

    def _started(self, asked: Asked) -> tuple[Connection, bool]:
        """The connection to the process, and whether it is new. Raises StateError if none can be started."""
        ended = None
        with self._changed:
            if self._running is not None and not self._running.process.is_alive():
                ended = self._detached()
            if self._running is not None and self.token == asked.token:
                return self._running.messages, False
        _wait_for_end(ended)
        nice = VIEWERS_NICE if looks_only(asked.token) else NICE
        arguments = (self._opening, self._arguments, self.kept, self._limits.memory_mb, nice)
        with self._starter.starting:  # nobody waits here for the end of another's process
            leaving = self._starter.make_room(self, asked.token)
            self.token = asked.token
            running, is_new = self._running, self._running is None
            if running is None:
                try:
                    running = self._starter.start(arguments)
                except (OSError, EOFError) as error:  # the fork server has ended, or cannot fork
                    raise limited.none_left(self.name) from error
                with self._changed:
                    self._running = running
                    if asked.is_cancelled:
                        running.process.kill()
        for process in leaving:
            _wait_for_end(process)
        return running.messages, is_new

    def _detached(self) -> Started | None:
        """Detach the process, which is being killed; call with `_changed` locked."""
        running, self._running = self._running, None
        if running is not None:
            running.process.kill()
            running.messages.close()
        self._changed.notify_all()
        return running


def _wait_for_end(ended: Started | None) -> None:
    """Wait until its memory and its files are gone; without any lock, since that may take long."""
    if ended is not None:
        ended.process.join(_ENDS_WITHIN_S)
        shutil.rmtree(ended.temporary, ignore_errors=True)


def _reply(messages: Connection, asked: Asked, allowed_s: float) -> tuple[str, Any, Any]:
    """The message that ends a question: kind, content, kept. Raises TimeoutError; EOFError or OSError at its end."""
    messages.send((asked.question, asked.given, asked.progress is not None))
    until_s = time.monotonic() + allowed_s
    while messages.poll(max(0.0, until_s - time.monotonic())):
        kind, content, kept = messages.recv()
        if kind != "step":
            return kind, content, kept
        if asked.progress is not None:
            asked.progress(content)
    raise TimeoutError
