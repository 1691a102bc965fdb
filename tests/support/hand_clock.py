"""Clocks in the test's hands."""

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


class SteppedClock(System):
    """The real clock, which a test can put forward. reads : how often it was read."""

    def __init__(self) -> None:
        self.ahead_s = 0.0
        self.reads = 0

    def monotonic(self) -> float:
        self.reads += 1
        return super().monotonic() + self.ahead_s

    def step(self, step_s: float) -> None:
        """Let `step_s` pass."""
        self.ahead_s += step_s
