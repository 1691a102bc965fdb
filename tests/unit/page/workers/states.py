"""States for tests of workers, that answer, wait, fail or grow as they are asked to."""

from __future__ import annotations

import os
import signal
import threading

from compd.errors import StateError


class Counter:
    """Counts its questions; another one goes on where it ended."""

    def __init__(self, kept=None):
        self.kept = kept or 0

    def count(self, by):
        self.kept += by
        return {"count": self.kept, "pid": os.getpid(), "nice": os.nice(0), "not finite": float("nan")}

    def octets(self):
        return b"as it is"

    def wait(self):
        threading.Event().wait()

    def tell_and_wait(self, progress):
        progress("it has begun")
        threading.Event().wait()

    def grow(self):
        return len(bytearray(400_000_000))

    def grow_a_little(self):
        return len(bytearray(4_000_000))

    def refuse(self):
        raise StateError.of("here", "cannot be done")

    def miss(self):
        raise KeyError("name")

    def fail(self):
        raise ZeroDivisionError

    def be_killed(self):
        os.kill(os.getpid(), signal.SIGKILL)


class Faulty:
    """Cannot be opened."""

    def __init__(self, kept=None):
        raise StateError.of("file", "cannot be opened")
