"""What the daemon's processes print, from their pipes to the log: whole lines, and of a flood only so many."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Iterator, Mapping
from selectors import EVENT_READ

import structlog

from compd.live.system import System

# Limits of a process's log: lines per second on average, and lines at once after a quiet time.
LINES_PER_S = 50.0
BURST_LINES = 200
# Largest read of a source, and its interval. A process that prints more waits for its own pipe.
READ_BYTES = 64 * 1024
ROUND_S = 0.05
MAX_LINE_BYTES = 4096
REPORT_EVERY_S = 1.0
# At the end: what a full pipe holds, and what is printed while it is emptied.
_LAST_ROUNDS = 4
_STOP_TIMEOUT_S = 2.0

_log = structlog.get_logger()


class _Source:
    """One pipe: its unfinished line, how many lines it may send now, and how many were dropped."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.dropped = 0
        self.report_due_s = -math.inf
        self._unfinished = b""
        self._tokens = float(BURST_LINES)
        self._filled_s = math.inf

    def lines(self, data: bytes, now_s: float) -> Iterator[str]:
        """The lines that `data` completes, as many as may be sent; the others are counted in `dropped`."""
        self._tokens = min(BURST_LINES, self._tokens + max(0.0, now_s - self._filled_s) * LINES_PER_S)
        self._filled_s = now_s
        *whole, rest = (self._unfinished + data).split(b"\n", int(self._tokens))
        self._tokens -= len(whole)
        # the rest has more than an unfinished line only where no more lines may be sent
        self.dropped += rest.count(b"\n")
        # one byte more than is shown, so that the line is known to be too long
        self._unfinished = rest[rest.rfind(b"\n") + 1 :][: MAX_LINE_BYTES + 1]
        for line in whole:
            cut = " ..." if len(line) > MAX_LINE_BYTES else ""
            yield line[:MAX_LINE_BYTES].decode("utf-8", "replace") + cut + "\n"

    def last_line(self, now_s: float) -> Iterator[str]:
        """The unfinished line, if there is one."""
        if self._unfinished:
            yield from self.lines(b"\n", now_s)


class LogRelay:
    """Copies lines from pipes to `write`, on a thread of its own that sleeps while nothing is printed.

    A pipe whose write ends are all closed is forgotten, and the others go on. The pipes' read ends stay the caller's to
    close, after `stop`.
    """

    def __init__(self, sources: Mapping[str, int], write: Callable[[str], None], system: System) -> None:
        """`sources`: read end of each pipe by the name of its process. `write` gets one line at a time, with its end;
        where it raises OSError or ValueError, the line is lost and nothing else."""
        self._sources = {descriptor: _Source(name) for name, descriptor in sources.items()}
        self._write = write
        self._system = system
        self._stop = threading.Event()
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._selector = system.selector()
        for descriptor in (*self._sources, self._wake):
            self._selector.register(descriptor, EVENT_READ)
        self._thread = system.thread(self._run, "log relay")

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Relay what is in the pipes and end; returns after a bounded time, also where `write` hangs."""
        self._stop.set()
        os.eventfd_write(self._wake, 1)
        if self._thread.ident is not None:
            self._thread.join(_STOP_TIMEOUT_S)
        if not self._thread.is_alive():
            self._selector.close()
            os.close(self._wake)

    def round(self, timeout_s: float | None = 0.0) -> None:
        """Read every pipe that has something, once, and relay it; wait for that at most `timeout_s`, None: for ever.

        Called by the thread, and by tests in its place.
        """
        ready = [key.fd for key, _ in self._selector.select(timeout_s)]
        now_s = self._system.monotonic()
        for descriptor in ready:
            if descriptor != self._wake:
                self._relay(descriptor, now_s)
        for source in self._sources.values():
            if source.dropped and now_s >= source.report_due_s:
                source.report_due_s = now_s + REPORT_EVERY_S
                self._report(source)

    def _run(self) -> None:
        while not self._stop.is_set():
            self.round(self._longest_wait_s())
            self._system.wait(self._stop, ROUND_S)
        for _ in range(_LAST_ROUNDS):
            self.round()
        now_s = self._system.monotonic()
        for source in self._sources.values():
            self._send(source.last_line(now_s))
            if source.dropped:
                self._report(source)

    def _longest_wait_s(self) -> float | None:
        """Time until a number of dropped lines is to be reported, s; None where there is none."""
        due_s = min((source.report_due_s for source in self._sources.values() if source.dropped), default=None)
        return None if due_s is None else max(0.0, due_s - self._system.monotonic())

    def _relay(self, descriptor: int, now_s: float) -> None:
        source = self._sources[descriptor]
        try:
            data = os.read(descriptor, READ_BYTES)
        except OSError:
            data = b""
        if data:
            self._send(source.lines(data, now_s))
        else:  # the end, which would be found again and again
            self._selector.unregister(descriptor)
            self._send(source.last_line(now_s))

    def _send(self, lines: Iterator[str]) -> None:
        for line in lines:
            try:
                self._write(line)
            except (OSError, ValueError):  # nobody reads the log any more: the processes must go on all the same
                continue

    def _report(self, source: _Source) -> None:
        count, source.dropped = source.dropped, 0
        try:
            _log.warning("log lines dropped", source=source.name, count=count)
        except (OSError, ValueError):
            return
