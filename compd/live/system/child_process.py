"""A process of the daemon: forked from the supervisor, which has imported and compiled everything that it needs."""

from __future__ import annotations

import ctypes
import os
import select
import signal
import stat
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from compd.clock import Clock

_PR_SET_PDEATHSIG, _PR_SET_NAME = 1, 15  # linux/prctl.h
_MAX_NAME = 15
# Signals that the supervisor gets for all: a terminal's Ctrl-C and systemd send them to every process.
_LEFT_TO_SUPERVISOR = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
OUT_OF_MEMORY = 70
_STDOUT, _STDERR = 1, 2

_libc = ctypes.CDLL(None, use_errno=True)


class ChildProcess:
    """One process, which may be started again when it has ended."""

    def __init__(
        self,
        name: str,
        run: Callable[[], None],
        clock: Clock,
        output: int | None = None,
        keeps_sockets: bool = True,
    ) -> None:
        """`run`: what the process does; it ends when this returns. `output`: descriptor to which everything goes that
        it prints; None is the supervisor's own. `keeps_sockets`: whether it has the sockets that are open now."""
        self.name = name  #: for STATUS, the log and `ps`
        self.pid = 0  #: pid, pidfd: of the process that runs; 0 and -1 where none does
        self.pidfd = -1
        self.starts = 0  #: how often it was started
        self.last_end = ""  #: how it ended last; "" before
        self._killed_because = ""
        self.succeeded = False  #: whether it ended by itself and had done what it was for
        self.started_s = 0.0  #: monotonic time (s) of its last start
        self._run = run
        self._clock = clock
        self._output = output
        self._keeps_sockets = keeps_sockets

    @property
    def running(self) -> bool:
        """Whether there is a process."""
        return self.pid != 0

    @property
    def is_debugged(self) -> bool:
        """Whether a debugger has stopped the process, or may have: it does not hang then."""
        try:
            status = Path(f"/proc/{self.pid}/status").read_text(encoding="ascii", errors="replace")
        except OSError:
            return False
        return "TracerPid:\t0\n" not in status

    def start(self) -> None:
        """Fork. The caller must have no other thread."""
        sys.stdout.flush()
        sys.stderr.flush()
        supervisor = os.getpid()
        self.starts += 1
        self.started_s = self._clock.monotonic()
        pid = os.fork()
        if pid == 0:
            self._be_child(supervisor)
        self.pid = pid
        self.pidfd = os.pidfd_open(pid)

    def collect(self) -> bool:
        """Whether the process has ended; `last_end` says how."""
        if not self.running:
            return True
        pid, status = os.waitpid(self.pid, os.WNOHANG)
        if pid == 0:
            return False
        exit_code = os.waitstatus_to_exitcode(status)
        self.succeeded = exit_code == 0
        self.last_end = self._killed_because or _meaning(exit_code)
        self._killed_because = ""
        os.close(self.pidfd)
        self.pid, self.pidfd = 0, -1
        return True

    def kill(self, because: str) -> None:
        """SIGKILL, which ends also a process that is stopped; `because` becomes its `last_end`."""
        if self.running:
            self._killed_because = because
            os.kill(self.pid, signal.SIGKILL)

    def wait(self) -> None:
        """Return when the process has ended."""
        while not self.collect():
            select.select([self.pidfd], [], [])

    def _be_child(self, supervisor: int) -> None:
        """Run, and end; never returns."""
        code = 1
        try:
            # without the supervisor nobody would start it anew, nor end it
            end_with_parent()
            if os.getppid() != supervisor:
                os._exit(code)
            _libc.prctl(_PR_SET_NAME, f"compd {self.name}".encode()[:_MAX_NAME], 0, 0, 0)
            signal.set_wakeup_fd(-1)
            for number in _LEFT_TO_SUPERVISOR:
                signal.signal(number, signal.SIG_IGN)
            if self._output is not None:
                os.dup2(self._output, _STDOUT)
                os.dup2(self._output, _STDERR)
            if not self._keeps_sockets:
                _close_sockets()
            self._run()
            code = 0
        except MemoryError:
            code = OUT_OF_MEMORY
        except SystemExit as end:  # it has said why
            code = end.code if isinstance(end.code, int) else 1
        except BaseException:  # noqa: BLE001  the fork must not return into the supervisor's code
            traceback.print_exc()
        finally:
            try:
                sys.stdout.flush()
                sys.stderr.flush()
            finally:
                os._exit(code)


def end_with_parent() -> None:
    """Have this process killed when the thread that has started it ends, as with its process."""
    _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def _close_sockets() -> None:
    """Close every socket that this process has from the supervisor."""
    for descriptor in [int(path.name) for path in Path("/proc/self/fd").iterdir()]:
        with suppress(OSError):  # that of the directory itself is closed already
            if stat.S_ISSOCK(os.fstat(descriptor).st_mode):
                os.close(descriptor)


def _meaning(exit_code: int) -> str:
    """An exit code, as `waitstatus_to_exitcode` has it, in words."""
    if exit_code < 0:
        return f"killed by {signal.Signals(-exit_code).name}"
    if exit_code == OUT_OF_MEMORY:
        return "it used more memory than acquisition.memory_mb"
    return f"ended with code {exit_code}" + (": its traceback is in the log" if exit_code == 1 else "")
