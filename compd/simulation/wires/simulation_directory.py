"""The directory of a running simulated machine: one simulator at a time, emptied at the end."""

from __future__ import annotations

import fcntl
import os
import socket
from pathlib import Path

from compd.errors import CompdError

CONTROL_SOCKET = "control.sock"
DAEMON_SOCKET = "compd.sock"
SEALED_ANSWER = "hidden.answer.json"
PORTS = "ports"
STATE = "state"
# Files of a simulator and of its daemon, with the copies that a crash leaves.
_MADE = ((PORTS, "*"), (STATE, "*machine-zero.json*"), (STATE, "*last-readings.json*"))
# In the first line of the daemon's configuration, of 0.3 too: only a file that says so is replaced and removed.
WRITTEN_BY = "with the ports of a simulated machine; written by `compd sim"


class SimulationDirectory:
    """Holds the daemon's configuration, ports, sockets and state while a simulated machine runs.

    The next machine is another one: the machine zero of the last does not fit it.
    """

    def __init__(self, path: Path, configuration_name: str) -> None:
        """path : an existing directory. configuration_name : file name of the daemon's configuration in it."""
        self.path = path
        self._configuration = path / configuration_name
        self._lock = -1

    def begin(self) -> None:
        """Take the directory, and remove the remains of a killed simulator.

        Raises CompdError if another simulator or a daemon runs in it, or a file would be replaced that no simulator
        wrote.
        """
        self._lock = os.open(self.path, os.O_RDONLY | os.O_DIRECTORY)
        try:
            self._check()
        except CompdError:
            os.close(self._lock)
            raise
        self._clear()
        (self.path / SEALED_ANSWER).unlink(missing_ok=True)

    def end(self) -> None:
        """Remove the simulator's files, and release the directory."""
        self._clear()
        os.close(self._lock)

    def _check(self) -> None:
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise CompdError.of(
                str(self.path),
                "another simulator runs in this directory",
                next_step="end it (Ctrl-C in its terminal), or give another --directory",
            ) from None
        if is_served(self.path / DAEMON_SOCKET):
            raise CompdError.of(
                str(self.path / DAEMON_SOCKET),
                "a daemon still runs for the machine that was simulated here",
                next_step="end it (Ctrl-C in its terminal), or give another --directory",
            )
        if self._configuration.exists() and not self._is_ours():
            raise CompdError.of(
                str(self._configuration),
                "would be replaced, and was not written by `compd sim run`",
                next_step="give another --directory",
            )

    def _is_ours(self) -> bool:
        with self._configuration.open("rb") as file:
            return WRITTEN_BY.encode() in file.readline(1000)

    def _clear(self) -> None:
        if self._configuration.exists() and self._is_ours():
            self._configuration.unlink()
        for name in (CONTROL_SOCKET, DAEMON_SOCKET):
            if not is_served(self.path / name):
                (self.path / name).unlink(missing_ok=True)
        for folder, pattern in _MADE:
            directory = self.path / folder
            for path in directory.glob(pattern):
                if path.is_symlink() or folder == STATE:
                    path.unlink()
            if directory.is_dir() and not any(directory.iterdir()):
                directory.rmdir()


def is_served(path: Path) -> bool:
    """Whether a process listens on the Unix socket."""
    with socket.socket(socket.AF_UNIX) as probe:
        try:
            probe.connect(str(path))
        except OSError:
            return False
    return True
