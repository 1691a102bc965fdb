"""A clock in the test's hands."""

from __future__ import annotations

import threading

from compd.live.system import System


class HandClock(System):
    """Time stands, until a test sets `now_s`; nothing may wait for it."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        return self.now_s

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        raise AssertionError("nothing waits while time stands")
