"""A process of the daemon: started again and again, and how it ended."""

from __future__ import annotations

import signal
from collections.abc import Callable
from selectors import EVENT_READ

from compd.live.system.forked_process import OUT_OF_MEMORY, ForkedProcess
from compd.live.system.system import System


class ChildProcess:
    """One process, which may be started again when it has ended."""

    def __init__(
        self,
        name: str,
        run: Callable[[], None],
        system: System,
        output: int | None = None,
        keeps_sockets: bool = True,
    ) -> None:
        """`run`, `output`, `keeps_sockets`: as of `ForkedProcess`."""
        self.name = name  #: for STATUS, the log and `ps`
        self.starts = 0  #: how often it was started
        self.last_end = ""  #: how it ended last; "" before
        self.succeeded = False  #: whether it ended by itself and had done what it was for
        self.started_s = 0.0  #: monotonic time (s) of its last start
        self._killed_because = ""
        self._run = run
        self._system = system
        self._output = output
        self._keeps_sockets = keeps_sockets
        self._process: ForkedProcess | None = None

    @property
    def running(self) -> bool:
        """Whether there is a process."""
        return self._process is not None

    @property
    def pid(self) -> int:
        """Of the process that runs; 0 where none does."""
        return 0 if self._process is None else self._process.pid

    @property
    def pidfd(self) -> int:
        """Readable from the end of the process on; -1 where none runs."""
        return -1 if self._process is None else self._process.descriptor

    @property
    def is_debugged(self) -> bool:
        """Whether a debugger has stopped the process, or may have: it does not hang then."""
        return self._process is not None and self._process.is_debugged

    def start(self) -> None:
        """Fork. The caller must have no other thread."""
        self.starts += 1
        self.started_s = self._system.monotonic()
        self._process = self._system.fork(self._run, self.name, self._output, self._keeps_sockets)

    def collect(self) -> bool:
        """Whether the process has ended; `last_end` says how."""
        if self._process is None:
            return True
        if (exit_code := self._process.exit_code()) is None:
            return False
        self.succeeded = exit_code == 0
        self.last_end = self._killed_because or _meaning(exit_code)
        self._killed_because = ""
        self._process = None
        return True

    def kill(self, because: str) -> None:
        """SIGKILL; `because` becomes its `last_end`."""
        if self._process is not None:
            self._killed_because = because
            self._process.kill()

    def wait(self) -> None:
        """Return when the process has ended."""
        while not self.collect():
            with self._system.selector() as selector:
                selector.register(self.pidfd, EVENT_READ)
                selector.select()


def _meaning(exit_code: int) -> str:
    """An exit code, as `waitstatus_to_exitcode` has it, in words."""
    if exit_code < 0:
        return f"killed by {signal.Signals(-exit_code).name}"
    if exit_code == OUT_OF_MEMORY:
        return "it used more memory than acquisition.memory_mb"
    return f"ended with code {exit_code}" + (": its traceback is in the log" if exit_code == 1 else "")
