"""The clock that is passed to whatever needs the time: the monotonic one in the program, a simulated one in tests."""

from __future__ import annotations

import threading
import time
from typing import Protocol


class Clock(Protocol):
    """Monotonic seconds, and waiting that an event can cut short."""

    def monotonic(self) -> float:
        """Seconds on a clock that never steps (CLOCK_MONOTONIC)."""
        ...

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        """Wait until `event` is set or `timeout_s` has passed; True if it was set."""
        ...


class MonotonicClock:
    """The machine's own monotonic clock."""

    def monotonic(self) -> float:
        return time.monotonic()

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        return event.wait(timeout_s)
