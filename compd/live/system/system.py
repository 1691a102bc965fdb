"""The computer, as the daemon uses it: time, waiting, ports, files, threads and processes come through here.

Nothing in `compd.live`, in lines or in drivers reads a clock, waits, or starts a thread or process around it, so that a
test may put another computer in its place (tests/worlds).
"""

from __future__ import annotations

import os
import selectors
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from uuid import UUID

from compd.clock import MonotonicClock
from compd.files import Content, read_small_file, sync_directory, write_files
from compd.lines import PORTS, Ports
from compd.live.system.datagrams import Datagrams
from compd.live.system.forked_process import ForkedProcess
from compd.live.system.journal import Journal
from compd.live.system.privileges import Privileges
from compd.live.system.realtime import sleep_until
from compd.live.system.systemd import Notifier

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
# Set by the unit: %b of systemd.unit(5).
_GIVEN_BOOT_ID = "COMPD_BOOT_ID"
SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)


class System(MonotonicClock):
    """This computer."""

    ports: Ports = PORTS  #: serial ports and TCP connections of lines
    privileges = Privileges()  #: what real time needs

    def sleep_until(self, time_s: float) -> None:
        """Sleep until a monotonic time, s."""
        sleep_until(time_s)

    def utc(self) -> datetime:
        """The calendar's time, which a person or a time server may set at any moment."""
        return datetime.now(UTC)

    def boot_id(self) -> str:
        """A text that is another one after every start of the computer.

        The unit gives it, since it hides the kernel's own (ProcSubset=pid of systemd.exec(5)).
        """
        given = os.environ.get(_GIVEN_BOOT_ID)
        return str(UUID(given)) if given else _BOOT_ID.read_text(encoding="ascii").strip()

    def selector(self) -> selectors.BaseSelector:
        """Waits for descriptors; the caller closes it."""
        return selectors.DefaultSelector()

    def thread(self, run: Callable[[], object], name: str) -> threading.Thread:
        """A thread that ends with its process at the latest; the caller starts it."""
        return threading.Thread(target=run, name=name, daemon=True)

    def fork(self, run: Callable[[], None], name: str, output: int | None, keeps_sockets: bool) -> ForkedProcess:
        """Start a process; see `ForkedProcess`."""
        return ForkedProcess(run, name, output, keeps_sockets)

    def datagrams(self, host: str, port: int) -> Datagrams:
        """Packets to an address. Raises OSError for an unknown host."""
        return Datagrams(host, port)

    def journal(self) -> Journal | None:
        """The journal of systemd; None where standard error does not lead to it."""
        return Journal.from_environment()

    def notifier(self) -> Notifier:
        """What tells systemd of the daemon's state."""
        return Notifier.from_environment()

    def read_file(self, path: Path, limit_bytes: int) -> bytes:
        """A file as a whole. Raises OSError, also for one that is longer."""
        return read_small_file(path, limit_bytes)

    def write_files(self, contents: Mapping[Path, Content]) -> None:
        """Make the directories of these files, and write all or none; see `compd.files.write_files`. Raises OSError."""
        for path in contents:
            path.parent.mkdir(parents=True, exist_ok=True)
        write_files(contents)

    def rename(self, path: Path, new: Path) -> None:
        """Give a file another path in its directory, where it replaces what is there. Raises OSError."""
        path.replace(new)
        sync_directory(new.parent)

    def has_file(self, path: Path) -> bool:
        """Whether there is a file at this path."""
        return path.is_file()

    @contextmanager
    def signals(self) -> Iterator[int]:
        """A descriptor from which the numbers of SIGTERM, SIGINT and SIGHUP can be read, one byte each.

        A signal that stops the process, or lets it continue, is none of these and ends no wait.
        """
        reading, writing = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        before = [signal.signal(number, lambda *_: None) for number in SIGNALS]
        wakeup_before = signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
        try:
            yield reading
        finally:
            signal.set_wakeup_fd(wakeup_before)
            for number, handler in zip(SIGNALS, before, strict=True):
                signal.signal(number, handler)
            os.close(reading)
            os.close(writing)


THIS_COMPUTER = System()
