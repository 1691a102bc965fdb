"""A process that is forked from the supervisor, which has imported and compiled everything that it needs."""

from __future__ import annotations

import ctypes
import os
import signal
import stat
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

_PR_SET_PDEATHSIG, _PR_SET_NAME = 1, 15  # linux/prctl.h
_MAX_NAME = 15
# Signals that the supervisor gets for all: a terminal's Ctrl-C and systemd send them to every process.
_LEFT_TO_SUPERVISOR = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
OUT_OF_MEMORY = 70
_STDOUT, _STDERR = 1, 2

_libc = ctypes.CDLL(None, use_errno=True)


class ForkedProcess:
    """One process, from its start to its end."""

    def __init__(self, run: Callable[[], None], name: str, output: int | None, keeps_sockets: bool) -> None:
        """Fork. The caller must have no other thread.

        run : what the process does; it ends when this returns. name : in `ps`. output : descriptor to which everything
        goes that it prints; None is the caller's own. keeps_sockets : whether it has the sockets that are open now.
        """
        sys.stdout.flush()
        sys.stderr.flush()
        parent = os.getpid()
        self.pid = os.fork()
        if self.pid == 0:
            _be_child(parent, run, name, output, keeps_sockets)
        self.descriptor = os.pidfd_open(self.pid)  #: readable from the end of the process on

    @property
    def is_debugged(self) -> bool:
        """Whether a debugger has stopped the process, or may have: it does not hang then."""
        try:
            status = Path(f"/proc/{self.pid}/status").read_text(encoding="ascii", errors="replace")
        except OSError:
            return False
        return "TracerPid:\t0\n" not in status

    def exit_code(self) -> int | None:
        """How it has ended, the number of a signal negative; None while it runs. Not to be called again after that."""
        pid, status = os.waitpid(self.pid, os.WNOHANG)
        if pid == 0:
            return None
        os.close(self.descriptor)
        return os.waitstatus_to_exitcode(status)

    def kill(self) -> None:
        """SIGKILL, which ends also a process that is stopped."""
        os.kill(self.pid, signal.SIGKILL)


def _be_child(parent: int, run: Callable[[], None], name: str, output: int | None, keeps_sockets: bool) -> None:
    """Run, and end; never returns."""
    code = 1
    try:
        # without the supervisor nobody would start it anew, nor end it
        end_with_parent()
        if os.getppid() != parent:
            os._exit(code)
        _libc.prctl(_PR_SET_NAME, f"compd {name}".encode()[:_MAX_NAME], 0, 0, 0)
        signal.set_wakeup_fd(-1)
        for number in _LEFT_TO_SUPERVISOR:
            signal.signal(number, signal.SIG_IGN)
        if output is not None:
            os.dup2(output, _STDOUT)
            os.dup2(output, _STDERR)
        if not keeps_sockets:
            _close_sockets()
        run()
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
