"""Closing the descriptors that clients sent and nobody wants: to close one may wait, for a file system or a socket."""

from __future__ import annotations

import math
import queue
import threading
from contextlib import suppress

from compd.files import close_descriptor
from compd.live.system import System

# Descriptors that wait to be closed. With more the one before them hangs, and no further ones are taken.
MAX_WAITING = 64
# Closing takes microseconds where nothing hangs, s.
_HANGS_AFTER_S = 1.0


class DescriptorBin:
    """Closes descriptors on a thread of its own, so that the thread that serves never waits for one."""

    def __init__(self, system: System) -> None:
        self._system = system
        self._filled = threading.Event()
        self._waiting: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._begun_s = math.inf

    @property
    def is_full(self) -> bool:
        """Whether no further descriptors should be taken from clients: those before them cannot be closed."""
        return self._waiting.qsize() >= MAX_WAITING

    @property
    def hangs(self) -> bool:
        """Whether one has been waited for since long."""
        return self._system.monotonic() - self._begun_s > _HANGS_AFTER_S

    def put(self, descriptor: int) -> None:
        """Close it soon."""
        self._waiting.put(descriptor)
        self._filled.set()
        if self._thread is None:  # in the process that serves: threads do not survive a fork
            self._thread = self._system.thread(self._close_all, "descriptors")
            self._thread.start()

    def _close_all(self) -> None:
        while True:
            while self._waiting.empty():
                self._filled.clear()
                if self._waiting.empty():  # nothing was put in between
                    self._system.wait(self._filled, _HANGS_AFTER_S)
            descriptor = self._waiting.get_nowait()
            self._begun_s = self._system.monotonic()
            with suppress(OSError):  # what the file system says at the end is nobody's concern here
                close_descriptor(descriptor)
            self._begun_s = math.inf
