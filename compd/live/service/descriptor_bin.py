"""Closing the descriptors that clients sent and nobody wants: to close one may wait for a file system that hangs."""

from __future__ import annotations

import os
import queue
import threading
from contextlib import suppress

# Descriptors that wait to be closed. With more the one before them hangs, and no further ones are taken.
MOST_WAITING = 64


class DescriptorBin:
    """Closes descriptors on a thread of its own, so that the thread that serves never waits for one."""

    def __init__(self) -> None:
        self._waiting: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    @property
    def is_full(self) -> bool:
        """Whether no further descriptors should be taken from clients: those before them cannot be closed."""
        return self._waiting.qsize() >= MOST_WAITING

    def put(self, descriptor: int) -> None:
        """Close it soon."""
        self._waiting.put(descriptor)
        if self._thread is None:  # in the process that serves: threads do not survive a fork
            self._thread = threading.Thread(target=self._close_all, name="descriptors", daemon=True)
            self._thread.start()

    def _close_all(self) -> None:
        while True:
            with suppress(OSError):  # what the file system says at the end is nobody's concern here
                os.close(self._waiting.get())
